import json
import os
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import NAMES, NORMAL, OFFSET, PlaneView, write_plane_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.cfg import read_sources
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.normal_map import read_normal_map
from resdepth_colmap.io.colmap.output import OutputWorkspace, read_record, write_record
from resdepth_colmap.io.colmap.workspace import open_workspace, original_map_path
from resdepth_colmap.io.point_cloud import read_cloud


def _write_all(output: OutputWorkspace, plane: list[PlaneView]) -> None:
    output.prepare(NAMES)
    for view in plane:
        confidence = np.full_like(view.depth, 0.5)
        output.write_maps(view.view.name, view.depth, view.normals, confidence)
    output.write_cfgs(NAMES)


def test_the_output_is_a_workspace_that_colmap_fuses(tmp_path: Path) -> None:
    # As COLMAP itself computes maps, with a pixel's ray through its bare index.
    plane = write_plane_workspace(
        tmp_path, kinds=(), size_px=(160, 120), center_px=0.0, num_points=100
    )
    output = OutputWorkspace(source=open_workspace(tmp_path))
    _write_all(output, plane)
    options = pycolmap.StereoFusionOptions()
    options.num_threads = 1
    cloud_path = tmp_path / "fused.ply"
    pycolmap.stereo_fusion(
        output_path=cloud_path,
        workspace_path=output.path,
        input_type="geometric",
        options=options,
        output_type="PLY",
    )
    cloud = read_cloud(cloud_path)
    assert len(cloud) > 4000
    distance = np.abs(cloud.points @ NORMAL - OFFSET)
    # COLMAP takes the median of each coordinate alone: off by up to half a pixel.
    assert np.median(distance) < 1e-3
    assert distance.max() < 0.01
    assert (cloud.normals @ NORMAL).min() > 0.9999


def test_the_output_is_a_workspace_that_we_open(tmp_path: Path) -> None:
    plane = write_plane_workspace(tmp_path, kinds=())
    output = OutputWorkspace(source=open_workspace(tmp_path))
    assert not output.is_written("3.png")
    for _ in range(2):  # a second run changes nothing
        _write_all(output, plane)
        workspace = open_workspace(tmp_path / "resdepth")
        assert workspace == output.workspace
        for view in plane:
            name = view.view.name
            assert output.is_written(name)
            assert workspace.map_kinds(name) == ("geometric",)
            linked = workspace.image_path(name)
            assert linked.read_bytes() == (tmp_path / "images" / name).read_bytes()
            depth = read_depth_map(output.depth_map_path(name))
            np.testing.assert_array_equal(depth, view.depth)
            normals = read_normal_map(output.normal_map_path(name))
            np.testing.assert_array_equal(normals, view.normals)
            assert (read_depth_map(output.confidence_map_path(name)) == 0.5).all()
    fused = (workspace.stereo_path / "fusion.cfg").read_text("utf-8").splitlines()
    assert tuple(fused) == NAMES
    assert set(read_sources(workspace.stereo_path / "patch-match.cfg")) == set(NAMES)


def test_the_users_files_are_not_written_through_the_links(tmp_path: Path) -> None:
    plane = write_plane_workspace(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    _write_all(OutputWorkspace(source=open_workspace(tmp_path)), plane[::-1])
    for path, content in before.items():
        assert path.read_bytes() == content


def test_a_model_of_an_earlier_run_does_not_stay(tmp_path: Path) -> None:
    plane = write_plane_workspace(tmp_path, kinds=())
    output = OutputWorkspace(source=open_workspace(tmp_path))
    _write_all(output, plane)
    model = pycolmap.Reconstruction(tmp_path / "sparse")
    for path in (tmp_path / "sparse").iterdir():
        path.unlink()
    model.write_text(tmp_path / "sparse")
    _write_all(output, plane)
    assert not list((tmp_path / "resdepth/sparse").glob("*.bin"))


def test_an_image_without_a_file_is_left_out(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    (tmp_path / "images/3.png").unlink()
    OutputWorkspace(source=open_workspace(tmp_path)).prepare(NAMES)
    assert (tmp_path / "resdepth/images/4.png").is_file()
    assert not (tmp_path / "resdepth/images/3.png").exists()


@pytest.mark.parametrize("links", [True, False])
def test_in_place_the_first_original_is_kept_for_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    if not links:
        monkeypatch.setattr(os, "link", _refuse)
    plane = write_plane_workspace(tmp_path)
    workspace = open_workspace(tmp_path)
    output = OutputWorkspace(source=workspace, in_place=True)
    path = workspace.depth_map_path("3.png", "geometric")
    original = path.read_bytes()
    assert not output.is_written("3.png")
    output.prepare(NAMES)
    for factor in (2, 3):
        depth = plane[3].depth * np.float32(factor)
        output.write_maps("3.png", depth, plane[3].normals)
        np.testing.assert_array_equal(read_depth_map(path), depth)
        kept = original_map_path(path)
        assert kept is not None
        assert kept.read_bytes() == original
    assert output.is_written("3.png")
    assert workspace.map_kinds("3.png") == ("geometric",)


def test_in_place_a_refined_map_is_never_taken_for_an_original(tmp_path: Path) -> None:
    plane = write_plane_workspace(tmp_path, kinds=("photometric",))
    output = OutputWorkspace(source=open_workspace(tmp_path), in_place=True)
    output.prepare(NAMES)
    for _ in range(2):
        output.write_maps("3.png", plane[3].depth, plane[3].normals)
        assert original_map_path(output.depth_map_path("3.png")) is None
    assert output.source.map_kinds("3.png") == ("geometric", "photometric")
    assert output.source.original_kinds("3.png") == ("photometric",)


def test_in_place_the_users_cfg_files_stay(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path)
    (tmp_path / "stereo/patch-match.cfg").unlink()
    before = (tmp_path / "stereo/fusion.cfg").read_bytes()
    OutputWorkspace(source=open_workspace(tmp_path), in_place=True).write_cfgs(
        ["3.png"]
    )
    assert (tmp_path / "stereo/fusion.cfg").read_bytes() == before
    assert list(read_sources(tmp_path / "stereo/patch-match.cfg")) == ["3.png"]


def test_a_file_in_the_place_of_the_output_is_named(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    (tmp_path / "resdepth").write_text("")
    with pytest.raises(WorkspaceError, match="resdepth"):
        OutputWorkspace(source=open_workspace(tmp_path)).prepare(NAMES)


def test_a_name_that_leads_out_is_not_written(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    output = OutputWorkspace(source=open_workspace(tmp_path))
    depth, normals = np.ones((2, 2), np.float32), np.zeros((2, 2, 3), np.float32)
    for name in ("../../evil.png", "/evil.png"):
        with pytest.raises(WorkspaceError, match="image name"):
            output.write_maps(name, depth, normals, depth)
    assert not list(tmp_path.parent.glob("**/*evil*"))


def test_a_record_that_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a" / "run.json"
    assert read_record(path) == {}
    write_record(path, {"größe": 1.5, "path": Path("a/b"), "images": {"x": [1, None]}})
    assert read_record(path) == {
        "größe": 1.5,
        "path": str(Path("a/b")),
        "images": {"x": [1, None]},
    }


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"[" * 100_000])
def test_a_corrupt_record_is_named_with_the_way_out(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "run.json"
    path.write_bytes(content)
    with pytest.raises(WorkspaceError, match=r"run\.json.*delete it"):
        read_record(path)


def test_a_record_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    write_record(path, {"a": 1})
    circular: dict[str, object] = {}
    circular["self"] = circular
    with pytest.raises(ValueError, match="Circular"):
        write_record(path, circular)
    assert json.loads(path.read_text()) == {"a": 1}


def _refuse(*_: object, **__: object) -> None:
    raise OSError("no links here")
