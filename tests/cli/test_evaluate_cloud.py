"""The command on files: what it prints, writes and refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from laser_scans import in_world, project, room_scan, write_ply, write_scene

from resdepth_colmap.cli.main import main


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scan, its alignment and the same points as a cloud."""
    folder = tmp_path_factory.mktemp("scene")
    scan = room_scan(num_rows=30)
    write_scene(folder, [scan])
    write_ply(folder / "cloud.ply", in_world(scan))
    write_ply(folder / "empty.ply", [])
    return folder


def evaluate(
    scene: Path, *arguments: object, cloud: str = "cloud.ply", exit_code: int = 0
) -> Result:
    command = ["evaluate", "cloud", scene / cloud]
    command += ["--ground-truth", scene / "scan_alignment.mlp", *arguments]
    result = CliRunner().invoke(main, [str(word) for word in command])
    assert result.exit_code == exit_code, result.output
    return result


def test_a_table_has_a_row_a_tolerance(scene: Path) -> None:
    lines = evaluate(scene).stdout.splitlines()
    assert lines[0].split() == ["cloud", "1,800", "points"]
    rows = [line.split() for line in lines if "100.00 %" in line]
    assert [row[1] for row in rows] == ["0.01", "0.02", "0.05", "0.1", "0.2", "0.5"]
    assert all(row.count("100.00") == 3 for row in rows)


def test_json_is_printed_or_written(scene: Path, tmp_path: Path) -> None:
    output = tmp_path / "new" / "scores.json"
    arguments = ("--tolerances", "0.1, 0.05", "--voxel_size", 0.02)
    printed = json.loads(evaluate(scene, "--json", *arguments).stdout)
    assert printed["tolerances"] == [0.05, 0.1]
    assert printed["accuracy"] == printed["completeness"] == printed["f1"] == [1, 1]
    assert printed["options"]["voxel_size"] == 0.02
    assert printed["num_points"] == 1800
    result = evaluate(scene, "--output", output, *arguments)
    assert "100.00 %" in result.stdout
    assert json.loads(output.read_text("utf-8")) == printed


def test_an_empty_cloud_scores_0(scene: Path) -> None:
    result = evaluate(scene, "--json", cloud="empty.ply")
    assert set(json.loads(result.stdout)["f1"]) == {0}
    assert "the cloud has no point" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--tolerances", "0"), "tolerances=(0.0,) but expected one or more"),
        (("--tolerances", ""), "tolerances=() but expected one or more"),
        (("--tolerances", "0.1,-0.2"), "expected one or more distances above 0"),
        (("--voxel-size", "-1"), "voxel_size=-1.0 but expected a length above 0"),
        (("--ground-truth", "gone.mlp"), "gone.mlp: cannot be read"),
    ],
)
def test_bad_options_are_one_line(
    scene: Path, arguments: tuple[str, str], text: str
) -> None:
    result = evaluate(scene, *arguments, exit_code=1)
    assert text in result.stderr
    assert result.stderr.count("\n") == 1


def test_wrong_usage_has_exit_code_2(scene: Path) -> None:
    result = evaluate(scene, "--tolerances", "a,b", exit_code=2)
    assert "Invalid value for '--tolerances'" in result.stderr
    command = ["evaluate", "cloud", str(scene / "cloud.ply")]
    assert CliRunner().invoke(main, command).exit_code == 2


def test_broken_files_are_one_line_with_their_name(scene: Path, tmp_path: Path) -> None:
    whole = (scene / "cloud.ply").read_bytes()
    (scene / "truncated.ply").write_bytes(whole[:500])
    for cloud in ("truncated.ply", "gone.ply", "scan_alignment.mlp"):
        result = evaluate(scene, cloud=cloud, exit_code=1)
        assert str(scene / cloud) in result.stderr
        assert result.stderr.count("\n") == 1


def test_scans_without_a_point_are_refused(scene: Path) -> None:
    identity = " ".join(map(str, np.eye(4).ravel().tolist()))
    mesh = f'<MLMesh filename="empty.ply"><MLMatrix44>{identity}</MLMatrix44></MLMesh>'
    (scene / "empty.mlp").write_text(project(mesh), encoding="utf-8")
    result = evaluate(scene, "--ground-truth", scene / "empty.mlp", exit_code=1)
    assert "empty.mlp: its scans have no point" in result.stderr
