"""The command `evaluate depth`: its tables, its JSON, its exit codes."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from stereo_pairs import write_as_distributed, write_stereo_pair
from workspaces import identity_weights

from resdepth_colmap.cli.main import main
from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.evaluation.markdown import table
from resdepth_colmap.versions import hardware
from scripts.benchmarks.tables.depth import SCENES, scene_rows

FAST = ("--num-iterations", "2", "--window-radius", "3")


def evaluate(tmp_path: Path, *arguments: object) -> Result:
    weights = ["--weights", identity_weights(tmp_path), *FAST]
    words = ["evaluate", "depth", *arguments, *weights]
    return CliRunner().invoke(
        main, [str(word) for word in words], prog_name="resdepth-colmap"
    )


def test_each_scene_has_its_rows_and_the_origin_is_said(tmp_path: Path) -> None:
    write_stereo_pair(tmp_path / "scenes" / "One")
    write_as_distributed(tmp_path / "scenes" / "Two")
    result = evaluate(tmp_path, tmp_path / "scenes")
    assert result.exit_code == 0, result.output
    for name in ("One", "Two", "**overall**"):
        for depth in ("unfiltered", "5 x 5 median", "refined"):
            assert result.stdout.count(f"| {name} | {depth} |") == 2
    assert "Unfiltered depth: our PatchMatch (CPU)." in result.stdout
    tables = [line.count("|") for line in result.stdout.splitlines() if "|" in line]
    assert sorted(set(tables)) == [10, 11]


def test_the_json_is_what_the_tables_of_the_documents_are_made_of(
    tmp_path: Path,
) -> None:
    write_stereo_pair(tmp_path / "One")
    output, cache = tmp_path / "depth.json", tmp_path / "cache"
    options = ("--json", "--passes", 2, "--no-update-gating", "--cache", cache)
    result = evaluate(tmp_path, tmp_path / "One", "--output", output, *options)
    measured = json.loads(result.stdout)
    assert measured == json.loads(output.read_text())
    assert measured["command"] == (
        "resdepth-colmap evaluate depth One --passes 2 --no-update-gating --weights "
        f"{identity_weights(tmp_path).name} --window-radius 3 --num-iterations 2"
    )
    assert measured["options"]["refine"]["update_gating"] is False
    assert measured["options"]["max_residual"] == PAPER_MAX_RESIDUAL
    assert measured["hardware"] == hardware()
    assert "| One | " in table(SCENES, scene_rows(measured))
    assert len(list(cache.iterdir())) == 1


def test_a_broken_scene_is_one_line_and_exit_code_1(tmp_path: Path) -> None:
    write_as_distributed(tmp_path / "Good")
    write_stereo_pair(tmp_path / "Bad")
    shutil.rmtree(tmp_path / "Bad/ground_truth")
    result = evaluate(tmp_path, tmp_path / "Bad", tmp_path / "Good")
    assert result.exit_code == 1
    (line,) = [line for line in result.stderr.splitlines() if line.strip()]
    assert line.startswith("Error: Bad: ") and "no ground_truth/" in line
    assert "| Good | refined |" in result.stdout
    assert result.stdout.rstrip().endswith("1 of 2 scenes failed: Bad")


def test_a_json_of_a_broken_scene_is_sound_all_the_same(tmp_path: Path) -> None:
    result = evaluate(tmp_path, tmp_path / "nowhere", "--json")
    assert result.exit_code == 1
    measured = json.loads(result.stdout)
    assert measured["scenes"] == {} and measured["overall"] is None
    assert "no such folder" in measured["failed"]["nowhere"]


@pytest.mark.parametrize(
    ("arguments", "exit_code"),
    [((), 2), (("x", "--max-residual", "-1"), 2), (("x", "--passes", "0"), 1)],
)
def test_wrong_usage_is_refused(
    tmp_path: Path, arguments: tuple[str, ...], exit_code: int
) -> None:
    assert evaluate(tmp_path, *arguments).exit_code == exit_code
