"""Each command on a small workspace: run it, then open what it wrote."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from planes import NAMES, NORMAL, OFFSET
from workspaces import identity_weights, plane_folder

from resdepth_colmap.cli.main import main
from resdepth_colmap.io.colmap.maps import read_depth_map, read_normal_map
from resdepth_colmap.io.point_cloud import read_cloud


def run(*arguments: object, exit_code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == exit_code, result.output
    return result


def refine(folder: Path, *arguments: object, exit_code: int = 0) -> Result:
    """`refine` with a network that changes nothing."""
    weights = identity_weights(folder.parent)
    return run("refine", folder, "--weights", weights, *arguments, exit_code=exit_code)


def test_refine_leaves_a_complete_workspace(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    result = refine(folder)
    output = folder / "resdepth"
    for name in NAMES:
        depth = read_depth_map(output / f"stereo/depth_maps/{name}.geometric.bin")
        normals = read_normal_map(output / f"stereo/normal_maps/{name}.geometric.bin")
        assert depth.shape == normals.shape[:2] == (60, 80)
        assert (output / f"stereo/confidence_maps/{name}.geometric.bin").is_file()
        assert (output / "images" / name).is_file()
    for path in ("sparse/cameras.bin", "stereo/fusion.cfg", "stereo/patch-match.cfg"):
        assert (output / path).is_file()
    cloud = read_cloud(output / "fused.ply")
    assert len(cloud) > 1000
    np.testing.assert_allclose(cloud.points @ NORMAL, OFFSET, atol=0.02)
    assert f"{len(cloud):,} points" in result.stdout
    assert str(output / "run.json") in result.stdout


def test_refine_draws_what_changed(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    result = refine(folder, "--no-fuse")
    pictures = sorted((folder / "resdepth").rglob("*.png"))
    pictures = [path for path in pictures if "images" not in path.parts]
    assert len(pictures) == len(NAMES) + 1
    for path in pictures:
        with Image.open(path) as picture:
            assert picture.size[0] > 200
    assert any(str(path) in result.stdout for path in pictures)


def test_the_record_of_a_run_says_what_was_done_with_what(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder, "--passes", 2, "--min-num-views", 2, "--no-pictures")
    record = json.loads((folder / "resdepth/run.json").read_text(encoding="utf-8"))
    assert record["options"]["refine"]["inner_iterations"] == 2
    assert record["options"]["fuse"]["min_num_views"] == 2
    assert set(record["versions"]) >= {"torch", "pycolmap", "open3d", "numpy"}
    assert len(record["weights_sha256"]) == 64
    assert set(record["seconds"]) >= {"stereo", "refine", "fuse"}
    assert record["peak_memory_mb"] > 50
    assert record["fuse"]["points"] > 1000
    assert set(record["images"]) == set(NAMES)
    image = record["images"][NAMES[0]]
    assert image["median_relative_change"] == pytest.approx(0, abs=1e-6)
    assert image["sources"][0]["name"] in NAMES
    assert image["seconds"] > 0


def test_a_finished_workspace_is_left_alone_until_asked(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    short = ("--no-fuse", "--no-pictures")
    assert "refined         5 images" in refine(folder, *short).stdout
    assert "kept            5 images" in refine(folder, *short).stdout
    assert "refined         5 images" in refine(folder, *short, "--overwrite").stdout


def test_in_place_puts_the_maps_into_the_workspace(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    path = folder / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin"
    original = path.read_bytes()
    refine(folder, "--in-place", "--no-pictures", "--cloud-format", "pcd")
    assert path.with_name(path.name + ".original").read_bytes() == original
    assert not (folder / "resdepth/stereo").exists()
    assert (folder / "resdepth/fused.pcd").is_file()


def test_a_parent_of_the_workspace_will_do(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path / "project" / "dense")
    folder.rename(folder.with_name("0"))
    result = run("info", tmp_path / "project")
    assert str(Path("dense") / "0") in result.stdout


def test_fuse_takes_what_refine_made(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder, "--no-fuse", "--no-pictures")
    assert not (folder / "resdepth/fused.ply").exists()
    run("fuse", folder, "--voxel-size", "0.1")
    thin = read_cloud(folder / "resdepth/fused.ply")
    run("fuse", folder, "--output", tmp_path / "cloud.ply")
    assert len(read_cloud(tmp_path / "cloud.ply")) > 3 * len(thin)


def test_fuse_before_refine_says_so(tmp_path: Path) -> None:
    result = run("fuse", plane_folder(tmp_path), exit_code=1)
    assert "no refined map to fuse; run `resdepth-colmap refine" in result.stderr


def test_colmap_can_be_the_fuser(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder, "--fuser", "colmap", "--no-pictures")
    assert len(read_cloud(folder / "resdepth/fused.ply")) > 500


def test_export_prints_the_files_it_wrote(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    arguments = ("--format", "png16", "--maps", "geometric", "--output", tmp_path / "o")
    lines = run("export", folder, *arguments).stdout.splitlines()
    assert len(lines) == len(NAMES) + 1
    assert all(Path(line).is_file() for line in lines)


def test_info_is_a_table_or_json(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    text = run("info", folder).stdout
    assert "geometric" in text
    assert "5 (80 x 60 px)" in text
    facts = json.loads(run("info", folder, "--json").stdout)
    assert facts["num_views"] == 5
    assert not (folder / "resdepth").exists()


def test_the_log_is_not_on_stdout(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    (folder / f"stereo/depth_maps/{NAMES[0]}.geometric.bin").unlink()
    result = refine(folder, "--stereo", "existing", "--no-fuse", "--no-pictures")
    assert "1 skipped, no depth map" in result.stderr
    assert "skipped, no depth map" not in result.stdout


def test_quiet_stands_before_or_after_the_command(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    (folder / f"stereo/depth_maps/{NAMES[0]}.geometric.bin").unlink()
    weights = identity_weights(tmp_path)
    rest = (
        folder,
        "--weights",
        weights,
        "--no-fuse",
        "--no-pictures",
        "--overwrite",
        "--stereo",
        "existing",
    )
    assert run("refine", *rest).stderr
    assert run("-qq", "refine", *rest).stderr == ""
    assert run("refine", *rest, "-qq").stderr == ""
    assert run("-q", "refine", *rest, "-q").stderr == ""


def test_stereo_keeps_maps_that_are_there(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric", "geometric"))
    path = folder / "stereo/depth_maps/3.png.photometric.bin"
    before = path.stat().st_mtime_ns
    text = run("stereo", folder).stdout
    assert "matched   0 images" in text
    assert "kept      5 images" in text
    assert path.stat().st_mtime_ns == before
