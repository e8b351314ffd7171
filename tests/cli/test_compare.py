"""The command `compare`: its tables, its JSON, what it refuses, and its exit codes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from compared_workspaces import compared_workspace, exact, with_hole
from laser_scans import room_scan, write_scene
from planes import plane_views

from resdepth_colmap.cli.main import main
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace

ALL_VIEWS = ("--min-num-views", "1")


pytestmark = pytest.mark.slow  # each fuses, twice


def compare(*arguments: object, exit_code: int = 0) -> Result:
    words = ["compare", *(str(word) for word in arguments)]
    result = CliRunner().invoke(main, words, prog_name="resdepth-colmap")
    assert result.exit_code == exit_code, result.output
    return result


def measured(path: Path, *arguments: object) -> dict[str, Any]:
    report = json.loads(compare(path, "--json", *arguments).stdout)
    found: dict[str, Any] = report["workspaces"][path.name]
    return found


def contents(path: Path) -> dict[str, bytes]:
    files = (file for file in path.rglob("*") if file.is_file())
    return {str(file): file.read_bytes() for file in files}


def test_maps_equal_to_the_truth_score_100(tmp_path: Path) -> None:
    found = measured(compared_workspace(tmp_path / "scene"), *ALL_VIEWS)
    scores = found["clouds"]["open3d"]["refined"]["scores"]
    for name in ("accuracy", "completeness", "f1"):
        assert scores[name] == pytest.approx([1, 1], abs=1e-6)
    assert found["measures"]["refined"]["right_1"] == 1
    assert found["measures"]["refined"]["coverage"] == 1


def test_a_hole_lowers_coverage_and_completeness_not_accuracy(tmp_path: Path) -> None:
    found = measured(compared_workspace(tmp_path / "scene"), *ALL_VIEWS)
    for fuser in ("open3d", "colmap"):
        whole = found["clouds"][fuser]["refined"]["scores"]
        holed = found["clouds"][fuser]["filtered"]["scores"]
        pairs = zip(holed["accuracy"], whole["accuracy"], strict=True)
        assert all(with_holes >= without - 0.01 for with_holes, without in pairs)
        assert holed["completeness"][0] < whole["completeness"][0] - 0.05
    means = found["measures"]
    assert means["filtered"]["coverage"] == pytest.approx(2 / 3)
    assert means["filtered"]["right_1"] == pytest.approx(2 / 3)
    assert means["filtered"]["right_1_common"] == 1
    assert means["filtered"]["consistent"] < means["refined"]["consistent"]


def test_wrong_depth_is_seen_by_every_measure_but_coverage(tmp_path: Path) -> None:
    found = measured(compared_workspace(tmp_path / "scene", filtered=None))
    right, wrong = found["measures"]["refined"], found["measures"]["unfiltered"]
    assert right["coverage"] == wrong["coverage"] == 1
    for name in set(right) - {"coverage"}:
        assert right[name] > wrong[name], name
    paired = found["paired"]["refined - unfiltered"]
    assert paired["right_1"]["views"]["mean"] == pytest.approx(0.5)
    assert paired["right_1"]["views"]["num_better"] == 5
    # The tiles are 64 px and the rest: of a view 80 px wide, the right one was right.
    assert paired["right_1"]["tiles"]["num_better"] == 5
    assert any(note.startswith("filtered: ") for note in found["notes"])


def test_the_same_maps_by_two_methods_do_not_differ(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", unfiltered=exact, filtered=None)
    found = measured(scene)
    assert found["methods"]["unfiltered"]["kind"] == "photometric"
    for paired in found["paired"]["refined - unfiltered"].values():
        assert paired["views"]["num_pairs"] == 5
        assert paired["views"]["mean"] == paired["views"]["median"] == 0
        assert paired["views"]["interval"] == [0, 0]
        assert paired["views"]["num_better"] == paired["views"]["num_worse"] == 0
        assert paired["tiles"]["num_better"] == paired["tiles"]["num_worse"] == 0
    clouds = found["clouds"]["open3d"]
    assert clouds["refined"]["scores"] == clouds["unfiltered"]["scores"]


def test_nothing_of_the_workspace_is_touched(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene")
    before = contents(scene)
    compare(scene)
    assert contents(scene) == before


def test_tables_settings_and_methods_are_printed(tmp_path: Path) -> None:
    output = tmp_path / "new" / "compare.json"
    scene = compared_workspace(tmp_path / "scene")
    result = compare(scene, "--min-num-views", 2, "--output", output)
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["workspace", "scene", "(5", "views", "compared)"]
    assert any("min_num_views 2" in line for line in lines)
    assert any("min_num_pixels 2" in line for line in lines)
    assert any(line.split()[:2] == ["filtered", "geometric"] for line in lines)
    assert "refined - unfiltered, view by view" in result.stdout
    report = json.loads(output.read_text("utf-8"))
    assert report["command"] == "resdepth-colmap compare scene --min-num-views 2"
    assert report["options"]["fuse"]["min_num_views"] == 2
    assert str(tmp_path) not in output.read_text("utf-8")


def test_tolerances_are_in_units_of_the_workspace(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", unfiltered=None)
    found = measured(scene, *ALL_VIEWS, "--tolerances", "0.5,0.1")
    assert found["clouds"]["open3d"]["filtered"]["scores"]["tolerances"] == [0.1, 0.5]
    assert any(note.startswith("unfiltered: ") for note in found["notes"])


def test_the_kinds_of_the_methods_can_be_given(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", unfiltered=with_hole)
    found = measured(scene)
    assert set(found["methods"]) == {"filtered", "refined"}
    assert found["methods"]["filtered"]["kind"] == "geometric"
    found = measured(scene, "--unfiltered", "photometric")
    assert found["methods"]["unfiltered"]["kind"] == "photometric"
    result = compare(scene, "--filtered", "other", exit_code=1)
    assert "no other map" in result.stderr
    assert "geometric, photometric" in result.stderr


def test_without_truth_no_score_and_no_accuracy_is_claimed(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", truth=None)
    found = measured(scene)
    assert found["truth"] is None
    assert all(
        method["scores"] is None for method in found["clouds"]["open3d"].values()
    )
    assert found["measures"]["refined"]["right_1"] is None
    assert found["measures"]["refined"]["points_odd"] == 1
    assert found["measures"]["unfiltered"]["points_odd"] < 0.8
    assert any("none of them is an accuracy" in note for note in found["notes"])
    assert "accuracy" not in " ".join(json.dumps(found["measures"]).split())


def test_without_sparse_points_colmap_is_left_out_with_a_word(tmp_path: Path) -> None:
    found = measured(compared_workspace(tmp_path / "scene", num_points=0))
    for cloud in found["clouds"]["colmap"].values():
        assert cloud["num_points"] is None
        assert "would give no point" in cloud["note"]
    assert found["measures"]["refined"]["points_even"] is None
    assert found["clouds"]["open3d"]["refined"]["num_points"] > 0


def test_an_empty_fusion_scores_0_with_a_word(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)

    def noise(depth: Any) -> Any:
        return rng.uniform(50, 900, depth.shape).astype(np.float32)

    scene = compared_workspace(tmp_path / "scene", unfiltered=noise)
    found = measured(scene, "--min-num-views", 4, "--max-depth-error", 0.001)
    for fuser in ("open3d", "colmap"):
        cloud = found["clouds"][fuser]["unfiltered"]
        assert cloud["num_points"] == 0
        assert "no point survived" in cloud["note"]
        assert cloud["scores"]["f1"] == [0, 0]
        assert found["clouds"][fuser]["refined"]["num_points"] > 0


def test_truth_in_other_units_is_said(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", truth=1000)
    result = compare(scene)
    assert "0.001 times the true depth" in result.stdout
    assert "other units" in result.stdout


def test_clouds_are_scored_against_laser_scans(tmp_path: Path) -> None:
    write_scene(tmp_path, [room_scan(num_rows=20)])
    scene = compared_workspace(tmp_path / "scene", truth=None)
    truth = tmp_path / "scan_alignment.mlp"
    found = measured(scene, "--ground-truth", truth, "--tolerances", "0.02")
    assert found["truth"]["kind"] == "laser scans"
    assert found["clouds"]["open3d"]["refined"]["scores"]["tolerances"] == [0.02]
    result = compare(scene, "--ground-truth", "gone.mlp", exit_code=1)
    assert "gone.mlp: cannot be read" in result.stderr


def test_a_broken_workspace_does_not_stop_the_others(tmp_path: Path) -> None:
    good = compared_workspace(tmp_path / "good", unfiltered=None)
    unrefined = compared_workspace(tmp_path / "unrefined", refined=None)
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    result = compare(nothing, good, unrefined, exit_code=1)
    errors = result.stderr.splitlines()
    assert len(errors) == 2
    assert errors[0].startswith(f"Error: nothing: {nothing}: not a COLMAP dense")
    assert "no refined map; run `resdepth-colmap refine" in errors[1]
    assert "5 views compared" in result.stdout
    assert result.stdout.splitlines()[-1] == (
        "2 of 3 workspaces failed: nothing, unrefined"
    )
    report = json.loads(compare(nothing, good, "--json", exit_code=1).stdout)
    assert set(report["workspaces"]) == {"good"}
    assert set(report["failed"]) == {"nothing"}


def test_a_workspace_without_initial_maps_is_refused(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene", filtered=None, unfiltered=None)
    result = compare(scene, exit_code=1)
    assert "nothing to compare the refined maps with" in result.stderr
    assert result.stderr.count("\n") == 1


def test_wrong_usage_has_exit_code_2(tmp_path: Path) -> None:
    assert "--tolerances" in compare(tmp_path, "--tolerances", "a", exit_code=2).stderr
    compare(exit_code=2)
    result = compare(tmp_path, "--tolerances", "-1", exit_code=1)
    assert "expected increasing distances above 0" in result.stderr


def test_low_confidence_counts_as_no_depth(tmp_path: Path) -> None:
    scene = compared_workspace(tmp_path / "scene")
    output = OutputWorkspace(source=open_workspace(scene))
    for view in plane_views():
        sure = np.zeros(view.depth.shape, np.float32)
        sure[:30] = 0.9
        output.write_maps(view.view.name, view.depth, view.normals, sure)
    found = measured(scene, "--min-confidence", 0.5)
    assert found["measures"]["refined"]["coverage"] == pytest.approx(0.5)
