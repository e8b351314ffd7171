"""Laws of the map that is left out, on maps of a plane that are exact or wrong."""

import numpy as np
import pytest
from planes import NAMES

from resdepth_colmap.evaluation import matching_left_out as left_out_module
from resdepth_colmap.evaluation.matching_left_out import measure_left_out
from resdepth_colmap.evaluation.matching_passes import Folders
from resdepth_colmap.io.depth_map import read_depth_map, write_depth_map
from resdepth_colmap.io.workspace import open_workspace

WRONG = NAMES[1]


def made_wrong(plane_folders: Folders, factor: float) -> None:
    workspace = open_workspace(plane_folders.data / "meeting_room")
    path = workspace.depth_map_path(WRONG, "photometric")
    write_depth_map(path, read_depth_map(path) * np.float32(factor))


def test_exact_maps_agree_with_what_the_others_confirm(plane_folders: Folders) -> None:
    result = measure_left_out(plane_folders)
    assert list(result["maps"]) == list(NAMES)
    for entry in result["maps"].values():
        assert entry["theirs"]["agree"] > 0.99
        assert entry["theirs"]["apart"] > 0.99


@pytest.mark.parametrize(("factor", "answer"), [(0.9, "nearer"), (1.1, "farther")])
def test_a_wrong_map_among_others_is_told_as_what_it_is(
    plane_folders: Folders, factor: float, answer: str
) -> None:
    made_wrong(plane_folders, factor)
    result = measure_left_out(plane_folders)
    theirs = {name: entry["theirs"] for name, entry in result["maps"].items()}
    # No other map confirms the wrong one, and it is one of four that are left out.
    assert WRONG not in theirs
    for shares in theirs.values():
        assert 0.15 < shares[answer] < 0.35
        assert shares["agree"] == pytest.approx(1.0 - shares[answer], abs=0.01)
    apart = np.mean([shares["apart"] for shares in theirs.values()])
    assert (apart > 0.99) == (answer == "nearer")


def test_ours_is_asked_at_the_same_pixels_in_the_same_view(
    plane_folders: Folders, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = open_workspace(plane_folders.data / "meeting_room")
    exact = {
        name: read_depth_map(workspace.depth_map_path(name, "photometric"))
        for name in NAMES
    }
    made_wrong(plane_folders, 1.1)
    monkeypatch.setattr(left_out_module, "depth_of", lambda _, name, __: exact[name])
    for entry in measure_left_out(plane_folders)["maps"].values():
        assert entry["theirs"]["agree"] < 0.85
        assert entry["ours"]["agree"] > 0.99
