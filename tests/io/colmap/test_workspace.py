import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES, write_plane_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import (
    Workspace,
    check_images,
    missing_images,
    open_workspace,
    original_map_path,
)
from resdepth_colmap.io.images import write_png
from resdepth_colmap.scene import Scene


def _scene(workspace: Workspace) -> Scene:
    return read_scene(workspace.sparse_path, workspace.images_path, workspace.path)


def _bare_workspace(path: Path, *, sparse: str = "sparse", stereo: bool = True) -> Path:
    (path / "images").mkdir(parents=True)
    (path / sparse).mkdir(parents=True)
    (path / sparse / "cameras.bin").write_bytes(b"")
    if stereo:
        (path / "stereo").mkdir()
    return path


@pytest.mark.parametrize("sparse", ["sparse", "sparse/0"])
def test_a_workspace_is_opened_where_it_is(tmp_path: Path, sparse: str) -> None:
    _bare_workspace(tmp_path, sparse=sparse)
    workspace = open_workspace(tmp_path)
    assert workspace.path == tmp_path
    assert workspace.sparse_path == tmp_path / sparse


def test_opening_creates_nothing(tmp_path: Path) -> None:
    _bare_workspace(tmp_path, stereo=False)
    assert not open_workspace(tmp_path).stereo_path.exists()


@pytest.mark.parametrize("below", ["dense", "dense/0", "any name"])
def test_a_parent_will_do(tmp_path: Path, below: str) -> None:
    _bare_workspace(tmp_path / below)
    assert open_workspace(tmp_path).path == tmp_path / below


def test_the_dense_folder_goes_before_the_distorted_photos(tmp_path: Path) -> None:
    _bare_workspace(tmp_path, sparse="sparse/0", stereo=False)
    _bare_workspace(tmp_path / "dense/0")
    assert open_workspace(tmp_path).path == tmp_path / "dense/0"


def test_our_own_output_is_not_what_was_meant(tmp_path: Path) -> None:
    _bare_workspace(tmp_path, stereo=False)
    _bare_workspace(tmp_path / "resdepth")
    assert open_workspace(tmp_path).path == tmp_path


def test_more_than_one_workspace_are_listed(tmp_path: Path) -> None:
    _bare_workspace(tmp_path / "dense/0")
    _bare_workspace(tmp_path / "dense/1")
    with pytest.raises(WorkspaceError, match=r"dense/0, .*dense/1"):
        open_workspace(tmp_path)


def test_what_is_no_workspace_is_refused_with_the_way_out(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "empty").mkdir()
    for name, problem in (("gone", "no such"), ("file", "file"), ("empty", "no model")):
        with pytest.raises(WorkspaceError, match=rf"{name}: .*{problem}.*point at"):
            open_workspace(tmp_path / name)


@pytest.mark.parametrize("mark", ["pmvs", "stereo-option-all"])
def test_the_layout_of_pmvs_is_refused(tmp_path: Path, mark: str) -> None:
    (tmp_path / mark).mkdir()
    with pytest.raises(WorkspaceError, match=r"PMVS.*--output_type COLMAP"):
        open_workspace(tmp_path)


def test_every_kind_of_map_is_found_and_nothing_else(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=("photometric", "geometric", "later-kind"))
    workspace = open_workspace(tmp_path)
    folder = tmp_path / "stereo/depth_maps"
    (folder / "3.png.geometric.bin.original").write_bytes(b"x")
    (folder / "3.png.bin").write_bytes(b"x")
    (folder / "3.png.jpg.photometric.bin").write_bytes(b"x")  # of the image 3.png.jpg
    for name in NAMES:
        kinds = workspace.map_kinds(name)
        assert kinds == ("geometric", "later-kind", "photometric")
        for kind in kinds:
            assert workspace.depth_map_path(name, kind).is_file()
            assert workspace.normal_map_path(name, kind).is_file()
    assert workspace.map_kinds("other.png") == ()
    assert workspace.map_kinds("no/folder.png") == ()


def test_the_original_of_a_replaced_map_is_known(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=("photometric", "geometric"))
    workspace = open_workspace(tmp_path)
    path = workspace.depth_map_path("3.png", "geometric")
    assert original_map_path(path) == path
    kept = path.with_name(path.name + ".original")
    kept.write_bytes(b"x")
    assert original_map_path(path) == kept
    kept.write_bytes(b"")  # there was none
    assert original_map_path(path) is None
    assert workspace.original_kinds("3.png") == ("photometric",)
    assert original_map_path(tmp_path / "gone.bin") is None


@pytest.mark.parametrize("name", ["../../evil.png", "/evil.png"])
def test_no_path_leads_out_of_the_workspace(tmp_path: Path, name: str) -> None:
    workspace = open_workspace(_bare_workspace(tmp_path))
    for make in (workspace.image_path, workspace.map_kinds):
        with pytest.raises(WorkspaceError, match="image name"):
            make(name)
    with pytest.raises(WorkspaceError, match="image name"):
        workspace.depth_map_path(name, "geometric")


def test_missing_images_are_named(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    workspace = open_workspace(tmp_path)
    scene = _scene(workspace)
    check_images(workspace, scene)
    assert missing_images(workspace, scene) == ()
    (tmp_path / "images/a/1 b.png").unlink()
    assert missing_images(workspace, scene) == ("a/1 b.png",)
    with pytest.raises(WorkspaceError, match=r"1 of 5 .*a/1 b\.png"):
        check_images(workspace, scene)
    shutil.rmtree(tmp_path / "images")
    with pytest.raises(WorkspaceError, match=r"5 of 5 .* and 2 more"):
        check_images(workspace, scene)


def test_an_image_of_another_size_than_its_camera_is_named(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    workspace = open_workspace(tmp_path)
    write_png(tmp_path / "images/3.png", np.zeros((30, 40, 3), np.uint8))
    with pytest.raises(WorkspaceError, match=r"3\.png.*40 x 30.*80 x 60"):
        check_images(workspace, _scene(workspace))


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("meeting_room", {"photometric"}),
        ("plant", {"photometric", "geometric"}),
        ("walnut", set()),
        ("middlebury/Pipes", set()),
        ("rendered_rich", set()),
    ],
)
def test_real_workspaces_are_opened(
    shared_data: Callable[[str], Path], name: str, kinds: set[str]
) -> None:
    workspace = open_workspace(shared_data(name))
    scene = _scene(workspace)
    check_images(workspace, scene)
    found = {kind for view in scene.views for kind in workspace.map_kinds(view.name)}
    assert found == kinds
