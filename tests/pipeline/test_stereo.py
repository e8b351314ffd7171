"""Laws of the stage "stereo": who matches, what is kept, how it goes on."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import NAMES
from workspaces import plane_folder

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.depth_map import read_depth_map
from resdepth_colmap.io.model import read_scene
from resdepth_colmap.io.normal_map import write_normal_map
from resdepth_colmap.io.workspace import Workspace, open_workspace
from resdepth_colmap.matching.patch_match import MatchResult, MatchView
from resdepth_colmap.pipeline import stereo
from resdepth_colmap.pipeline.stereo import (
    StereoReport,
    choose_backend,
    plan_sources,
    stereo_workspace,
)
from resdepth_colmap.scene import NormalMap, Scene

CPU = StereoBackend.CPU


@pytest.fixture(autouse=True)
def num_sources(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Instead of matching, every pixel gets depth 2; how many sources each view had."""
    seen: list[int] = []

    def match(
        reference: MatchView, sources: Sequence[MatchView], *_: object, **__: object
    ) -> MatchResult:
        seen.append(len(sources))
        shape = reference.gray.shape
        normals = np.zeros((*shape, 3), np.float32)
        normals[..., 2] = -1
        return MatchResult(
            depth=np.full(shape, 2, np.float32),
            normals=normals,
            cost=np.zeros(shape, np.float32),
        )

    monkeypatch.setattr(stereo, "match_view", match)
    return seen


def opened(folder: Path) -> tuple[Workspace, Scene]:
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return workspace, scene


def match(folder: Path, **options: object) -> StereoReport:
    config = StereoConfig(**options)  # type: ignore[arg-type] # passed on
    return stereo_workspace(*opened(folder), config, CPU)


def test_each_view_without_a_map_gets_one(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    assert set(match(folder).matched) == set(NAMES)
    for name in NAMES:
        path = folder / "stereo/depth_maps" / f"{name}.photometric.bin"
        assert (read_depth_map(path) == 2).all()
        assert (folder / "stereo/normal_maps" / f"{name}.photometric.bin").is_file()
    assert set(match(folder).kept) == set(NAMES)


def test_maps_of_others_are_never_replaced(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric",))
    assert match(folder).matched == ()
    assert match(folder, window_radius=3).matched == ()


def test_our_own_maps_are_made_anew_with_other_options(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder)
    assert set(match(folder, window_radius=3).matched) == set(NAMES)


def test_images_are_matched_at_the_size_asked_for(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, max_image_size=40)
    path = folder / "stereo/depth_maps" / f"{NAMES[0]}.photometric.bin"
    assert read_depth_map(path).shape == (30, 40)


def test_an_interrupted_matching_goes_on_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    written: list[Path] = []

    def write(path: Path, normals: NormalMap) -> None:
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(path)
        write_normal_map(path, normals)

    with monkeypatch.context() as patch:
        patch.setattr(stereo, "write_normal_map", write)
        with pytest.raises(KeyboardInterrupt):
            match(folder)
    assert choose_backend(StereoBackend.AUTO, *opened(folder)) is CPU
    again = stereo_workspace(*opened(folder), StereoConfig())
    assert len(again.kept) == 2
    assert len(again.matched) == len(NAMES) - 2  # the half-written one, too
    backend = choose_backend(StereoBackend.AUTO, *opened(folder))
    assert backend is StereoBackend.EXISTING


def test_maps_that_are_there_win(tmp_path: Path) -> None:
    auto = StereoBackend.AUTO
    folder = plane_folder(tmp_path)
    assert choose_backend(auto, *opened(folder)) is StereoBackend.EXISTING
    bare = plane_folder(tmp_path / "bare", kinds=())
    expected = StereoBackend.COLMAP if pycolmap.has_cuda else CPU
    assert choose_backend(auto, *opened(bare)) is expected
    with pytest.raises(WorkspaceError, match="--stereo cpu"):
        choose_backend(StereoBackend.EXISTING, *opened(bare))


def test_the_sources_are_those_of_the_cfg(
    tmp_path: Path, num_sources: list[int]
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    text = (
        f"{NAMES[0]}\n{NAMES[1]}, {NAMES[4]}\n{NAMES[1]}\n__all__\n"
        f"{NAMES[2]}\n__auto__, 1\nnobody.png\n__all__\n"
    )
    (folder / "stereo/patch-match.cfg").write_text(text, encoding="utf-8")
    workspace, scene = opened(folder)
    plans, skipped = plan_sources(workspace, scene, StereoConfig())
    by_name = {scene.views[index].name: sources for index, sources in plans.items()}
    listed = [scene.views[index].name for index in by_name[NAMES[0]]]
    assert listed == [NAMES[1], NAMES[4]]
    assert len(by_name[NAMES[1]]) == 4
    assert len(by_name[NAMES[2]]) == 1
    assert [name for name, _ in skipped] == ["nobody.png"]
    match(folder)
    assert sorted(num_sources) == [1, 2, 4]
