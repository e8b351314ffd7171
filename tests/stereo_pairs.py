"""A tiny scene of the Middlebury kind: two views of the exact plane, with truth."""

import dataclasses
from pathlib import Path

import numpy as np
from PIL import Image
from planes import PlaneView, plane_views, write_model

from resdepth_colmap.evaluation.stereo_pair import (
    REFERENCE_NAME,
    SEEN_NAME,
    SOURCE_NAME,
    TRUTH_NAME,
)
from resdepth_colmap.io.depth_map import write_depth_map
from resdepth_colmap.scene import DepthMap

NUM_UNSEEN_COLUMNS = 16


def write_stereo_pair(path: Path, *, num_points: int = 200) -> DepthMap:
    """Write the scene, its left columns marked as unseen; returns the true depth."""
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
    seen = np.full(truth.shape, 255, np.uint8)
    seen[:, :NUM_UNSEEN_COLUMNS] = 128
    Image.fromarray(seen).save(path / SEEN_NAME)
    return truth


def _renamed(view: PlaneView, name: str) -> PlaneView:
    return dataclasses.replace(view, view=dataclasses.replace(view.view, name=name))
