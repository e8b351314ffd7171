"""Laws of reading Middlebury's scenes as they are distributed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from stereo_pairs import (
    BASELINE_MM,
    DOFFS_PX,
    FOCAL_PX,
    NUM_UNSEEN_COLUMNS,
    write_as_distributed,
    write_stereo_pair,
)
from warped_samples import difference_when_warped

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.middlebury import (
    depth_from_disparity,
    is_middlebury_scene,
    read_calibration,
    read_middlebury_sample,
)
from resdepth_colmap.evaluation.datasets.sample import DepthSample, SampleOptions

OPTIONS = SampleOptions(stereo=StereoConfig(), num_sources=1)


def read_sample(path: Path) -> DepthSample:
    return read_middlebury_sample(path, OPTIONS)


def test_what_is_distributed_is_read(tmp_path: Path) -> None:
    truth = write_as_distributed(tmp_path / "Plane")
    sample = read_sample(tmp_path / "Plane")
    assert np.allclose(sample.truth, truth, rtol=1e-5)
    assert not sample.truth[0].any()  # infinite disparity: not known
    assert sample.seen is not None and not sample.seen[:, :NUM_UNSEEN_COLUMNS].any()
    near, far = sample.depth_range
    assert near < truth[1:].min() and truth.max() < far


def test_the_true_depth_carries_one_view_into_the_other(tmp_path: Path) -> None:
    write_as_distributed(tmp_path / "Plane")
    sample = read_sample(tmp_path / "Plane")
    assert (sample.truth > 0).mean() > 0.9
    assert difference_when_warped(sample) < 0.01


def test_depth_is_what_middlebury_says(tmp_path: Path) -> None:
    write_as_distributed(tmp_path / "Plane")
    calibration = read_calibration(tmp_path / "Plane" / "calib.txt")
    disparity = np.array([[9.0, np.inf, 0.0]], np.float32)
    expected = BASELINE_MM / 1000 * FOCAL_PX / (9 + DOFFS_PX)
    depth = depth_from_disparity(disparity, calibration)
    assert depth.tolist() == [[pytest.approx(expected), 0, 0]]


def test_a_workspace_with_a_calibration_is_a_workspace(tmp_path: Path) -> None:
    write_as_distributed(tmp_path / "Plane")
    write_stereo_pair(tmp_path / "Other")
    (tmp_path / "Other" / "calib.txt").touch()
    assert is_middlebury_scene(tmp_path / "Plane")
    assert not is_middlebury_scene(tmp_path / "Other")


def truncate(folder: Path) -> None:
    path = folder / "disp0.pfm"
    path.write_bytes(path.read_bytes()[:-10])


def colour_truth(folder: Path) -> None:
    (folder / "disp0.pfm").write_bytes(b"PF\n80 60\n-1\n" + bytes(12 * 80 * 60))


def without_truth(folder: Path) -> None:
    (folder / "disp0.pfm").unlink()


def without_baseline(folder: Path) -> None:
    path = folder / "calib.txt"
    path.write_text(path.read_text().replace("baseline", "basis"))


def no_number(folder: Path) -> None:
    path = folder / "calib.txt"
    path.write_text(path.read_text().replace("doffs=3.0", "doffs=three"))


def half_an_image(folder: Path) -> None:
    Image.new("L", (40, 30)).save(folder / "im1.png")
    Image.new("L", (40, 30)).save(folder / "im0.png")


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (truncate, r"disp0\.pfm: cannot read the image \(image file is truncated"),
        (colour_truth, r"disp0\.pfm: not an image that can be read"),
        (without_truth, r"no disp0\.pfm or disp0GT\.pfm"),
        (without_baseline, r"calib\.txt: no baseline with 1 numbers"),
        (no_number, r"calib\.txt, line 3: 'three' is not a number"),
        (half_an_image, r"differ in size \(im0\.png 40 x 30, disp0\.pfm 80 x 60"),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, break_it: Callable[[Path], None], words: str
) -> None:
    write_as_distributed(tmp_path / "Plane")
    break_it(tmp_path / "Plane")
    with pytest.raises(WorkspaceError, match=words):
        read_sample(tmp_path / "Plane")
