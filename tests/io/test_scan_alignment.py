from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from laser_scans import project, room_scan, write_scene

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.scan_alignment import read_scan_alignment

IDENTITY = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1"


def mesh(matrix: str = IDENTITY, name: str = "a.ply") -> str:
    content = f"<MLMatrix44>{matrix}</MLMatrix44>"
    return f'<MLMesh label="a" filename="{name}">{content}</MLMesh>'


def write(folder: Path, text: str) -> Path:
    (folder / "a.ply").touch()
    path = folder / "scan_alignment.mlp"
    path.write_text(text, encoding="utf-8")
    return path


def test_scans_are_read_in_order_with_their_matrices(tmp_path: Path) -> None:
    scans = [room_scan(num_rows=4), room_scan((1, 2, 1.3), (50, 10, 5), num_rows=4)]
    read = read_scan_alignment(write_scene(tmp_path, scans))
    assert [scan.path.name for scan in read] == ["scan1.ply", "scan2.ply"]
    for scan, expected in zip(read, scans, strict=True):
        assert scan.path.parent == tmp_path
        np.testing.assert_array_equal(scan.world_from_scan, expected.world_from_scan)


def test_a_project_as_distributed_is_read(shared_data: Callable[[str], Path]) -> None:
    folder = shared_data("eth3d_cloud_cases") / "two_scans"
    scans = read_scan_alignment(folder / "scan_alignment.mlp")
    assert [scan.path for scan in scans] == [folder / "scan1.ply", folder / "scan2.ply"]
    np.testing.assert_allclose(scans[1].world_from_scan[:3, 3], [3.2, 1.1, 4.2])


def test_an_absolute_path_and_more_of_meshlab_are_taken(tmp_path: Path) -> None:
    text = project(mesh(name=str(tmp_path / "a.ply"))).replace(
        "</MeshGroup>",
        "</MeshGroup><MeshGroup><MLMesh/></MeshGroup><RasterGroup/>",
    )
    assert read_scan_alignment(write(tmp_path, text))[0].path == tmp_path / "a.ply"


WRONG = {
    "not a MeshLab project, which is XML": '{"tolerances": [1]}',
    "which is XML": "",
    "no scan in it": project(""),
    r"no scan in it \(MLMesh": "<MeshLabProject/>",
    "no scan in it .*name ETH3D's": f"<Other><MeshGroup>{mesh()}</MeshGroup></Other>",
    "a mesh without a file name": project("<MLMesh/>"),
    r"names the scan gone\.ply, but": project(mesh(name="gone.ply")),
    "has 0 values but expected 16": project('<MLMesh filename="a.ply"/>'),
    r"a\.ply: its matrix has 9 values": project(mesh("1 0 0 0 1 0 0 0 1")),
    "its matrix has 17 values": project(mesh(IDENTITY + " 0")),
    "its matrix has 16 values but expected 16 numbers": project(
        mesh(IDENTITY.replace("1", "nan"))
    ),
    "its matrix is not of numbers": project(mesh("a b c")),
    "last row of its matrix": project(mesh("1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1")),
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, text: str) -> None:
    path = write(tmp_path, WRONG[text])
    with pytest.raises(WorkspaceError, match=text) as caught:
        read_scan_alignment(path)
    assert str(path) in str(caught.value)


def test_a_missing_project_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"gone\.mlp: cannot be read"):
        read_scan_alignment(tmp_path / "gone.mlp")


def test_a_matrix_that_stretches_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    read_scan_alignment(write(tmp_path, project(mesh())))
    assert not caplog.records
    stretched = "2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1"
    read_scan_alignment(write(tmp_path, project(mesh(stretched))))
    assert "a.ply: its matrix is not a rigid motion" in caplog.text
