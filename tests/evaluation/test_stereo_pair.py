"""Laws of reading the scenes of the Middlebury benchmark."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from planes import write_plane_workspace
from stereo_pairs import NUM_UNSEEN_COLUMNS, write_stereo_pair

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.stereo_pair import (
    SEEN_NAME,
    TRUTH_NAME,
    StereoPair,
    read_pair,
    scene_folders,
)
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.io.depth_map import write_depth_map
from resdepth_colmap.scene import DepthMap


def difference_when_warped(pair: StereoPair, depth: DepthMap) -> float:
    """Mean difference of the grey values where both views see the surface."""
    known = pair.seen & (pair.truth > 0)
    inverse_depth = 1 / np.where(known, depth, 1)
    warped, inside = warp_to_reference(
        torch.from_numpy(pair.source.gray.astype(np.float64))[None, None],
        torch.from_numpy(inverse_depth.astype(np.float64))[None, None],
        torch.from_numpy(pair.reference.K)[None],
        torch.from_numpy(pair.source.K)[None],
        torch.from_numpy(pair.source_from_reference)[None],
    )
    counted = known & inside[0, 0].numpy()
    difference = np.abs(warped[0, 0].numpy() - pair.reference.gray)[counted]
    return float(difference.mean())


def test_what_is_written_is_read(tmp_path: Path) -> None:
    truth = write_stereo_pair(tmp_path / "Plane")
    pair = read_pair(tmp_path / "Plane")
    assert pair.name == "Plane"
    assert np.array_equal(pair.truth, truth)
    assert not pair.seen[:, :NUM_UNSEEN_COLUMNS].any()
    assert pair.seen[:, NUM_UNSEEN_COLUMNS:].all()
    near, far = pair.depth_range
    assert near < np.percentile(truth, 5) and np.percentile(truth, 95) < far
    assert pair.megapixels == pytest.approx(0.0048)


def test_the_true_depth_carries_one_view_into_the_other(tmp_path: Path) -> None:
    truth = write_stereo_pair(tmp_path / "Plane")
    pair = read_pair(tmp_path / "Plane")
    assert difference_when_warped(pair, truth) < 0.01


def test_without_sparse_points_there_is_a_range_all_the_same(tmp_path: Path) -> None:
    truth = write_stereo_pair(tmp_path / "Plane", num_points=0)
    near, far = read_pair(tmp_path / "Plane").depth_range
    assert near < truth.min() and truth.max() < far


def test_only_folders_with_truth_are_scenes(tmp_path: Path) -> None:
    for name in ("B", "A"):
        write_stereo_pair(tmp_path / name)
    (tmp_path / "C").mkdir()
    assert [path.name for path in scene_folders(tmp_path)] == ["A", "B"]


def test_a_folder_without_scenes_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=rf"nowhere: no folder with {TRUTH_NAME}"):
        scene_folders(tmp_path / "nowhere")


def test_a_scene_without_its_views_is_refused(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path / "scene")
    with pytest.raises(WorkspaceError, match=r"scene: its model has no image im0\.png"):
        read_pair(tmp_path / "scene")


def test_truth_of_another_size_is_refused(tmp_path: Path) -> None:
    write_stereo_pair(tmp_path / "Plane")
    write_depth_map(tmp_path / "Plane" / TRUTH_NAME, np.ones((6, 8), np.float32))
    with pytest.raises(WorkspaceError, match=r"Plane: .* differ in size .*\(6, 8\)"):
        read_pair(tmp_path / "Plane")


def test_a_mask_of_another_size_is_refused(tmp_path: Path) -> None:
    write_stereo_pair(tmp_path / "Plane")
    Image.fromarray(np.zeros((6, 8), np.uint8)).save(tmp_path / "Plane" / SEEN_NAME)
    with pytest.raises(WorkspaceError, match=r"Plane: .* differ in size .*\(6, 8\)"):
        read_pair(tmp_path / "Plane")


@pytest.mark.data
def test_the_real_truth_carries_one_view_into_the_other(
    shared_data: Callable[[str], Path],
) -> None:
    paths = scene_folders(shared_data("middlebury"))
    for path in (paths[0], paths[-1]):  # ArtL and Teddy, the smallest
        pair = read_pair(path)
        right = difference_when_warped(pair, pair.truth)
        for scale in (0.98, 1.02):
            wrong = difference_when_warped(pair, pair.truth * np.float32(scale))
            assert wrong > right, path
