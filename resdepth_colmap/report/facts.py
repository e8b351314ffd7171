"""The texts and numbers of the page, from the run record and the maps."""

import collections
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from resdepth_colmap.report.image_maps import ImageMaps
from resdepth_colmap.viz.colormaps import (
    difference_limit,
)

MAX_NUM_NAMES = 100
_DIGITS = 6
_OVERALL = ("mae", "rmse", "medae", "bad_1", "bad_2")

Record = Mapping[str, Any]
"""A run record, or a part of it."""


def image_facts(maps: ImageMaps, record: Record) -> dict[str, Any]:
    """The facts of one image, computed from the full maps."""
    scale, change = maps.scale, maps.difference
    size = np.abs(change[np.isfinite(change)])
    errors = maps.errors
    height_px, width_px = maps.before.shape
    return {
        "name": maps.name,
        "width": width_px,
        "height": height_px,
        "scale": {"least": scale.least, "most": scale.most, "ticks": scale.ticks()},
        "limit": difference_limit(change),
        "filled": [float((it > 0).mean()) for it in (maps.before, maps.after)],
        "change": float(np.median(size)) if size.size else None,
        "input": str(record.get("input", "")),
        "sources": _sources(record),
        "seconds": _number(record.get("seconds")),
        "metrics": errors and [errors.before.to_mapping(), errors.after.to_mapping()],
    }


def summary_facts(
    record: Record, images: Sequence[Record], num_pixels: int
) -> dict[str, Any]:
    """The facts of the workspace; pairs are before and after, None = unknown.

    Args:
        record: The run record.
        images: The facts of each image.
        num_pixels: Number of pixels of all refined maps.
    """
    records = [r for r in _mapping(record, "images").values() if isinstance(r, Mapping)]
    fuse, fuse_before = _mapping(record, "fuse"), _mapping(record, "fuse_before")
    return {
        "num_images": len(records),
        "coverage": [_mean(records, f"filled_{when}") for when in ("before", "after")],
        "agreement": [_agreeing(f, f.get("num_pixels")) for f in (fuse_before, fuse)],
        "consistent": [_agreeing(f, num_pixels) for f in (fuse_before, fuse)],
        "num_views_needed": _number(fuse.get("num_views_needed")),
        "points": [
            _number(fuse.get("points_before_refinement")),
            _number(fuse.get("points")),
        ],
        "fuse_error": fuse.get("error"),
        "seconds": {
            str(stage): value
            for stage, value in _mapping(record, "seconds").items()
            if _number(value) is not None
        },
        "peak_memory_mb": _number(record.get("peak_memory_mb")),
        "metrics": _mean_metrics(images),
        "finished": str(record.get("finished", "")),
        "device": str(record.get("device", "")),
        "weights": str(record.get("weights_sha256", "")),
        "stereo": str(_mapping(record, "stereo").get("backend", "")),
        "workspace": str(record.get("workspace", "")),
        "options": _mapping(record, "options"),
        "versions": _mapping(record, "versions"),
    }


def left_out_facts(left_out: Mapping[str, str]) -> list[dict[str, Any]]:
    """Reasons, each with the number of images left out and the names of the first."""
    names = collections.defaultdict(list)
    for name, reason in left_out.items():
        names[reason].append(name)
    return [
        {"reason": reason, "count": len(found), "names": found[:MAX_NUM_NAMES]}
        for reason, found in list(names.items())[:MAX_NUM_NAMES]
    ]


def rounded(value: Any) -> Any:
    """A value with numbers of six digits, ready for JSON; NaN becomes None."""
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    return value


def _mean_metrics(images: Sequence[Record]) -> list[dict[str, float | None]] | None:
    known = [image["metrics"] for image in images if image["metrics"]]
    if not known:
        return None
    return [
        {key: _mean([pair[when] for pair in known], key) for key in _OVERALL}
        for when in (0, 1)
    ]


def _sources(record: Record) -> list[dict[str, Any]]:
    sources = record.get("sources")
    found = [s for s in sources if isinstance(s, Mapping)] if sources else []
    keys = ("name", "reason", "num_shared_points", "angle_deg", "baseline")
    return [{key: source.get(key) for key in keys} for source in found]


def _agreeing(fuse: Record, num_pixels: Any) -> float | None:
    """Share of pixels that are consistent in the views; None = not counted."""
    counts = [_number(fuse.get(key)) for key in ("num_points", "num_explained")]
    total = _number(num_pixels)
    # COLMAP's fusion counts no explained pixels: 0 of them means unknown.
    if not total or not counts[1] or counts[0] is None:
        return None
    return (counts[0] + counts[1]) / total


def _mapping(record: Record, key: str) -> Record:
    value = record.get(key)
    return value if isinstance(value, Mapping) else {}


def _mean(records: Sequence[Record], key: str) -> float | None:
    values = [_number(record.get(key)) for record in records]
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _number(value: Any) -> float | int | None:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return value if is_number and math.isfinite(value) else None
