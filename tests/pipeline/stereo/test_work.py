"""Laws of what `auto` matches: what is missing, blank, or made from something else."""

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from fake_matcher import FakeMatcher, installed
from planes import NAMES
from workspaces import opened, plane_folder

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.pipeline.stereo.stage import (
    StereoReport,
    choose_backend,
    stereo_workspace,
)

AUTO, CPU = StereoBackend.AUTO, StereoBackend.CPU


@pytest.fixture(autouse=True)
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    return installed(monkeypatch)


def match(folder: Path, backend: StereoBackend = AUTO) -> StereoReport:
    return stereo_workspace(*opened(folder), StereoConfig(filter=False), backend)


def depth_path(folder: Path, name: str, kind: str = "geometric") -> Path:
    return folder / "stereo/depth_maps" / f"{name}.{kind}.bin"


def rescaled(folder: Path, scale: float) -> None:
    model = pycolmap.Reconstruction(folder / "sparse")
    model.transform(pycolmap.Sim3d(scale, pycolmap.Rotation3d(), np.zeros(3)))
    model.write(folder / "sparse")


def test_maps_of_ours_are_made_anew_from_another_model(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, CPU)
    assert choose_backend(AUTO, *opened(folder)) is StereoBackend.EXISTING
    rescaled(folder, 1.1)
    assert set(match(folder).matched) == set(NAMES)
    assert choose_backend(AUTO, *opened(folder)) is StereoBackend.EXISTING


def test_they_are_made_with_the_options_of_before(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    stereo_workspace(*opened(folder), StereoConfig(max_image_size=40), CPU)
    assert match(folder).matched == ()  # a filter or a size is the user's choice
    rescaled(folder, 1.1)
    match(folder)
    assert read_depth_map(depth_path(folder, NAMES[0])).shape == (30, 40)


def test_of_foreign_maps_only_the_missing_ones_are_made(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    depth_path(folder, NAMES[1]).unlink()
    blank = np.zeros_like(read_depth_map(depth_path(folder, NAMES[2])))
    write_depth_map(depth_path(folder, NAMES[2]), blank)
    before = depth_path(folder, NAMES[0]).read_bytes()
    assert set(match(folder).matched) == {NAMES[1], NAMES[2]}
    assert read_depth_map(depth_path(folder, NAMES[1], "photometric")).all()
    assert not depth_path(folder, NAMES[0], "photometric").exists()
    assert depth_path(folder, NAMES[0]).read_bytes() == before
    assert match(folder).matched == ()


def test_a_view_that_the_cfg_does_not_name_is_matched_too(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    cfg = "".join(f"{name}\n__auto__, 20\n" for name in NAMES[:3])
    (folder / "stereo/patch-match.cfg").write_text(cfg, encoding="utf-8")
    assert set(match(folder).matched) == set(NAMES)


def test_maps_that_the_user_put_in_the_place_of_ours_are_kept(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, CPU)
    theirs = np.full((60, 80), 3.5, np.float32)
    for name in NAMES:
        write_depth_map(depth_path(folder, name), theirs)
    rescaled(folder, 1.1)
    match(folder)
    for name in NAMES:
        assert (read_depth_map(depth_path(folder, name)) == 3.5).all()


def test_a_blank_map_is_replaced_where_ours_are_asked_for(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for name in NAMES:
        write_depth_map(depth_path(folder, name), np.zeros((60, 80), np.float32))
    match(folder, CPU)
    for name in NAMES:
        assert read_depth_map(depth_path(folder, name)).all()
