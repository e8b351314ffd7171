"""PLY files of all kinds, whole and broken; open3d is the oracle for whole ones."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.open3d_library import load_open3d
from resdepth_colmap.io.ply_points import read_ply_points
from resdepth_colmap.io.point_cloud import PointCloud, write_cloud

POINTS = np.array([[1, 2, 3], [-4.5, 5, 6e3], [7, 8.25, 9]], np.float32)
XYZ = "".join(f"property float {axis}\n" for axis in "xyz")


def header(text: str, kind: str = "ascii") -> bytes:
    return f"ply\nformat {kind} 1.0\ncomment made up\n{text}end_header\n".encode()


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("is_text", [True, False])
@pytest.mark.parametrize("has_colors", [True, False])
def test_what_open3d_writes_is_read(
    tmp_path: Path, is_text: bool, has_colors: bool
) -> None:
    open3d = load_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(POINTS))
    if has_colors:
        cloud.colors = open3d.utility.Vector3dVector(POINTS * 0 + 0.5)
        cloud.normals = open3d.utility.Vector3dVector(POINTS)
    path = tmp_path / "doubles.ply"  # its legacy writer makes doubles
    open3d.io.write_point_cloud(str(path), cloud, write_ascii=is_text)
    np.testing.assert_array_equal(read_ply_points(path), POINTS)


def test_what_we_write_is_read(tmp_path: Path) -> None:
    colors = np.full((3, 3), 7, np.uint8)
    path = tmp_path / "größe a.ply"
    write_cloud(path, PointCloud(points=POINTS, colors=colors, normals=POINTS))
    np.testing.assert_array_equal(read_ply_points(path), POINTS)


@pytest.mark.parametrize(("kind", "order"), [("little", "<"), ("big", ">")])
@pytest.mark.parametrize(("name", "code"), [("double", "f8"), ("float32", "f4")])
def test_both_byte_orders_and_a_mesh_are_read(
    tmp_path: Path, kind: str, order: str, name: str, code: str
) -> None:
    row = [("quality", "u1"), *((axis, order + code) for axis in "zxy")]
    rows = np.zeros(3, row)
    for axis, values in zip("xyz", POINTS.T, strict=True):
        rows[axis] = values
    text = "element camera 2\nproperty int id\n"
    text += "element vertex 3\nproperty uchar quality\n"
    text += "".join(f"property {name} {axis}\n" for axis in "zxy")
    text += "element face 1\nproperty list uchar int vertex_indices\n"
    data = header(text, f"binary_{kind}_endian") + bytes(8) + rows.tobytes()
    path = write(tmp_path / "a.ply", data + b"\x03" + bytes(12))
    np.testing.assert_array_equal(read_ply_points(path), POINTS)


def test_text_with_faces_first_and_odd_line_ends_is_read(tmp_path: Path) -> None:
    text = "element face 1\nproperty list uchar int vertex_indices\n"
    text += f"element vertex 3\nproperty int id\n{XYZ}"
    data = header(text) + b"3 0 1 2\n"
    data += b"".join(b"9 %g %g %g\n" % tuple(point) for point in POINTS)
    for end in (b"\n", b"\r\n"):
        path = write(tmp_path / "a.ply", data.replace(b"\n", end))
        np.testing.assert_array_equal(read_ply_points(path), POINTS)


def test_numbers_that_are_not_finite_are_read_as_they_are(tmp_path: Path) -> None:
    data = header(f"element vertex 2\n{XYZ}") + b"nan 1 2\ninf -inf 1e300\n"
    points = read_ply_points(write(tmp_path / "a.ply", data))
    np.testing.assert_array_equal(points, [[np.nan, 1, 2], [np.inf, -np.inf, np.inf]])


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_no_point_is_no_error(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path / "a.ply", header(f"element vertex 0\n{XYZ}", kind))
    assert read_ply_points(path).shape == (0, 3)


@pytest.mark.parametrize("num_bytes", [0, 1, 11, 12, 35])
def test_a_truncated_binary_file_is_refused(tmp_path: Path, num_bytes: int) -> None:
    data = header(f"element vertex 3\n{XYZ}", "binary_little_endian")
    path = write(tmp_path / "a.ply", data + POINTS.tobytes()[:num_bytes])
    expected = rf"a\.ply: it is truncated, with {num_bytes // 12} of its 3 points"
    with pytest.raises(WorkspaceError, match=expected):
        read_ply_points(path)


@pytest.mark.parametrize("lines", ["", "1 2 3\n", "1 2 3\n4 5 6\n"])
def test_a_truncated_text_is_refused(tmp_path: Path, lines: str) -> None:
    path = write(
        tmp_path / "a.ply", header(f"element vertex 3\n{XYZ}") + lines.encode()
    )
    with pytest.raises(WorkspaceError, match="it is truncated"):
        read_ply_points(path)


BROKEN: dict[str, bytes] = {
    "the first line is not 'ply'": b"\x89PNG",
    "the header has no end": b"ply\nformat ascii 1.0\n",
    "the body is ''": b"ply\nend_header\n",
    "the body is 'zip'": header("", "zip"),
    "it has no vertices": header("element face 0\nproperty int a\n"),
    "no plain x, y and z": header("element vertex 1\nproperty float x\n") + b"1\n",
    "is there twice": header(f"element vertex 1\n{XYZ}property int x\n") + b"1 2 3 4\n",
    "a line 'property quaternion x'": header(
        "element vertex 1\nproperty quaternion x\n"
    ),
    "a line 'element vertex -1'": header("element vertex -1\n"),
    "lists precede its vertices": header(
        f"element face 1\nproperty list uchar int i\nelement vertex 1\n{XYZ}",
        "binary_little_endian",
    ),
    "could not convert string": header(f"element vertex 1\n{XYZ}") + b"1 two 3\n",
    "invalid column index": header(f"element vertex 1\n{XYZ}") + b"1 2\n",
}


@pytest.mark.parametrize("text", BROKEN)
def test_what_is_wrong_is_said(tmp_path: Path, text: str) -> None:
    path = write(tmp_path / "a.ply", BROKEN[text])
    with pytest.raises(WorkspaceError, match=text) as caught:
        read_ply_points(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"gone\.ply: no such file"):
        read_ply_points(tmp_path / "gone.ply")
    with pytest.raises(WorkspaceError, match="cannot be read"):
        read_ply_points(tmp_path)


def test_a_large_text_is_read_by_rows(tmp_path: Path) -> None:
    points: npt.NDArray[np.float32] = np.arange(3000, dtype=np.float32).reshape(-1, 3)
    body = "\n".join(" ".join(map(str, row)) for row in points.tolist())
    data = header(f"element vertex 1000\n{XYZ}element face 1\nproperty int a\n")
    path = write(tmp_path / "a.ply", data + body.encode() + b"\n17\n")
    np.testing.assert_array_equal(read_ply_points(path), points)
