"""Laws of what is asked where maps differ, on maps of a plane."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_matcher import FakeMatcher, installed
from planes import NAMES, write_plane_workspace

from resdepth_colmap.evaluation import matched_workspace as module
from resdepth_colmap.evaluation.matching_disagreement import measure_disagreement
from resdepth_colmap.evaluation.matching_from_theirs import (
    BAND_ROWS,
    band_of,
    measure_from_theirs,
    worst_rows,
)
from resdepth_colmap.evaluation.matching_meeting_room import (
    matched_room,
    measure_meeting_room,
)
from resdepth_colmap.evaluation.matching_more_sources import (
    MORE_SOURCES,
    NUM_WORST,
    measure_more_sources,
)
from resdepth_colmap.evaluation.matching_passes import Folders
from resdepth_colmap.io.depth_map import read_depth_map
from resdepth_colmap.matching.patch_match import MatchView, Surface


@pytest.fixture(autouse=True)
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    monkeypatch.setattr(module, "warm_up", lambda _: None)
    return installed(monkeypatch)


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    write_plane_workspace(tmp_path / "meeting_room", kinds=("photometric",))
    return Folders(data=tmp_path, cache=tmp_path / "cache")


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The disagreement of a depth of 4 everywhere with exact maps."""
    path = tmp_path_factory.mktemp("asked")
    write_plane_workspace(path / "meeting_room", kinds=("photometric",))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "warm_up", lambda _: None)
        installed(patch)
        return measure_disagreement(Folders(data=path, cache=path / "cache"))


def test_pixels_are_parted_and_the_shares_are_whole(asked: dict[str, Any]) -> None:
    result = asked
    assert list(result["maps"]) == list(NAMES)
    for entry in result["maps"].values():
        parts = entry["by_count"].values()
        assert sum(part["share"] for part in parts) == pytest.approx(1)
        groups = entry["groups"].values()
        assert sum(group["share"] for group in groups) == pytest.approx(1)
        # COLMAP's maps are exact and smooth here.
        assert entry["alike"]["of_median"] == 1
        assert entry["groups"]["disagree"]["confirming_theirs"] >= 1
    agree = [entry["groups"]["agree"]["share"] for entry in result["maps"].values()]
    assert result["mean"]["groups"]["agree"]["share"] == pytest.approx(np.mean(agree))


def test_the_photographs_prefer_the_map_that_is_right(asked: dict[str, Any]) -> None:
    # Where the views are close together and the texture is smooth, many are ties.
    for shares in asked["mean"]["costs"].values():
        assert shares["theirs"] > 0.3
        assert shares["ours"] < 0.1


def test_sparse_points_lie_on_the_map_that_is_right(asked: dict[str, Any]) -> None:
    maps = asked["maps"].values()
    points = [entry["points"] for entry in maps]
    assert sum(it["points"] for it in points) > 10
    assert all(it["theirs"] == it["points"] for it in points)
    assert sum(it["ours"] for it in points) == 0


def test_all_photos_are_matched_if_they_are_wanted(
    folders: Folders, matcher: FakeMatcher
) -> None:
    for kind in ("depth_maps", "normal_maps"):
        name = f"meeting_room/stereo/{kind}/{NAMES[0]}.photometric.bin"
        (folders.data / name).unlink()
    few = measure_meeting_room(folders)
    assert few["matched"] == {"with_map": len(NAMES) - 1, "in_all": len(NAMES)}
    assert len(matcher.calls) == 2 * (len(NAMES) - 1)
    every = Folders(data=folders.data, cache=folders.data / "every", all_photos=True)
    result = measure_meeting_room(every)
    assert result["matched"]["with_map"] == len(NAMES)
    assert list(result["maps"]) == list(NAMES[1:])
    assert len(matcher.calls) == 2 * (len(NAMES) - 1) + 2 * len(NAMES) - 1


def test_more_sources_start_from_the_same_photometric_maps(
    folders: Folders, matcher: FakeMatcher
) -> None:
    room = matched_room(folders)
    num_before = len(matcher.calls)
    result = measure_more_sources(folders)
    assert len(result["maps"]) == NUM_WORST
    calls = matcher.calls[num_before:]
    starts = [call.start is not None for call in calls]
    assert starts == [True] * NUM_WORST
    assert result["num_sources"] == MORE_SOURCES
    name = next(iter(result["maps"]))
    copy = folders.cache / f"meeting_room_{MORE_SOURCES}_sources/stereo/depth_maps"
    original = room.matched.workspace.depth_map_path(name, "photometric")
    np.testing.assert_array_equal(
        read_depth_map(copy / f"{name}.photometric.bin"), read_depth_map(original)
    )
    # What was made is kept.
    assert measure_more_sources(folders) == result
    assert len(matcher.calls) == num_before + len(starts)


def test_the_band_is_where_most_pixels_differ() -> None:
    disagree = np.zeros((500, 4), np.bool_)
    disagree[200:230] = True
    disagree[400:425] = True
    rows = worst_rows(disagree)
    assert rows.stop - rows.start == BAND_ROWS
    assert rows.start <= 200
    assert rows.stop >= 230
    assert worst_rows(disagree[:50]) == slice(0, 50)


def test_rows_of_a_view_are_seen_where_they_were() -> None:
    gray = np.random.default_rng(0).random((9, 6), dtype=np.float32)
    K = np.array([[5.0, 0, 3], [0, 5, 4], [0, 0, 1]])
    view = MatchView(gray=gray, K=K, cam_from_world=np.eye(3, 4))
    band = band_of(view, slice(2, 7))
    np.testing.assert_array_equal(band.gray, gray[2:7])
    np.testing.assert_array_equal(band.K @ [0, 0, 1], [3, 2, 1])
    np.testing.assert_array_equal(view.K, K)


def test_from_their_map_what_is_found_is_compared_with_both(
    folders: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    from resdepth_colmap.evaluation import matching_from_theirs

    # A matcher that stays where it starts, and one that finds a depth of 4 everywhere.
    def stays(reference: MatchView, *rest: object, start: Surface) -> Surface:
        assert reference.gray.shape == start.depth.shape
        return start

    for matcher, stay, back in ((stays, 1.0, 0.0), (FakeMatcher(), 0.0, 1.0)):
        monkeypatch.setattr(matching_from_theirs, "match_view", matcher)
        result = measure_from_theirs(folders)
        # A few pixels are near both: just beyond 2 % one way, within it the other.
        assert result["mean"]["stay"] == stay
        assert result["mean"]["return"] == pytest.approx(back, abs=0.01)
        for entry in result["maps"].values():
            assert entry["after"] == (1.0 if stay else entry["before"])
