"""Laws of the plan: sources as patch-match.cfg says, depth ranges, who is skipped."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
from looking_views import lookers
from planes import NAMES
from workspaces import plane_folder

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.pipeline.stereo.plan import plan_stereo, say_plan
from resdepth_colmap.scene import Scene


def opened(folder: Path, cfg: str | None = None) -> tuple[Workspace, Scene]:
    if cfg is not None:
        (folder / "stereo/patch-match.cfg").write_text(cfg, encoding="utf-8")
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return workspace, scene


def test_the_sources_are_those_of_the_cfg(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    cfg = (
        f"{NAMES[0]}\n{NAMES[1]}, {NAMES[4]}, {NAMES[1]}, {NAMES[0]}, ghost.png\n"
        f"{NAMES[1]}\n__all__\n{NAMES[2]}\n__auto__, 1\nnobody.png\n__all__\n"
    )
    workspace, scene = opened(folder, cfg)
    plans, skipped = plan_stereo(workspace, scene, StereoConfig())
    with caplog.at_level(logging.WARNING):
        say_plan(scene, plans, StereoConfig())
    by_name = {scene.views[plan.index].name: plan.sources for plan in plans}
    listed = [scene.views[index].name for index in by_name[NAMES[0]]]
    assert listed == [NAMES[1], NAMES[4]]
    assert len(by_name[NAMES[1]]) == 4
    assert len(by_name[NAMES[2]]) == 1
    assert skipped == (
        ("nobody.png", "patch-match.cfg names it, but the model does not"),
    )
    assert f"{NAMES[0]}: its source ghost.png is left out" in caplog.text


def test_no_more_sources_than_asked_for(tmp_path: Path) -> None:
    workspace, scene = opened(
        plane_folder(tmp_path, kinds=()), f"{NAMES[0]}\n__all__\n"
    )
    ((plan,), _) = plan_stereo(workspace, scene, StereoConfig(max_num_sources=3))
    assert len(plan.sources) == 3


def test_sources_together_see_the_view_whatever_names_them(tmp_path: Path) -> None:
    workspace, _ = opened(plane_folder(tmp_path, kinds=()))
    scene, config = lookers(), StereoConfig(max_num_sources=3)
    name, right = scene.views[0].name, {4, 5}
    cfg = workspace.stereo_path / "patch-match.cfg"
    for line in ("__auto__, 20", "__all__"):
        cfg.write_text(f"{name}\n{line}\n", encoding="utf-8")
        ((plan,), _) = plan_stereo(workspace, scene, config)
        assert len(plan.sources) == 3
        assert len(right & {*plan.sources}) == 1
    cfg.write_text(f"{name}\n__auto__, 3\n", encoding="utf-8")
    ((plan,), _) = plan_stereo(workspace, scene, config)
    assert plan.sources == (1, 2, 3)  # COLMAP would take these


def test_a_source_of_too_small_an_angle_is_none(tmp_path: Path) -> None:
    workspace, scene = opened(plane_folder(tmp_path, kinds=()))
    wide = StereoConfig(min_triangulation_angle=60.0)
    plans, skipped = plan_stereo(workspace, scene, wide)
    assert plans == ()
    assert {name for name, _ in skipped} == set(NAMES)
    named, _ = plan_stereo(*opened(workspace.path, f"{NAMES[0]}\n{NAMES[1]}\n"), wide)
    assert len(named) == 1  # who is named is not asked


def test_the_depth_range_is_colmaps_or_what_was_said(tmp_path: Path) -> None:
    workspace, scene = opened(plane_folder(tmp_path, kinds=()))
    assert scene.depth_range is not None
    plans, _ = plan_stereo(workspace, scene, StereoConfig())
    for plan in plans:
        assert plan.depth_range == tuple(scene.depth_range[plan.index])
    said = StereoConfig(depth_min=1.5, depth_max=2.5)
    assert {p.depth_range for p in plan_stereo(workspace, scene, said)[0]} == {
        (1.5, 2.5)
    }


def test_views_at_one_place_are_skipped_with_the_reason(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=(), num_points=0)
    workspace, scene = opened(folder, f"{NAMES[0]}\n{NAMES[1]}\n")
    first, second, *others = scene.views
    same = dataclasses.replace(second, cam_from_world=first.cam_from_world)
    scene = dataclasses.replace(scene, views=(first, same, *others))
    plans, ((name, reason),) = plan_stereo(workspace, scene, StereoConfig())
    assert plans == ()
    assert name == NAMES[0]
    assert "has a baseline" in reason


def test_a_view_that_looks_elsewhere_is_said_and_skipped(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=(), num_points=0)
    workspace, scene = opened(folder)
    first, *others = scene.views
    turned = first.cam_from_world.copy()
    turned[[0, 2]] *= -1  # half a turn about y: the others are behind it
    turned[:, 3] += [0, 0, -10.0]
    moved = dataclasses.replace(first, cam_from_world=np.asarray(turned))
    scene = dataclasses.replace(scene, views=(moved, *others))
    plans, skipped = plan_stereo(workspace, scene, StereoConfig())
    assert [name for name, _ in skipped] == [NAMES[0]]
    assert len(plans) == len(NAMES) - 1


def test_too_few_sources_for_the_filter_are_said_in_one_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    cfg = "".join(f"{name}\n__auto__, 1\n" for name in NAMES)
    workspace, scene = opened(folder, cfg)
    plans, _ = plan_stereo(workspace, scene, StereoConfig())
    with caplog.at_level(logging.WARNING):
        say_plan(scene, plans, StereoConfig())
    (record,) = caplog.records
    assert (
        "5 views have fewer sources than filter_min_num_consistent=2" in record.message
    )
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        say_plan(scene, plans, StereoConfig(filter=False))
    assert not caplog.records
