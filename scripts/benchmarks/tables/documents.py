"""Markdown tables of what was measured, and the places in documents that hold them.

A place is what lies between `<!-- name -->` and `<!-- /name -->`.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

from resdepth_colmap.evaluation.depth.tables import DEPTHS, Measured
from resdepth_colmap.evaluation.markdown import HARDWARE as HARDWARE
from resdepth_colmap.evaluation.markdown import (
    NOT_KNOWN,
    count,
    markdown_table,
    number,
    percent,
)
from scripts.benchmarks.tables.cloud import cloud_table
from scripts.benchmarks.tables.commands import command_table
from scripts.benchmarks.tables.compare import comparison_table
from scripts.benchmarks.tables.matching import matching_table
from scripts.benchmarks.tables.model_card import training_table, weights_table
from scripts.benchmarks.tables.stereo_memory import stereo_memory_table
from scripts.benchmarks.tables.variants import beyond_table, variants_table

METHODS = ("unfiltered", "refined")


def middlebury_table(measured: Measured) -> str:
    """Every error of every scene, how good the matcher is, and the mean ratios."""
    scenes = measured["scenes"]
    errors = [
        [name, label, *_error_cells(scene[key]), f"{scene[key]['num_valid']:,}"]
        for name, scene in scenes.items()
        for key, label in DEPTHS.items()
    ]
    means = [
        ["**mean**", label, *_error_cells(_mean_errors(measured, key)), ""]
        for key, label in DEPTHS.items()
    ]
    matching = [_matching_row(name, scene) for name, scene in scenes.items()]
    return "\n\n".join(
        [
            _measured_by(measured),
            _ratio_sentence(measured),
            markdown_table(
                "scene | depth | MAE, m | RMSE, m | MedAE, mm | off by > 2 % | "
                "valid pixels",
                errors + means,
                num_texts=2,
            ),
            "The matcher alone, where both views see the surface; "
            "and processor seconds a megapixel:",
            markdown_table(
                "scene | median relative error | off by > 1 % | off by > 2 % | "
                "MAE, m | matching, s | refining, s",
                matching,
            ),
        ]
    )


def middlebury_summary(measured: Measured) -> str:
    """One row a scene: mean absolute error, and what is off by more than 2 %."""
    rows = [
        _summary_row(name, {key: scene[key] for key in DEPTHS})
        for name, scene in measured["scenes"].items()
    ]
    means = {key: _mean_errors(measured, key) for key in DEPTHS}
    header = "scene | " + " | ".join(
        [f"MAE, m: {label}" for label in DEPTHS.values()]
        + [f"off by > 2 %: {DEPTHS[key]}" for key in ("unfiltered", "refined")]
    )
    return "\n\n".join(
        [
            markdown_table(header, [*rows, _summary_row("**mean**", means)]),
            _ratio_sentence(measured),
            _measured_by(measured),
        ]
    )


def agreement_table(measured: Measured) -> str:
    """One row an image: how much of a filtered map there is before and after."""
    limits = {"within_1": "1 %", "within_2": "2 %", "within_5": "5 %"}
    rows = [
        [name, percent(image["known"])]
        + [percent(image[method][key]) for key in limits for method in METHODS]
        for name, image in measured["images"].items()
    ]
    header = "image | filled in COLMAP's filtered map | " + " | ".join(
        f"within {limit}: {method}" for limit in limits.values() for method in METHODS
    )
    return "\n\n".join([markdown_table(header, rows), _measured_by(measured)])


def workspaces_table(measured: Measured) -> str:
    """Seconds a stage, memory, and what there was before and after."""
    stages = list(
        dict.fromkeys(s for sample in measured.values() for s in sample["seconds"])
    )
    header = (
        " | ".join(["workspace", "options", "images", *map(_spoken, stages)])
        + " | in all, s | peak memory | points before | points after"
        + " | filled before | filled after | date"
    )
    rows = [_workspace_row(name, sample, stages) for name, sample in measured.items()]
    command = "python -m scripts.benchmarks.workspaces"
    return "\n\n".join(
        [
            f"Measured by `{command}` on {HARDWARE}; stages in seconds.",
            markdown_table(header, rows, num_texts=2),
        ]
    )


def refine_table(measured: Measured) -> str:
    """Seconds a megapixel and pass, by size."""
    rows = [
        [
            f"{size['width_px']} x {size['height_px']}",
            f"{size['megapixels']:.2f}",
            f"{size['s_per_mp_and_pass']:.2f}",
            " ".join(f"{seconds:.1f}" for seconds in size["seconds"]),
        ]
        for size in measured["sizes"]
    ]
    header = "size, px | megapixels | s a megapixel and pass | s of each repetition"
    return "\n\n".join([_measured_by(measured), markdown_table(header, rows)])


Renderer = Callable[[Measured], str]

DOCUMENTS: dict[str, dict[str, Renderer]] = {
    "README.md": {"middlebury": middlebury_summary},
    "docs/benchmarks.md": {
        "middlebury": middlebury_table,
        "middlebury_completed": middlebury_summary,
        "held_out": middlebury_summary,
        "held_out_rough": middlebury_summary,
        "agreement": agreement_table,
        "workspaces": workspaces_table,
        "refine": refine_table,
        "variants": variants_table,
        "beyond": beyond_table,
        "middlebury_rough": middlebury_summary,
        "commands": command_table,
        "cloud": cloud_table,
        "matching": matching_table,
        "compare": comparison_table,
        "stereo_memory": stereo_memory_table,
    },
    "docs/model_card.md": {
        "weights": weights_table,
        "training": training_table,
        "middlebury": middlebury_summary,
        "middlebury_rough": middlebury_summary,
    },
}
"""The documents, and who renders the place of each name from the file of that name."""


def rendered(document: str, measurements: Path) -> dict[str, str]:
    """What the places of a document have to hold, as far as it was measured.

    Args:
        document: A key of `DOCUMENTS`.
        measurements: Folder of the JSON files.

    Returns:
        Markdown by the name of the place; none where the JSON file is not there.
    """
    texts = {}
    for name, render in DOCUMENTS[document].items():
        path = measurements / f"{name}.json"
        if path.is_file():
            texts[name] = render(json.loads(path.read_text("utf-8")))
    return texts


def filled_in(text: str, places: Mapping[str, str]) -> str:
    """A document with new text in its places; a place that it lacks is passed over.

    Raises:
        ValueError: If a place is opened but not closed, or there twice.
    """
    for name, content in places.items():
        start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if start not in text and end not in text:
            continue
        before, _, rest = text.partition(start)
        _, found, after = rest.partition(end)
        if text.count(start) != 1 or text.count(end) != 1 or not found:
            raise ValueError(f"expected one {start} and one {end} after it.")
        text = f"{before}{start}\n\n{content}\n\n{end}{after}"
    return text


def _error_cells(errors: Measured) -> list[str]:
    return [
        number(errors["mae"]),
        number(errors["rmse"]),
        number(errors["medae"], scale=1000, digits=1),
        percent(errors["bad_2"]),
    ]


def _matching_row(name: str, scene: Measured) -> list[str]:
    seen = scene["unfiltered_seen_by_both"]
    return [
        name,
        percent(seen["median_relative_error"], digits=2),
        percent(seen["bad_1"]),
        percent(seen["bad_2"]),
        number(seen["mae"]),
        number(scene["matching_cpu_s_per_mp"], digits=1),
        number(scene["refining_cpu_s_per_mp"], digits=1),
    ]


def _summary_row(name: str, errors: Mapping[str, Measured]) -> list[str]:
    maes = [number(errors[key]["mae"]) for key in DEPTHS]
    bad = [percent(errors[key]["bad_2"]) for key in ("unfiltered", "refined")]
    return [name, *maes, *bad]


def _workspace_row(name: str, sample: Measured, stages: list[str]) -> list[str]:
    memory_mb = sample["peak_memory_mb"]
    return [
        name,
        f"`{' '.join(sample['options'])}`" if sample["options"] else "",
        str(sample["num_images"]),
        *[number(sample["seconds"].get(stage), digits=1) for stage in stages],
        number(sample["seconds_in_all"], digits=1),
        NOT_KNOWN if memory_mb is None else f"{memory_mb / 1024:.1f} GiB",
        *[count(sample[key]) for key in ("points_before", "points_after")],
        *[percent(sample[key], 0) for key in ("filled_before", "filled_after")],
        sample.get("date", NOT_KNOWN),
    ]


def _mean_errors(measured: Measured, key: str) -> dict[str, float | None]:
    """Of each error the mean over the scenes; None if it is missing in one."""
    means: dict[str, float | None] = {}
    for error in ("mae", "rmse", "medae", "bad_2"):
        values = [scene[key][error] for scene in measured["scenes"].values()]
        is_whole = None not in values and values
        means[error] = sum(values) / len(values) if is_whole else None
    return means


def _ratio_sentence(measured: Measured) -> str:
    mean, options = measured["mean"], measured["options"]["refine"]
    scenes = measured["scenes"].values()
    num_fewer = sum(
        scene["refined"]["bad_2"] < scene["unfiltered"]["bad_2"] for scene in scenes
    )
    ratios = [
        f"{label} {number(mean[f'{key}_ratio'], digits=2)} (the worst scene "
        f"{number(_largest_ratio(measured, key), digits=2)})"
        for key, label in (("mae", "MAE"), ("medae", "MedAE"))
    ]
    return (
        f"Refined over unfiltered, mean of {len(scenes)} scenes, "
        f"{_times(options)}: {', '.join(ratios)}; fewer "
        f"pixels off by more than 2 % in {num_fewer} of {len(scenes)}."
    )


def _times(options: Measured) -> str:
    passes, rounds = options["inner_iterations"], options.get("outer_iterations", 1)
    said = f"{passes} {'pass' if passes == 1 else 'passes'}"
    return said if rounds == 1 else f"{rounds} rounds of {said}"


def _largest_ratio(measured: Measured, key: str) -> float | None:
    ratios = [
        scene["refined"][key] / scene["unfiltered"][key]
        for scene in measured["scenes"].values()
        if scene["refined"][key] is not None and scene["unfiltered"][key]
    ]
    return max(ratios, default=None)


def _measured_by(measured: Measured) -> str:
    return (
        f"Measured by `{measured['command']}` on {measured['date']}, {HARDWARE}; "
        f"weights `{measured['weights_sha256'][:12]}`."
    )


def _spoken(stage: str) -> str:
    return stage.replace("_", " ")
