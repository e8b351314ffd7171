"""Tables of the refined depth against ground truth."""

from collections.abc import Iterator
from statistics import fmean
from typing import Any

from resdepth_colmap.evaluation.depth.tables import DEPTHS
from resdepth_colmap.evaluation.markdown import Column, Measured, columns, formatted

ERRORS = ("mae", "rmse", "medae", "bad_2")
MAES = {f"{key}/mae": f"MAE, m: {label}" for key, label in DEPTHS.items()}
BAD = {f"{key}/bad_2": f"off by > 2 %: {key}" for key in ("unfiltered", "refined")}
RATIOS = {
    "mae_ratio": "MAE ratio",
    "worst_mae_ratio": "worst scene",
    "medae_ratio": "MedAE ratio",
    "worst_medae_ratio": "worst scene",
}
SCENES = [
    *columns("", {"scene": "scene"}),
    *columns(".3f", MAES),
    *columns(".1%", BAD),
]
ACCURACY = [
    *columns("", {"options": "`evaluate depth ...`"}),
    *SCENES[1:],
    *columns(".2f", RATIOS),
    Column("scenes with fewer off", lambda it: f"{it['num_fewer']} of {it['num']}"),
]


def scene_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """The errors of each scene, and their means."""
    for name, scene in measured["scenes"].items():
        yield {"scene": name, **scene}
    yield {"scene": "**mean**", **_means(measured)}


def ratio_note(measured: Measured) -> str:
    """The mean ratios, those of the worst scene, and how many scenes are better."""
    (row,) = accuracy_rows(measured)
    ratios = [
        f"{label} {formatted(row[f'{key}_ratio'], '.2f')} "
        f"({formatted(row[f'worst_{key}_ratio'], '.2f')})"
        for key, label in (("mae", "MAE"), ("medae", "MedAE"))
    ]
    return (
        f"Ratio refined / unfiltered, mean (worst scene): {', '.join(ratios)}; fewer "
        f"pixels off by > 2 % in {row['num_fewer']} of {row['num']} scenes."
    )


def accuracy_rows(*records: Measured) -> Iterator[dict[str, Any]]:
    """Means over the scenes of each record, and its largest ratios."""
    for record in records:
        scenes = record["scenes"].values()
        yield {
            "options": f"`{record['command'].partition(' depth ')[2]}`",
            "num": len(scenes),
            "num_fewer": sum(
                it["refined"]["bad_2"] < it["unfiltered"]["bad_2"] for it in scenes
            ),
            **_means(record),
            **record["mean"],
            "worst_mae_ratio": _largest_ratio(record, "mae"),
            "worst_medae_ratio": _largest_ratio(record, "medae"),
        }


def _means(measured: Measured) -> dict[str, dict[str, float | None]]:
    """Of each error the mean over the scenes; None if it is missing in one."""
    scenes = measured["scenes"].values()
    values = {
        key: {error: [scene[key][error] for scene in scenes] for error in ERRORS}
        for key in DEPTHS
    }
    return {
        key: {e: None if None in v else fmean(v) for e, v in errors.items()}
        for key, errors in values.items()
    }


def _largest_ratio(measured: Measured, key: str) -> float | None:
    ratios = [
        scene["refined"][key] / scene["unfiltered"][key]
        for scene in measured["scenes"].values()
        if scene["refined"][key] is not None and scene["unfiltered"][key]
    ]
    return max(ratios, default=None)
