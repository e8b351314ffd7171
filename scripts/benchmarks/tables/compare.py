"""Tables of `compare`: clouds against the reference cloud, reference-free metrics."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.markdown import Measured, at, columns, grouped

FUSERS = {"open3d": "ours", "colmap": "COLMAP"}
SCORES = {
    "scores/accuracy": "accuracy",
    "scores/completeness": "completeness",
    "scores/f1": "F1",
}
CLOUDS = [
    *columns("", {"workspace": "workspace", "method": "maps"}),
    *columns(".4g", {"open3d/scores/tolerances": "within"}),
    *grouped(
        FUSERS,
        [
            *columns(",", {"num_points": "points"}),
            *columns(".1%", SCORES),
        ],
    ),
]
METRICS = {
    "coverage": "coverage",
    "consistent": "consistent",
    "agreement_common": "agreement, common",
    "points_even_common": "even points, common",
    "points_odd_common": "odd points, common",
    "photo_common": "photo, common",
    "right_1": "right",
    "right_1_common": "right, common",
}
"""The metrics of `MEASURES` that are shown, and their columns."""

PAIRED = columns(
    "",
    {
        "workspace": "workspace",
        "pair": "difference",
        **{f"metrics/{key}": title for key, title in METRICS.items()},
    },
)


def cloud_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """Each method of a workspace with a reference cloud, at the smallest tolerance."""
    for workspace, result in measured["results"].items():
        for method in result["methods"]:
            clouds = {f: at(result, f"clouds/{f}/{method}") or {} for f in FUSERS}
            if clouds["open3d"].get("scores"):
                yield {
                    "workspace": workspace,
                    "method": method,
                    **{fuser: _at_first(cloud) for fuser, cloud in clouds.items()},
                }


def paired_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """Differences between methods, the mean over the views with its 95 % interval."""
    for workspace, result in measured["results"].items():
        for pair, metrics in result["paired"].items():
            shown = {key: difference(at(metrics, f"{key}/views")) for key in METRICS}
            yield {"workspace": workspace, "pair": pair, "metrics": shown}


def difference(views: Measured | None) -> str | None:
    """Mean and 95 % interval in points of 100; None where nothing is measured."""
    if views is None or views["mean"] is None:
        return None
    ends = [f"{100 * end:.1f}" for end in views["interval"] or ()]
    return f"{100 * views['mean']:+.1f}" + (f" [{', '.join(ends)}]" if ends else "")


def _at_first(cloud: Measured) -> dict[str, Any]:
    """A cloud with the scores at its smallest tolerance alone."""
    scores = cloud.get("scores") or {}
    first = {key: it[0] for key, it in scores.items() if isinstance(it, list)}
    return {**cloud, "scores": first}
