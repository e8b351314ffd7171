"""Laws of the workspaces that measurements write to, and of what is measured there."""

from pathlib import Path

import numpy as np
import pytest
from fake_matcher import FakeMatcher, installed
from planes import NAMES, write_plane_workspace

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.cfg import SourceKind, SourceSpec
from scripts.benchmarks.matching import matched_workspace as module
from scripts.benchmarks.matching.matched_workspace import (
    MatchedWorkspace,
    copied_maps,
    linked_maps,
    matched_workspace,
)
from scripts.benchmarks.matching.parts import stretched_range

ALL = SourceSpec(kind=SourceKind.ALL)
FIRST = StereoConfig(geom_consistency=False, filter=False)


@pytest.fixture(autouse=True)
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    monkeypatch.setattr(module, "warm_up", lambda _: None)
    return installed(monkeypatch)


@pytest.fixture
def matched(tmp_path: Path) -> MatchedWorkspace:
    write_plane_workspace(tmp_path / "scene", kinds=("photometric",))
    return matched_workspace(tmp_path / "scene", tmp_path / "cache" / "scene")


def files(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder)): path.stat().st_mtime_ns
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_original_is_never_written_to(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path / "scene", kinds=("photometric",))
    before = files(tmp_path / "scene")
    matched = matched_workspace(tmp_path / "scene", tmp_path / "cache")
    matched.match("photometric", dict.fromkeys(NAMES, ALL), FIRST)
    assert files(tmp_path / "scene") == before
    assert matched.workspace.depth_map_path(NAMES[0], "photometric").is_file()


def test_finished_maps_are_not_made_again_and_their_seconds_are_kept(
    matched: MatchedWorkspace, matcher: FakeMatcher
) -> None:
    sources = dict.fromkeys(NAMES, ALL)
    assert matched.match("first", sources, FIRST) is not None
    seconds = matched.match("first", sources, FIRST)
    assert len(matcher.calls) == len(NAMES)
    again = matched_workspace(matched.path, matched.path)
    assert again.match("first", sources, FIRST) == seconds
    assert len(matcher.calls) == len(NAMES)


def test_what_was_never_measured_has_no_seconds(matched: MatchedWorkspace) -> None:
    sources = dict.fromkeys(NAMES, ALL)
    matched.match("first", sources, FIRST)
    assert matched.match("other", sources, FIRST) is None


def test_the_second_pass_takes_the_maps_of_the_first_and_only_the_images_asked_for(
    matched: MatchedWorkspace, matcher: FakeMatcher
) -> None:
    matched.match("first", dict.fromkeys(NAMES, ALL), FIRST)
    matched.match("second", {NAMES[0]: ALL}, StereoConfig(filter=False))
    starts = [call.start is not None for call in matcher.calls]
    assert starts == [False] * len(NAMES) + [True]
    assert all(depth.all() for depth in matcher.calls[-1].source_depths or [])


def test_a_copy_begins_with_the_same_maps_and_leaves_them_alone(
    matched: MatchedWorkspace, matcher: FakeMatcher, tmp_path: Path
) -> None:
    sources = dict.fromkeys(NAMES, ALL)
    matched.match("first", sources, FIRST)
    before = files(matched.path / "stereo" / "depth_maps")
    copy = copied_maps(matched, tmp_path / "copy")
    copy.match("filtered", sources, StereoConfig())
    assert len(matcher.calls) == 2 * len(NAMES)  # no photometric pass again
    assert copy.workspace.depth_map_path(NAMES[0], "geometric").is_file()
    assert files(matched.path / "stereo" / "depth_maps") == before


def test_maps_are_linked_whole_and_as_often_as_asked(
    matched: MatchedWorkspace, tmp_path: Path
) -> None:
    scene = tmp_path / "scene"
    before = files(scene)
    for _ in range(2):
        assert linked_maps(scene, matched)
    for name in NAMES:
        path = matched.workspace.depth_map_path(name, "photometric")
        original = scene / "stereo" / "depth_maps" / f"{name}.photometric.bin"
        assert path.resolve() == original.resolve()
    assert files(scene) == before
    write_plane_workspace(tmp_path / "empty", kinds=())
    assert not linked_maps(tmp_path / "empty", matched)


def test_a_range_of_maps_is_stretched_by_a_quarter() -> None:
    depths = np.concatenate([np.zeros(50), np.linspace(2, 4, 1001)])
    found = stretched_range({"a": depths.astype(np.float32)[np.newaxis]})
    assert found["depth_min"] == pytest.approx(0.75 * 2.02)
    assert found["depth_max"] == pytest.approx(1.25 * 3.98)
