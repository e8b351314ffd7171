"""Laws of what is confirmed by chance, on maps of a plane and on noise."""

from pathlib import Path

import numpy as np
import pytest
from fake_matcher import installed
from planes import NAMES, write_plane_workspace

from resdepth_colmap.evaluation import matched_workspace as module
from resdepth_colmap.evaluation.matching_chance import dense, measure_chance
from resdepth_colmap.evaluation.matching_passes import Folders
from resdepth_colmap.io.depth_map import read_depth_map, write_depth_map


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folders:
    monkeypatch.setattr(module, "warm_up", lambda _: None)
    installed(monkeypatch)
    write_plane_workspace(tmp_path / "meeting_room", kinds=("photometric",))
    return Folders(data=tmp_path, cache=tmp_path / "cache")


def test_pixels_are_dense_where_half_of_their_window_is_confirmed() -> None:
    confirmed = np.zeros((20, 30), np.bool_)
    confirmed[:, :10] = True
    confirmed[10, 20] = True
    assert dense(confirmed)[:, :10].all()
    assert not dense(confirmed)[:, 11:].any()


def test_the_pixels_of_a_surface_are_dense_and_not_there_by_chance(
    folders: Folders,
) -> None:
    result = measure_chance(folders)
    assert list(result["maps"]) == list(NAMES)
    for entry in result["maps"].values():
        assert entry["dense"] > 0.95
        assert 0.0 <= entry["agree_dense"] <= 1.0


def test_noise_in_two_maps_is_confirmed_as_often_when_it_is_wrong(
    folders: Folders,
) -> None:
    rng = np.random.default_rng(0)
    maps = folders.data / "meeting_room" / "stereo" / "depth_maps"
    for path in maps.rglob("*.bin"):
        exact = read_depth_map(path)
        noise = exact * rng.uniform(0.7, 1.4, exact.shape).astype(np.float32)
        write_depth_map(path, noise)
    mean = measure_chance(folders)["mean"]
    assert mean["dense"] < 0.2
    assert mean["chance"] == pytest.approx(1.0, abs=0.25)
