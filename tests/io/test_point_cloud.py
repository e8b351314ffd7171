import subprocess
import sys
from pathlib import Path

import numpy as np
import open3d
import pytest

from resdepth_colmap.errors import ConfigError, FusionError, WorkspaceError
from resdepth_colmap.io.point_cloud import PointCloud, read_cloud, write_cloud


def _cloud(num_points: int) -> PointCloud:
    rng = np.random.default_rng(0)
    return PointCloud(
        points=rng.normal(0, 3, (num_points, 3)).astype(np.float32),
        colors=rng.integers(0, 256, (num_points, 3)).astype(np.uint8),
        normals=rng.normal(0, 1, (num_points, 3)).astype(np.float32),
    )


@pytest.mark.parametrize("num_points", [1, 50])
def test_what_is_written_as_ply_is_read(tmp_path: Path, num_points: int) -> None:
    cloud = _cloud(num_points)
    path = tmp_path / "größe a" / "fused.ply"
    write_cloud(path, cloud)
    read = read_cloud(path)
    assert len(read) == num_points
    np.testing.assert_array_equal(read.points, cloud.points)
    np.testing.assert_array_equal(read.colors, cloud.colors)
    np.testing.assert_array_equal(read.normals, cloud.normals)
    assert [file.name for file in path.parent.iterdir()] == ["fused.ply"]


def test_a_sample_is_some_of_the_points_each_with_its_own_colour() -> None:
    cloud = _cloud(50)
    sample = cloud.sampled(20)
    rows = {tuple(row) for row in np.column_stack([cloud.points, cloud.colors])}
    taken = {tuple(row) for row in np.column_stack([sample.points, sample.colors])}
    assert len(sample) == len(taken) == 20
    assert taken <= rows
    assert cloud.sampled(50) is cloud


def test_ply_holds_float32_as_other_programs_expect(tmp_path: Path) -> None:
    cloud = _cloud(5)
    write_cloud(tmp_path / "fused.ply", cloud)
    header, data = (tmp_path / "fused.ply").read_bytes().split(b"end_header\n")
    for axis in (b"x", b"y", b"z", b"nx", b"ny", b"nz"):
        assert b"property float " + axis + b"\n" in header
    assert b"double" not in header
    assert len(data) == 5 * (6 * 4 + 3)
    rows = np.frombuffer(data, np.uint8).reshape(5, 27)[:, :12]
    np.testing.assert_array_equal(rows.copy().view("<f4"), cloud.points)


def test_pcd_holds_float32(tmp_path: Path) -> None:
    write_cloud(tmp_path / "fused.pcd", _cloud(5))
    header = (tmp_path / "fused.pcd").read_bytes()[:300]
    assert b"SIZE 4 4 4 4 4 4 4\n" in header
    assert b"POINTS 5\n" in header


def test_xyz_holds_the_coordinates(tmp_path: Path) -> None:
    cloud = _cloud(5)
    write_cloud(tmp_path / "fused.xyz", cloud)
    np.testing.assert_allclose(np.loadtxt(tmp_path / "fused.xyz"), cloud.points, 1e-6)


@pytest.mark.parametrize("suffix", ["ply", "xyz"])
def test_a_cloud_far_from_the_origin_keeps_its_shape(
    tmp_path: Path, suffix: str
) -> None:
    offset = np.array([500000.0, 4500000.0, 100.0])
    cloud = _cloud(50).moved(offset)
    assert cloud.points.dtype == np.float64
    path = tmp_path / f"far.{suffix}"
    write_cloud(path, cloud)
    found = np.asarray(open3d.io.read_point_cloud(str(path)).points)
    np.testing.assert_allclose(found - offset, _cloud(50).points, atol=2e-6)
    with pytest.raises(ConfigError, match=r"use \.ply or \.xyz"):
        write_cloud(tmp_path / "far.pcd", cloud)


def test_an_extension_in_capitals_is_known(tmp_path: Path) -> None:
    write_cloud(tmp_path / "FUSED.PLY", _cloud(5))
    assert len(read_cloud(tmp_path / "FUSED.PLY")) == 5


def test_an_unknown_extension_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\.ply, \.pcd, \.xyz"):
        write_cloud(tmp_path / "fused.las", _cloud(1))
    with pytest.raises(ConfigError, match=r"\.ply"):
        read_cloud(tmp_path / "fused.xyz")


def test_an_empty_cloud_is_refused_with_the_way_out(tmp_path: Path) -> None:
    with pytest.raises(FusionError, match=r"--min-num-views"):
        write_cloud(tmp_path / "fused.ply", _cloud(0))
    assert not list(tmp_path.iterdir())


def test_a_cloud_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "folder").write_text("a file in the place of a folder")
    with pytest.raises(WorkspaceError, match=r"fused\.ply"):
        write_cloud(tmp_path / "folder" / "fused.ply", _cloud(1))


def test_what_is_no_cloud_is_named(tmp_path: Path) -> None:
    (tmp_path / "broken.ply").write_text("ply\nformat ascii 1.0\nend_header\n")
    for name in ("broken.ply", "gone.ply"):
        with pytest.raises(WorkspaceError, match=name):
            read_cloud(tmp_path / name)


def test_a_cloud_without_colours_and_normals_is_read(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 1\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    (tmp_path / "a.ply").write_text(header + "1 2 3\n")
    cloud = read_cloud(tmp_path / "a.ply")
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3]])
    assert not cloud.colors.any()
    assert not cloud.normals.any()


def test_arrays_that_do_not_fit_are_a_bug_of_the_caller() -> None:
    cloud = _cloud(3)
    with pytest.raises(ValueError, match="expected"):
        PointCloud(points=cloud.points, colors=cloud.colors[:2], normals=cloud.normals)


def test_importing_does_not_load_open3d() -> None:
    code = (
        "import sys, resdepth_colmap.io.point_cloud\nsys.exit('open3d' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
