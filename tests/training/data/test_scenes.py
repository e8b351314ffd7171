"""Laws of the split: by whole scenes, by name alone."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from planes import write_plane_workspace

from resdepth_colmap.errors import TrainingError, WorkspaceError
from resdepth_colmap.training.data.scenes import (
    check_apart,
    find_scenes,
    scene_name,
    split_scenes,
)

NAMES = st.lists(
    st.text("abcdefgh_0123", min_size=1).map("s".__add__), unique=True, min_size=2
)


@given(names=NAMES, share=st.floats(0.01, 0.5))
def test_every_scene_is_on_exactly_one_side_and_both_have_some(
    names: list[str], share: float
) -> None:
    scenes = [Path("/scenes") / name for name in names]
    training, held_out = split_scenes(scenes, share)
    assert sorted([*training, *held_out]) == sorted(scenes)
    assert training
    assert held_out


def test_scenes_stay_on_their_side_when_others_are_added() -> None:
    scenes = [Path(f"/scenes/room_{index}") for index in range(200)]
    few, many = split_scenes(scenes[:50], 0.2), split_scenes(scenes, 0.2)
    assert set(few.training) < set(many.training)
    assert set(few.held_out) < set(many.held_out)


def test_scenes_of_one_name_are_all_trained_on() -> None:
    scenes = [Path("/one/office"), Path("/two/office")]
    assert split_scenes(scenes, 0.5).held_out == ()


def test_about_the_asked_share_is_held_out() -> None:
    scenes = [Path(f"/scenes/room_{index:06d}") for index in range(1000)]
    assert 70 < len(split_scenes(scenes, 0.1).held_out) < 130
    assert split_scenes(scenes, 0.0).held_out == ()


def test_the_order_of_the_scenes_does_not_matter() -> None:
    scenes = [Path(f"/scenes/room_{index}") for index in range(40)]
    there, back = split_scenes(scenes, 0.2), split_scenes(scenes[::-1], 0.2)
    assert set(there.held_out) == set(back.held_out)


def test_a_single_scene_is_trained_on() -> None:
    assert split_scenes([Path("/scenes/a")], 0.2).training == (Path("/scenes/a"),)


@pytest.mark.parametrize("path", ["office", "office/dense", "office/dense/0"])
def test_a_scene_is_called_after_its_own_folder(path: str) -> None:
    assert scene_name(Path("/eth3d") / path) == "office"


def test_a_folder_of_workspaces_stands_for_all_that_have_a_truth(
    tmp_path: Path,
) -> None:
    for name in ("b", "a", "without"):
        write_plane_workspace(tmp_path / name)
    for name in ("b", "a"):
        (tmp_path / name / "ground_truth").mkdir()
    scenes = (tmp_path / "a", tmp_path / "b")
    assert find_scenes([tmp_path]) == scenes
    assert find_scenes([tmp_path / "a", tmp_path]) == scenes
    with pytest.raises(WorkspaceError, match=r"without: no ground_truth/"):
        find_scenes([tmp_path / "without"])


def test_a_scene_that_is_trained_on_cannot_be_watched(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a", "b")]
    check_apart(paths[:1], paths[1:])
    with pytest.raises(TrainingError, match="b: given both for training"):
        check_apart(paths, [tmp_path / "a" / ".." / "b"])
