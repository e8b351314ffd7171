"""Laws of what is confirmed by chance, on maps of a plane and on noise."""

import numpy as np
import pytest
from planes import NAMES

from resdepth_colmap.evaluation.matching_chance import dense, measure_chance
from resdepth_colmap.evaluation.matching_passes import Folders
from resdepth_colmap.io.depth_map import read_depth_map, write_depth_map


def test_pixels_are_dense_where_half_of_their_window_is_confirmed() -> None:
    confirmed = np.zeros((20, 30), np.bool_)
    confirmed[:, :10] = True
    confirmed[10, 20] = True
    assert dense(confirmed)[:, :10].all()
    assert not dense(confirmed)[:, 11:].any()


def test_the_pixels_of_a_surface_are_dense_and_not_there_by_chance(
    plane_folders: Folders,
) -> None:
    result = measure_chance(plane_folders)
    assert list(result["maps"]) == list(NAMES)
    for entry in result["maps"].values():
        assert entry["dense"] > 0.95
        assert 0.0 <= entry["agree_dense"] <= 1.0


def test_noise_in_two_maps_is_confirmed_as_often_when_it_is_wrong(
    plane_folders: Folders,
) -> None:
    rng = np.random.default_rng(0)
    maps = plane_folders.data / "meeting_room" / "stereo" / "depth_maps"
    for path in maps.rglob("*.bin"):
        exact = read_depth_map(path)
        noise = exact * rng.uniform(0.7, 1.4, exact.shape).astype(np.float32)
        write_depth_map(path, noise)
    mean = measure_chance(plane_folders)["mean"]
    assert mean["dense"] < 0.2
    assert mean["chance"] == pytest.approx(1.0, abs=0.25)
