"""Refined workspaces of the exact plane, made without a network, to report on."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from planes import (
    NAMES,
    PlaneView,
    plane_views,
    points_on_plane,
    write_model,
)

from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace, write_record
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import PointCloud, write_cloud
from resdepth_colmap.scene import DepthMap

TOO_FAR = 1.05
"""What the initial depth is multiplied by in its left half."""

NUM_HOLE_ROWS = 12
CONFIDENCE = 0.75
BEFORE_COLOR, AFTER_COLOR = (40, 90, 250), (240, 90, 60)
"""Of the clouds."""


def initial_depth(depth: DepthMap) -> DepthMap:
    """Exact on the right, too far on the left, no depth at the top."""
    initial = depth.copy()
    initial[:, : depth.shape[1] // 2] *= np.float32(TOO_FAR)
    initial[:NUM_HOLE_ROWS] = 0
    return initial


def refined_workspace(
    path: Path,
    names: tuple[str, ...] = NAMES,
    *,
    size_px: tuple[int, int] = (80, 60),
    truth: bool = True,
    noise: float = 0.0,
) -> Path:
    """A workspace whose refined depth is exact and whose initial depth is not.

    Args:
        path: Its folder.
        names: Images; the five views of the plane again and again.
        size_px: Width and height.
        truth: Write `ground_truth/`.
        noise: Relative noise of both depths, which makes maps hard to pack.

    Returns:
        The folder.
    """
    views = _named(plane_views(*size_px), names)
    write_model(path / "sparse", views, num_points=20)
    rng = np.random.default_rng(0)
    for view in views:
        _write_inputs(path, view, truth, rng, noise)
    output = OutputWorkspace(source=open_workspace(path))
    output.prepare(names)
    for view in views:
        confidence = np.full(view.depth.shape, CONFIDENCE, np.float32)
        depth = _noisy(view.depth, rng, noise)
        output.write_maps(view.view.name, depth, view.normals, confidence)
    for name, color in (
        ("fused", (240, 90, 60)),
        ("fused_before_sample", (40, 90, 250)),
    ):
        write_cloud(output.path / f"{name}.ply", _cloud(color))
    write_record(output.record_path, run_record(names))
    return path


def run_record(names: tuple[str, ...]) -> dict[str, Any]:
    """What a run of that workspace would have recorded."""
    share = NUM_HOLE_ROWS / 60
    image = {
        "input": "photometric",
        "sources": [{"name": names[-1], "reason": "20 shared points"}],
        "filled_before": 1 - share,
        "filled_after": 1.0,
        "seconds": 0.5,
    }
    counts = {"num_views_needed": 3, "num_pixels": 1000, "num_points": 200}
    return {
        "finished": "2026-11-22T06:38:42+00:00",
        "workspace": "scene",
        "options": {"refine": {"inner_iterations": 1}, "in_place": False},
        "versions": {"resdepth-colmap": "0.1.0"},
        "weights_sha256": "0" * 64,
        "device": "cpu",
        "seconds": {"stereo": 3.0, "refine": 1.0},
        "peak_memory_mb": 500,
        "skipped": {},
        "fuse": {
            **counts,
            "points": 900,
            "points_before_refinement": 500,
            "num_explained": 700,
        },
        "fuse_before": {**counts, "num_explained": 300},
        "images": dict.fromkeys(names, image),
    }


def _named(views: list[PlaneView], names: tuple[str, ...]) -> list[PlaneView]:
    return [
        dataclasses.replace(
            views[index % len(views)],
            view=dataclasses.replace(
                views[index % len(views)].view, name=name, image_id=index + 1
            ),
        )
        for index, name in enumerate(names)
    ]


def _write_inputs(
    path: Path,
    view: PlaneView,
    truth: bool,
    rng: np.random.Generator,
    noise: float,
) -> None:
    name = view.view.name
    image_path = path / "images" / name
    image_path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(view.image).save(image_path, format="PNG")
    depth = _noisy(initial_depth(view.depth), rng, noise)
    write_depth_map(path / f"stereo/depth_maps/{name}.photometric.bin", depth)
    if truth:
        write_depth_map(path / f"ground_truth/{name}.bin", view.depth)


def _noisy(depth: DepthMap, rng: np.random.Generator, noise: float) -> DepthMap:
    factors = 1 + noise * rng.standard_normal(depth.shape)
    noisy: DepthMap = (depth * factors.clip(0.1, 2)).astype(np.float32)
    return noisy


def _cloud(color: tuple[int, int, int]) -> PointCloud:
    points = points_on_plane(2000).astype(np.float32)
    return PointCloud(
        points=points,
        colors=np.full(points.shape, color, np.uint8),
        normals=np.zeros_like(points),
    )
