"""The command `report`, and the report that `refine` writes."""

import json
from pathlib import Path

from click.testing import CliRunner, Result
from report_workspaces import refined_workspace
from workspaces import identity_weights, plane_folder

from resdepth_colmap.cli.main import main


def run(*arguments: object, exit_code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == exit_code, result.output
    return result


def test_report_prints_the_page_it_wrote(tmp_path: Path) -> None:
    folder = refined_workspace(tmp_path / "scene")
    path = run("report", folder).stdout.strip()
    assert path == str(folder / "resdepth/report.html")
    assert Path(path).is_file()


def test_report_before_refine_is_one_line(tmp_path: Path) -> None:
    result = run("report", plane_folder(tmp_path), exit_code=1)
    (line,) = result.stderr.splitlines()
    assert line.startswith("Error: ") and "run `resdepth-colmap refine" in line


def test_refine_writes_the_report_and_its_time(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path)
    options = ("refine", folder, "--weights", weights, "--no-pictures")
    assert "report.html" not in run(*options, "--no-fuse", "--no-report").stdout
    assert not (folder / "resdepth/report.html").exists()
    assert str(folder / "resdepth/report.html") in run(*options).stdout
    page = (folder / "resdepth/report.html").read_text(encoding="utf-8")
    assert 'id="cloud-before-points"' in page and 'id="cloud-after-points"' in page
    record = json.loads((folder / "resdepth/run.json").read_text(encoding="utf-8"))
    assert record["seconds"]["report"] > 0
    assert record["fuse_before"]["num_points"] > 0


def test_maps_refined_in_place_are_reported(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path)
    run("refine", folder, "--weights", weights, "--in-place", "--no-pictures")
    assert (folder / "resdepth/report.html").is_file()
    assert run("report", folder).exit_code == 0


def test_a_fusion_without_points_still_leaves_a_report(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path)
    options = ("--weights", weights, "--no-pictures", "--max-reproj-error", "1e-9")
    result = run("refine", folder, *options, exit_code=1)
    assert "no point survived" in result.stderr
    assert (folder / "resdepth/report.html").is_file()
