"""Errors of several networks on the same views, and their means."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.metrics.depth_metrics import (
    depth_metrics,
    median_filtered,
)
from resdepth_colmap.scene import DepthMap

MEASURES = ("mae", "rmse", "medae", "bad_2")
RATIOS = ("mae", "medae")
INITIAL, MEDIAN = "unfiltered", "median"

MethodErrors = dict[str, dict[str, float]]
"""By method, then by measure."""


def method_errors(
    initial: DepthMap, refined: Mapping[str, DepthMap], truth: DepthMap
) -> MethodErrors:
    """Errors of one view: of the initial map, of its 5 x 5 median, of each network's.

    Args:
        initial: Shape (H, W), in units; 0 = no depth.
        refined: By method, same shape.
        truth: Same shape; 0 = not known.
    """
    maps = {INITIAL: initial, MEDIAN: median_filtered(initial), **refined}
    errors = {}
    for name, depth in maps.items():
        metrics = depth_metrics(depth, truth).to_mapping()
        errors[name] = {key: round(metrics[key] or 0.0, 6) for key in MEASURES}
    return errors


def method_summaries(views: Mapping[str, MethodErrors]) -> dict[str, dict[str, Any]]:
    """Means over the views: of each error, and of its ratio to that of the initial map.

    Args:
        views: The result of `method_errors` of each view, by name. A view whose initial
            map has no error of a kind does not count in that ratio.

    Returns:
        By method: the means, the ratios `<measure>_ratio`, and each view's MAE.
    """
    methods = next(iter(views.values()), {})
    return {method: _summary(method, views) for method in methods}


def _summary(method: str, views: Mapping[str, MethodErrors]) -> dict[str, Any]:
    means = {
        key: _mean([errors[method][key] for errors in views.values()])
        for key in MEASURES
    }
    ratios = {
        f"{key}_ratio": _mean(
            [
                errors[method][key] / errors[INITIAL][key]
                for errors in views.values()
                if errors[INITIAL][key]
            ]
        )
        for key in RATIOS
    }
    maes = {name: errors[method]["mae"] for name, errors in views.items()}
    return {**means, **ratios, "views": maes}


def _mean(values: list[float]) -> float | None:
    return round(sum(values) / len(values), 6) if values else None
