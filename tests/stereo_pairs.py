"""A tiny scene of the Middlebury kind: two views of an exact plane, with truth."""

import dataclasses
from pathlib import Path

import numpy as np
from analytic_scene import depth_of_plane, image_of, view_at
from PIL import Image
from planes import PlaneView, plane_views, write_model

from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.exported_map import write_pfm
from resdepth_colmap.scene import Camera, DepthMap, FloatMap

REFERENCE_NAME, SOURCE_NAME = "im0.png", "im1.png"
TRUTH_NAME = f"ground_truth/{REFERENCE_NAME}.bin"
SEEN_NAME = f"ground_truth/{REFERENCE_NAME}.nonoccluded.png"
NUM_UNSEEN_COLUMNS = 16

BASELINE_MM = 400.0
DOFFS_PX = 3.0
FOCAL_PX = 90.0
NUM_DISPARITIES = 40


def write_stereo_pair(path: Path, *, num_points: int = 200) -> DepthMap:
    """Write a workspace, its left columns marked as unseen; returns the true depth."""
    views = [
        _renamed(view, name)
        for view, name in zip(
            plane_views()[:2], (REFERENCE_NAME, SOURCE_NAME), strict=True
        )
    ]
    for folder in ("images", "stereo", "ground_truth"):
        (path / folder).mkdir(parents=True)
    for view in views:
        Image.fromarray(view.image).save(path / "images" / view.view.name)
    write_model(path / "sparse", views, num_points=num_points)
    truth = views[0].depth
    write_depth_map(path / TRUTH_NAME, truth)
    _save_seen(path / SEEN_NAME, truth)
    return truth


def write_as_distributed(path: Path) -> DepthMap:
    """Write a scene as Middlebury distributes it; returns the true depth in metres."""
    path.mkdir(parents=True)
    cx, cy = 38.0, 29.5  # index coordinates
    size = {"width_px": 80, "height_px": 60}
    camera = Camera(**size, fx=FOCAL_PX, fy=FOCAL_PX, cx=cx + 0.5, cy=cy + 0.5)
    shifted = dataclasses.replace(camera, cx=camera.cx + DOFFS_PX)
    left = view_at((0, 0, 0), camera)
    right = view_at((BASELINE_MM / 1000, 0, 0), shifted)
    depths = [
        depth_of_plane(view, np.array([0.3, -0.2, -1.0]), -4.0)
        for view in (left, right)
    ]
    for view, depth, name in zip(
        (left, right), depths, (REFERENCE_NAME, SOURCE_NAME), strict=True
    ):
        gray = np.rint(255 * image_of(view, depth)).astype(np.uint8)
        Image.fromarray(gray).save(path / name)
    disparity = FOCAL_PX * BASELINE_MM / 1000 / depths[0] - DOFFS_PX
    disparity[0] = np.inf
    write_pfm(path / "disp0.pfm", disparity.astype(np.float32))
    _save_seen(path / "mask0nocc.png", depths[0])
    (path / "calib.txt").write_text(
        f"cam0=[{FOCAL_PX} 0 {cx}; 0 {FOCAL_PX} {cy}; 0 0 1]\n"
        f"cam1=[{FOCAL_PX} 0 {cx + DOFFS_PX}; 0 {FOCAL_PX} {cy}; 0 0 1]\n"
        f"doffs={DOFFS_PX}\nbaseline={BASELINE_MM}\nwidth=80\nheight=60\n"
        f"ndisp={NUM_DISPARITIES}\nisint=0\n"
    )
    truth: DepthMap = depths[0].astype(np.float32)
    truth[0] = 0
    return truth


def _save_seen(path: Path, depth: FloatMap) -> None:
    seen = np.full(depth.shape, 255, np.uint8)
    seen[:, :NUM_UNSEEN_COLUMNS] = 128
    Image.fromarray(seen).save(path)


def _renamed(view: PlaneView, name: str) -> PlaneView:
    return dataclasses.replace(view, view=dataclasses.replace(view.view, name=name))
