"""Laws of reading workspaces whose true depth is known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from stereo_pairs import (
    NUM_UNSEEN_COLUMNS,
    SEEN_NAME,
    TRUTH_NAME,
    write_stereo_pair,
)
from warped_samples import difference_when_warped
from workspaces import plane_folder

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.sample import DepthSample, SampleOptions
from resdepth_colmap.evaluation.datasets.workspaces import read_workspace_samples
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS

OPTIONS = SampleOptions(stereo=StereoConfig(max_num_sources=3), num_sources=1)


def read_sample(path: Path) -> DepthSample:
    (load,) = read_workspace_samples(path, OPTIONS)
    return load()


def test_what_is_written_is_read(tmp_path: Path) -> None:
    truth = write_stereo_pair(tmp_path / "Plane")
    sample = read_sample(tmp_path / "Plane")
    assert np.array_equal(sample.truth, truth)
    assert sample.seen is not None
    assert not sample.seen[:, :NUM_UNSEEN_COLUMNS].any()
    assert sample.seen[:, NUM_UNSEEN_COLUMNS:].all()
    near, far = sample.depth_range
    assert near < np.percentile(truth, 5) and np.percentile(truth, 95) < far
    assert sample.initial is None
    assert sample.megapixels == pytest.approx(0.0048)


def test_the_true_depth_carries_one_view_into_the_other(tmp_path: Path) -> None:
    write_stereo_pair(tmp_path / "Plane")
    assert difference_when_warped(read_sample(tmp_path / "Plane")) < 0.01


def test_without_sparse_points_there_is_a_range_all_the_same(tmp_path: Path) -> None:
    truth = write_stereo_pair(tmp_path / "Plane", num_points=0)
    near, far = read_sample(tmp_path / "Plane").depth_range
    assert near < truth.min() and truth.max() < far


def truth_of(folder: Path, name: str, shape: tuple[int, int] = (60, 80)) -> None:
    write_depth_map(folder / f"ground_truth/{name}.bin", np.ones(shape, np.float32))


def test_a_view_is_matched_against_all_and_compared_with_the_best(
    tmp_path: Path,
) -> None:
    without = plane_folder(tmp_path / "without", kinds=())
    with_maps = plane_folder(tmp_path / "with", kinds=("geometric",))
    for folder in (without, with_maps):
        truth_of(folder, NAMES[2])
    assert len(read_sample(without).sources) == 3
    sample = read_sample(with_maps)
    assert len(sample.sources) == NUM_SOURCE_MAPS
    assert sample.initial is not None
    assert [it is not None for it in sample.initial.source_depths] == [True] * 4


def test_the_sources_that_patch_match_cfg_names_are_taken(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    truth_of(folder, NAMES[0])
    cfg = folder / "stereo/patch-match.cfg"
    cfg.write_text(f"{NAMES[0]}\n{NAMES[4]}\n", encoding="utf-8")
    (source,) = read_sample(folder).sources
    everything = plane_folder(tmp_path / "all", kinds=())
    truth_of(everything, NAMES[4])
    assert np.array_equal(source.gray, read_sample(everything).reference.gray)


def without_truth(folder: Path) -> None:
    (folder / TRUTH_NAME).unlink()


def without_folder(folder: Path) -> None:
    without_truth(folder)
    (folder / SEEN_NAME).unlink()
    (folder / "ground_truth").rmdir()


def with_small_truth(folder: Path) -> None:
    write_depth_map(folder / TRUTH_NAME, np.ones((6, 8), np.float32))


def with_small_map(folder: Path) -> None:
    path = folder / "stereo/depth_maps/im0.png.photometric.bin"
    write_depth_map(path, np.ones((30, 40), np.float32))


def with_empty_map(folder: Path) -> None:
    path = folder / "stereo/depth_maps/im0.png.photometric.bin"
    write_depth_map(path, np.zeros((60, 80), np.float32))


def without_image(folder: Path) -> None:
    (folder / "images/im1.png").unlink()


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (without_truth, r"ground_truth: no map .* im0\.png would be im0\.png\.bin"),
        (without_folder, "Plane: no ground_truth/,"),
        (with_small_truth, r"im0\.png\.bin: 8 x 6 pixels, but its image has 80 x 60"),
        (with_small_map, r"photometric\.bin: 40 x 30 pixels, but its image"),
        (with_empty_map, r"photometric\.bin: no pixel has a depth"),
        (without_image, "1 of 2 images"),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, break_it: Callable[[Path], None], words: str
) -> None:
    write_stereo_pair(tmp_path / "Plane")
    break_it(tmp_path / "Plane")
    with pytest.raises(WorkspaceError, match=words):
        read_sample(tmp_path / "Plane")


@pytest.mark.data
def test_teddy_is_read_and_its_truth_is_right(
    shared_data: Callable[[str], Path],
) -> None:
    sample = read_sample(shared_data("middlebury") / "Teddy")
    assert sample.truth.shape == sample.reference.gray.shape
    assert difference_when_warped(sample) < 0.05
