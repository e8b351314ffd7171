"""Laws of the reference cloud of ground-truth depth maps."""

from pathlib import Path

import numpy as np
import pytest
from planes import NAMES, NORMAL, OFFSET, write_plane_workspace
from scipy.spatial import cKDTree

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.reference_cloud import (
    ReferenceCloud,
    read_reference_cloud,
)
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.progress import SilentProgress
from resdepth_colmap.scene import DepthMap


def reference_of(
    path: Path, depths: dict[str, DepthMap], tolerances: tuple[float, ...] = ()
) -> ReferenceCloud | None:
    for name, depth in depths.items():
        write_depth_map(path / "ground_truth" / f"{name}.bin", depth)
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return read_reference_cloud(workspace, scene, tolerances)


@pytest.fixture
def reference(tmp_path: Path) -> ReferenceCloud:
    plane = write_plane_workspace(tmp_path, kinds=())
    found = reference_of(tmp_path, {view.view.name: view.depth for view in plane})
    assert found is not None
    return found


def test_its_points_lie_on_the_surface_one_per_voxel(reference: ReferenceCloud) -> None:
    assert np.abs(reference.points @ NORMAL - OFFSET).max() < 1e-5
    cells = np.floor(reference.points.astype(np.float64) / reference.voxel_size)
    assert len(np.unique(cells, axis=0)) == len(reference.points)
    assert reference.tolerances == (
        0.01 * reference.mean_depth,
        0.02 * reference.mean_depth,
    )


def test_the_reference_scores_100_and_nothing_scores_0(
    reference: ReferenceCloud,
) -> None:
    scores = reference.score(reference.points, SilentProgress())
    assert scores.accuracy == pytest.approx((1, 1))
    assert scores.completeness == pytest.approx((1, 1))
    assert scores.f1 == pytest.approx((1, 1))
    nothing = reference.score(np.full((5, 3), np.nan, np.float32), SilentProgress())
    assert nothing.accuracy == nothing.completeness == nothing.f1 == (0.0, 0.0)


def test_scores_are_those_of_nearest_points(reference: ReferenceCloud) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0, reference.tolerances[0], reference.points.shape)
    cloud = (reference.points + noise).astype(np.float32)[::7]
    scores = reference.score(cloud, SilentProgress())
    nearest, _ = cKDTree(cloud).query(reference.points)
    expected = [float((nearest <= it).mean()) for it in reference.tolerances]
    assert scores.completeness == pytest.approx(expected, abs=1e-3)
    nearest, _ = cKDTree(reference.points).query(cloud)
    assert scores.num_points > 0.9 * len(
        cloud
    )  # the others project into no ground-truth map
    expected = [float((nearest <= it).mean()) for it in reference.tolerances]
    assert scores.accuracy == pytest.approx(expected, abs=0.03)  # a mean over voxels


def test_points_outside_of_the_ground_truth_are_not_scored(
    reference: ReferenceCloud,
) -> None:
    behind = np.array([[0, 0, -5], [300, 0, 4]], np.float32)
    cloud = np.concatenate([reference.points, behind])
    scores = reference.score(cloud, SilentProgress())
    assert scores.accuracy == pytest.approx((1, 1))
    assert scores.num_points == len(reference.points)
    before = np.array([[0, 0, 2]], np.float32)  # between the cameras and the plane
    scores = reference.score(
        np.concatenate([reference.points, before]), SilentProgress()
    )
    assert scores.accuracy[1] < 1


def test_no_ground_truth_is_none_and_broken_maps_are_refused(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    assert reference_of(tmp_path, {}) is None
    empty = np.zeros((60, 80), np.float32)
    with pytest.raises(WorkspaceError, match="no pixel of any map has a depth"):
        reference_of(tmp_path, {NAMES[0]: empty})
    with pytest.raises(WorkspaceError, match="belongs to another"):
        reference_of(tmp_path, {NAMES[0]: np.ones((60, 61), np.float32)})
