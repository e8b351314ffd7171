"""Laws of the truth made of depth maps."""

from pathlib import Path

import numpy as np
import pytest
from planes import NAMES, NORMAL, OFFSET, write_plane_workspace
from scipy.spatial import cKDTree

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.reference_cloud import (
    DepthTruth,
    read_depth_truth,
)
from resdepth_colmap.io.colmap.depth_map import write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.progress import SilentProgress
from resdepth_colmap.scene import DepthMap


def truth_of(
    path: Path, depths: dict[str, DepthMap], tolerances: tuple[float, ...] = ()
) -> DepthTruth | None:
    for name, depth in depths.items():
        write_depth_map(path / "ground_truth" / f"{name}.bin", depth)
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return read_depth_truth(workspace, scene, tolerances)


@pytest.fixture
def truth(tmp_path: Path) -> DepthTruth:
    plane = write_plane_workspace(tmp_path, kinds=())
    found = truth_of(tmp_path, {view.view.name: view.depth for view in plane})
    assert found is not None
    return found


def test_its_points_lie_on_the_surface_one_a_voxel(truth: DepthTruth) -> None:
    assert np.abs(truth.points @ NORMAL - OFFSET).max() < 1e-5
    cells = np.floor(truth.points.astype(np.float64) / truth.voxel_size)
    assert len(np.unique(cells, axis=0)) == len(truth.points)
    assert truth.tolerances == (0.01 * truth.mean_depth, 0.02 * truth.mean_depth)


def test_the_truth_scores_100_and_nothing_scores_0(truth: DepthTruth) -> None:
    scores = truth.score(truth.points, SilentProgress())
    assert scores.accuracy == pytest.approx((1, 1))
    assert scores.completeness == pytest.approx((1, 1))
    assert scores.f1 == pytest.approx((1, 1))
    nothing = truth.score(np.full((5, 3), np.nan, np.float32), SilentProgress())
    assert nothing.accuracy == nothing.completeness == nothing.f1 == (0.0, 0.0)


def test_scores_are_those_of_nearest_points(truth: DepthTruth) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, truth.tolerances[0], truth.points.shape)
    cloud = (truth.points + noise).astype(np.float32)[::7]
    scores = truth.score(cloud, SilentProgress())
    nearest, _ = cKDTree(cloud).query(truth.points)
    expected = [float((nearest <= it).mean()) for it in truth.tolerances]
    assert scores.completeness == pytest.approx(expected, abs=1e-3)
    nearest, _ = cKDTree(truth.points).query(cloud)
    assert scores.num_points > 0.9 * len(cloud)  # the others no true map looks at
    expected = [float((nearest <= it).mean()) for it in truth.tolerances]
    assert scores.accuracy == pytest.approx(expected, abs=0.03)  # a mean over voxels


def test_what_no_true_map_looks_at_is_not_scored(truth: DepthTruth) -> None:
    behind = np.array([[0, 0, -5], [300, 0, 4]], np.float32)
    cloud = np.concatenate([truth.points, behind])
    scores = truth.score(cloud, SilentProgress())
    assert scores.accuracy == pytest.approx((1, 1))
    assert scores.num_points == len(truth.points)
    before = np.array([[0, 0, 2]], np.float32)  # between the cameras and the plane
    scores = truth.score(np.concatenate([truth.points, before]), SilentProgress())
    assert scores.accuracy[1] < 1


def test_no_truth_is_none_and_broken_truth_is_refused(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    assert truth_of(tmp_path, {}) is None
    empty = np.zeros((60, 80), np.float32)
    with pytest.raises(WorkspaceError, match="no pixel of any map has a depth"):
        truth_of(tmp_path, {NAMES[0]: empty})
    with pytest.raises(WorkspaceError, match="belongs to another"):
        truth_of(tmp_path, {NAMES[0]: np.ones((60, 61), np.float32)})
