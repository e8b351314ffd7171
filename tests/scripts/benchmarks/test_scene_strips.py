"""Laws of the strips: what is drawn, from what, and that scenes stay as they are."""

from pathlib import Path

import numpy as np
import pytest
from fake_matcher import FakeMatcher
from planes import NAMES, write_plane_workspace
from stereo_pairs import REFERENCE_NAME, SOURCE_NAME, write_stereo_pair
from workspaces import identity_weights

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.depth import sample_matching as sample_matching
from resdepth_colmap.evaluation.depth.match_cache import MatchCache
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.images import read_rgb
from scripts.benchmarks.scene_strips import scene_strips, scenes_at


@pytest.fixture
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    fake = FakeMatcher()
    monkeypatch.setattr(sample_matching, "match_view", fake)
    monkeypatch.setattr(sample_matching, "_compile", lambda: None)
    return fake


def draw(tmp_path: Path, scene: Path) -> list[Path]:
    cache = MatchCache(folder=tmp_path / "cache")
    config = RefineConfig(weights=identity_weights(tmp_path))
    return scene_strips(scene, tmp_path / "strips", cache, config)


def files(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


def test_each_image_with_a_map_has_its_strip_and_the_scene_is_not_written_to(
    tmp_path: Path,
) -> None:
    scene = tmp_path / "scene"
    write_plane_workspace(scene)
    before = files(scene)
    strips = draw(tmp_path, scene)
    flat = [name.replace("/", "-") for name in NAMES]
    assert [path.name for path in strips] == [f"scene-{name}.png" for name in flat]
    assert all(path.is_file() for path in strips)
    assert files(scene) == before


def test_a_pair_with_truth_is_matched_once_and_drawn_with_its_errors(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    scene, plain = tmp_path / "pair", tmp_path / "plain"
    write_stereo_pair(scene)
    write_plane_workspace(plain)
    before = files(scene)
    (strip,) = draw(tmp_path, scene)
    num_calls = len(matcher.calls)
    assert num_calls > 0
    assert draw(tmp_path, scene) == [strip]
    assert len(matcher.calls) == num_calls
    without_truth = draw(tmp_path, plain)[0]
    assert read_rgb(strip).shape[0] > read_rgb(without_truth).shape[0]  # two rows
    maps = tmp_path / "strips/workspaces/pair/stereo/depth_maps"
    for name in (f"{REFERENCE_NAME}.geometric", f"{SOURCE_NAME}.photometric"):
        assert np.all(read_depth_map(maps / f"{name}.bin") == 4)
    assert files(scene) == before


def test_a_cache_is_that_of_the_evaluation(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    write_stereo_pair(tmp_path / "pair")
    draw(tmp_path, tmp_path / "pair")
    (kept,) = (tmp_path / "cache").iterdir()
    assert kept.name.startswith(f"pair-{REFERENCE_NAME}-cpu-")


def test_without_maps_and_truth_the_way_out_is_named(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path / "scene", kinds=())
    with pytest.raises(WorkspaceError, match="stereo --no-filter"):
        draw(tmp_path, tmp_path / "scene")


def test_scenes_are_a_workspace_or_those_in_a_folder(tmp_path: Path) -> None:
    for name in ("b", "a"):
        write_plane_workspace(tmp_path / "all" / name, kinds=())
    (tmp_path / "all" / "other").mkdir()
    assert [path.name for path in scenes_at(tmp_path / "all")] == ["a", "b"]
    assert [path.name for path in scenes_at(tmp_path / "all" / "b")] == ["b"]
    with pytest.raises(WorkspaceError, match="no workspace in it"):
        scenes_at(tmp_path / "all" / "other")
