"""Laws of comparing depth maps with the truth, scene by scene."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from stereo_pairs import (
    NUM_UNSEEN_COLUMNS,
    TRUTH_NAME,
    write_as_distributed,
    write_stereo_pair,
)
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError
from resdepth_colmap.evaluation.datasets.sample import InitialDepth
from resdepth_colmap.evaluation.datasets.scenes import scene_sources
from resdepth_colmap.evaluation.depth import sample_matching as sample_matching
from resdepth_colmap.evaluation.depth.evaluation import (
    EvaluationOptions,
    evaluate_scenes,
)
from resdepth_colmap.evaluation.depth.match_cache import MatchCache
from resdepth_colmap.evaluation.depth.result import DepthReport, SceneResult
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.network.weights import weights_hash
from resdepth_colmap.scene import DepthMap

FAST = StereoConfig(num_iterations=3, window_radius=3)


def options(tmp_path: Path, cache: MatchCache | None = None) -> EvaluationOptions:
    weights = identity_weights(tmp_path)
    refine = RefineConfig(inner_iterations=2, weights=weights)
    return EvaluationOptions(refine=refine, stereo=FAST, cache=cache)


def evaluated(tmp_path: Path, *paths: Path) -> DepthReport:
    return evaluate_scenes(scene_sources(paths), options(tmp_path))


def test_a_textured_plane_is_matched_and_the_identity_changes_nothing(
    tmp_path: Path,
) -> None:
    write_stereo_pair(tmp_path / "Plane")
    (scene,) = evaluated(tmp_path, tmp_path / "Plane").scenes
    mapping = scene.to_mapping()
    assert mapping["initial"] == ["our PatchMatch (CPU)"]
    assert mapping["unfiltered_seen_by_both"]["median_relative_error"] < 0.005
    assert mapping["mae_ratio"] == pytest.approx(1, rel=1e-3)
    assert mapping["matching_cpu_s_per_mp"] > 0 and mapping["refining_cpu_s_per_mp"] > 0


def test_the_record_is_plain_and_names_what_was_measured_with(tmp_path: Path) -> None:
    write_stereo_pair(tmp_path / "Plane")
    record = evaluated(tmp_path, tmp_path).to_mapping()
    text = json.dumps(record, allow_nan=False)
    assert str(tmp_path) not in text
    assert json.loads(text) == record
    assert record["weights_sha256"] == weights_hash(identity_weights(tmp_path))
    assert record["options"]["refine"]["inner_iterations"] == 2
    assert record["options"]["stereo"]["num_iterations"] == FAST.num_iterations
    assert record["mean"]["mae_ratio"] == record["scenes"]["Plane"]["mae_ratio"]
    assert record["overall"]["refined"] == record["scenes"]["Plane"]["refined"]


def test_maps_that_are_there_are_taken_and_named(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric",))
    write_truth(folder, NAMES[:2])
    (scene,) = evaluated(tmp_path, folder).scenes
    mapping = scene.to_mapping()
    assert mapping["initial"] == ["photometric maps in stereo/"]
    assert mapping["num_views"] == 2 and set(mapping["views"]) == set(NAMES[:2])
    assert mapping["unfiltered"]["mae"] == 0
    assert mapping["matching_cpu_s_per_mp"] is None
    assert "unfiltered_seen_by_both" not in mapping


def test_nothing_in_a_workspace_is_changed(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    write_truth(folder, NAMES[:1])
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    evaluated(tmp_path, folder)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def write_truth(folder: Path, names: tuple[str, ...]) -> None:
    from planes import plane_views

    for view in plane_views():
        if view.view.name in names:
            path = folder / "ground_truth" / f"{view.view.name}.bin"
            write_depth_map(path, view.depth)


def result_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, depth: DepthMap
) -> SceneResult:
    """The result of a matcher that finds that depth."""
    found = InitialDepth(depth=depth, origin="the test", cpu_s=0.48)
    monkeypatch.setattr(
        "resdepth_colmap.evaluation.depth.evaluation.initial_depth",
        lambda *_: found,
    )
    (scene,) = evaluated(tmp_path, tmp_path / "Plane").scenes
    return scene


def test_what_only_one_view_sees_does_not_count_against_the_matcher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    depth = write_stereo_pair(tmp_path / "Plane").copy()
    depth[:, :NUM_UNSEEN_COLUMNS] += np.float32(0.5)
    mapping = result_of(tmp_path, monkeypatch, depth).to_mapping()
    share = NUM_UNSEEN_COLUMNS / 80
    assert mapping["unfiltered"]["bad_2"] == pytest.approx(share)
    assert mapping["unfiltered"]["mae"] == pytest.approx(0.5 * share, rel=1e-4)
    seen = mapping["unfiltered_seen_by_both"]
    assert seen["bad_1"] == seen["mae"] == seen["median_relative_error"] == 0
    assert mapping["matching_cpu_s_per_mp"] == pytest.approx(100)


def test_residuals_beyond_ten_metres_are_discarded_but_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    depth = write_stereo_pair(tmp_path / "Plane").copy()
    depth[:, :8] += np.float32(11)
    errors = result_of(tmp_path, monkeypatch, depth).to_mapping()["unfiltered"]
    assert errors["mae"] == 0 and errors["num_valid"] == 60 * 72
    assert errors["bad_2"] == errors["bad_5cm"] == pytest.approx(0.1)


def test_a_perfect_start_has_no_ratio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = result_of(tmp_path, monkeypatch, write_stereo_pair(tmp_path / "Plane"))
    assert math.isnan(scene.ratio("mae"))
    assert scene.to_mapping()["mae_ratio"] is None


def test_what_was_matched_is_not_matched_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_stereo_pair(tmp_path / "Plane")
    chosen = options(tmp_path, MatchCache(folder=tmp_path / "cache"))
    sources = scene_sources([tmp_path / "Plane"])
    first = evaluate_scenes(sources, chosen).to_mapping()["scenes"]["Plane"]
    monkeypatch.delattr(sample_matching, "match_view")
    again = evaluate_scenes(sources, chosen).to_mapping()["scenes"]["Plane"]
    assert again["unfiltered"] == first["unfiltered"]
    assert again["matching_cpu_s_per_mp"] == first["matching_cpu_s_per_mp"]


def test_a_broken_scene_stops_no_other(tmp_path: Path) -> None:
    for name in ("A", "B"):
        write_as_distributed(tmp_path / "scenes" / name)
    write_stereo_pair(tmp_path / "scenes" / "C")
    truth = tmp_path / "scenes" / "C" / TRUTH_NAME
    truth.write_bytes(truth.read_bytes()[:-1])
    failures: list[tuple[str, str]] = []
    report = evaluate_scenes(
        scene_sources([tmp_path / "scenes"]),
        options(tmp_path),
        lambda name, reason: failures.append((name, reason)),
    )
    assert [scene.name for scene in report.scenes] == ["A", "B"]
    assert dict(report.failed) == dict(failures)
    assert "19208 bytes, but the file has 19207" in report.failed["C"]
    overall = report.to_mapping()["overall"]["unfiltered"]
    assert overall["num_pixels"] == 2 * 59 * 80


def test_a_matcher_that_fails_or_finds_nothing_is_a_broken_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("A", "B", "C"):
        write_stereo_pair(tmp_path / "scenes" / name)
    depth = np.ones((60, 80), np.float32)

    def find(scene: str, *_: object) -> InitialDepth:
        if scene == "A":
            raise BackendUnavailableError("out of memory")
        return InitialDepth(depth=depth * (scene == "C"), origin="the test")

    monkeypatch.setattr(
        "resdepth_colmap.evaluation.depth.evaluation.initial_depth", find
    )
    report = evaluated(tmp_path, tmp_path / "scenes")
    assert [scene.name for scene in report.scenes] == ["C"]
    assert report.failed["A"] == "out of memory"
    assert report.failed["B"] == "im0.png: no pixel has an initial depth."


def test_scenes_of_one_name_are_told_apart(tmp_path: Path) -> None:
    paths = [tmp_path / parent / "Plane" for parent in ("a", "b")]
    for path in (*paths, tmp_path / "a" / "Other"):
        (path / "ground_truth").mkdir(parents=True)
    assert [s.name for s in scene_sources(paths)] == ["a/Plane", "b/Plane"]
    assert [s.name for s in scene_sources([tmp_path / "a"])] == ["Other", "Plane"]
    assert len(scene_sources([paths[0], paths[0], paths[0].parent])) == 2
