"""The tables of why our maps differ from COLMAP's, and of more sources."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import (
    NOT_KNOWN,
    markdown_table,
    number,
    percent,
)

Measured = Mapping[str, Any]

COSTS = {
    "own_6": "our window, 6 sources",
    "own_20": "our window, 20",
    "colmap_6": "COLMAP's window, 6",
    "colmap_20": "COLMAP's window, 20",
}
QUESTIONS = {
    "share": "share of the confirmed pixels",
    "confirming_theirs": "other maps of COLMAP that confirm COLMAP's depth",
    "confirming_ours": "other maps of COLMAP that confirm ours",
    "ours_confirmed": "ours confirmed by at least one of them",
    "alike": "depths within 2 % of the pixel's own in COLMAP's 5 x 5 window",
    "near_step": "within 5 px of a step in depth of 3 % in our map",
    "texture": "grey values' standard deviation in 9 x 9 px, of 255",
    "seeing": "of our six sources show the point in their frame",
}
SHARES = ("share", "ours_confirmed", "alike", "near_step")


def chance_parts(part: Measured) -> list[str]:
    """Where confirmed pixels lie side by side, where alone, and what chance does."""
    keys = ("dense", "agree_dense", "agree_sparse", "chance")
    rows = [
        [name, *[percent(entry[key]) for key in keys]]
        for name, entry in {**part["maps"], "**mean**": part["mean"]}.items()
    ]
    return [
        "The confirmed pixels of `meeting_room` by what surrounds them: dense ones, "
        "around which at least half of the 5 x 5 pixels are confirmed too, and sparse "
        "ones; on how many of either we agree within 2 %; and how many pixels outside "
        "of the dense areas would be confirmed if COLMAP's depth there were wrong by 5 "
        "or 10 %, over the number of the sparse ones:",
        markdown_table(
            "image | dense | dense: agree | sparse: agree | sparse: by chance", rows
        ),
    ]


def left_out_parts(part: Measured) -> list[str]:
    """What COLMAP's maps and ours say of the pixels that further maps confirm."""
    of, keys = ("theirs", "ours"), ("agree", "nearer", "farther", "apart")
    rows = [
        [name, *[percent(entry[who][key]) for who in of for key in keys]]
        for name, entry in {**part["maps"], "**mean**": part["mean"]}.items()
    ]
    columns = ("within 2 %", "nearer", "farther", "within 2 % of what is not nearer")
    titles = (f"{who}: {column}" for who in ("COLMAP's", "ours") for column in columns)
    return [
        "How far COLMAP's maps agree with each other: of each image the pixels that "
        "other maps of COLMAP confirm within 1 %, seen in the view of one more map, "
        "which is left out of them, where that has a depth; what this map of COLMAP "
        "says there, and our map of the same view at the same pixels (a nearer depth "
        "may hide the point):",
        markdown_table(f"image | {' | '.join(titles)}", rows),
    ]


def more_sources_parts(part: Measured) -> list[str]:
    """The images that agree least, before and after."""
    number_of, rows = part["num_sources"], []
    for name, entry in part["maps"].items():
        kind = entry["before_kind"]
        rows.append([name, f"6, {kind}", *_within(entry["before"]), NOT_KNOWN])
        cells = _within(entry["geometric"])
        seconds = number(entry["geometric"]["cpu_s"], digits=1)
        rows.append([name, f"6, then {number_of}", *cells, seconds])
    return [
        f"With {number_of} sources instead of 6 in the geometric pass, the images of "
        "`meeting_room` that agree least:",
        markdown_table(
            "image | sources | within 1 % | within 2 % | within 5 % | s",
            rows,
            num_texts=2,
        ),
    ]


def _within(shares: Measured) -> list[str]:
    return [percent(shares[limit]) for limit in ("0.01", "0.02", "0.05")]


def disagreement_parts(part: Measured) -> list[str]:
    """Confirmations, what surrounds the pixels, and what the photographs prefer."""
    maps, mean = part["maps"], part["mean"]
    return [
        "Why they differ: by the number of other maps of COLMAP that confirm a pixel, "
        "its share of the confirmed ones, and on how many of those we agree within "
        "2 %; COLMAP's map beside the median of its own 5 x 5 window likewise; ours "
        "where at least half of that window is within 2 % of the pixel:",
        _counts_table(maps, mean),
        "Means over the images at the pixels where we agree and where we do not:",
        _questions_table(mean["groups"]),
        f"Which depth the photographs prefer at up to {part['num_asked']} of the "
        "pixels of each image where they differ (ours / COLMAP's; the rest is within "
        f"{part['margin']:g} of each other): least mean cost of the better half of "
        "the sources, 0 to 2, of planes within 0.5 % of either depth:",
        _costs_table(maps, mean["costs"]),
        _points_sentence(maps),
    ]


def from_theirs_parts(part: Measured) -> list[str]:
    """Where our matcher goes from COLMAP's map."""
    keys = ("before", "after", "stay", "return")
    rows = [
        [name, *[percent(entry[key]) for key in keys]]
        for name, entry in {**part["maps"], "**mean**": part["mean"]}.items()
    ]
    return [
        "Our photometric pass, started on COLMAP's own map instead of by chance, in "
        f"the {part['num_rows']} rows of each image where most pixels differ: how many "
        "of the confirmed pixels agree within 2 % before and after, and how many of "
        "those that differed stay at COLMAP's depth or return to ours:",
        markdown_table("image | before | after | stay | return", rows),
    ]


def _counts_table(maps: Measured, mean: Measured) -> str:
    rows = []
    for name, entry in {**maps, "**mean**": mean}.items():
        cells = [
            percent(entry["by_count"][label][key])
            for label in ("1", "2", "3 or more")
            for key in ("share", "agree")
        ]
        alike = [percent(entry["alike"][key]) for key in ("of_median", "where_alike")]
        rows.append([name, *cells, *alike])
    header = "image | " + " | ".join(
        f"{label}: {column}"
        for label in ("one map", "two", "three or more")
        for column in ("pixels", "agree")
    )
    return markdown_table(f"{header} | COLMAP's median | ours where alike", rows)


def _questions_table(groups: Measured) -> str:
    rows = []
    for key, question in QUESTIONS.items():
        values = [groups[group][key] for group in ("agree", "disagree")]
        told = percent if key in SHARES else number
        rows.append([question, *[told(value, digits=1) for value in values]])
    return markdown_table("what | agree | differ", rows)


def _costs_table(maps: Measured, mean: Measured) -> str:
    rows = [
        [name, *[_preference(costs[label]) for label in COSTS]]
        for name, costs in {
            **{name: entry["costs"] for name, entry in maps.items() if entry["costs"]},
            "**mean**": mean,
        }.items()
    ]
    return markdown_table("image | " + " | ".join(COSTS.values()), rows)


def _preference(costs: Measured) -> str:
    return f"{percent(costs['ours'])} / {percent(costs['theirs'])}"


def _points_sentence(maps: Measured) -> str:
    found = {
        name: [entry["points"][key] for key in ("points", "ours", "theirs")]
        for name, entry in maps.items()
    }
    total, ours, theirs = (
        sum(row[index] for row in found.values()) for index in (0, 1, 2)
    )
    by_image = "; ".join(
        f"{name} {ours} / {theirs} of {points}"
        for name, (points, ours, theirs) in found.items()
        if points
    )
    return (
        f"Of {total} sparse points at pixels where they differ, our map runs through "
        f"{ours} within 1 %, COLMAP's through {theirs}. By image (ours / COLMAP's): "
        f"{by_image}."
    )
