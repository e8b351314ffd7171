"""Laws of measuring on the Middlebury scenes."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from stereo_pairs import NUM_UNSEEN_COLUMNS, write_stereo_pair
from workspaces import identity_weights

from resdepth_colmap.config import RefineConfig, StereoConfig
from resdepth_colmap.evaluation import middlebury
from resdepth_colmap.evaluation.match_cache import MatchCache, Matching
from resdepth_colmap.evaluation.middlebury import (
    MiddleburyReport,
    SceneResult,
    match_pair,
    measure_middlebury,
    measure_pair,
)
from resdepth_colmap.evaluation.stereo_pair import read_pair
from resdepth_colmap.network.weights import load_weights, weights_hash

FAST = StereoConfig(num_iterations=3, window_radius=3)


def measured(tmp_path: Path) -> MiddleburyReport:
    write_stereo_pair(tmp_path / "scenes" / "Plane")
    config = RefineConfig(passes=2, weights=identity_weights(tmp_path))
    return measure_middlebury(tmp_path / "scenes", config, FAST)


def test_a_textured_plane_is_matched_and_the_identity_changes_nothing(
    tmp_path: Path,
) -> None:
    report = measured(tmp_path)
    (scene,) = report.scenes
    assert scene.name == "Plane"
    assert scene.seen_median_relative_error < 0.005
    assert scene.refined.mae == pytest.approx(scene.unfiltered.mae, rel=1e-4)
    assert scene.mae_ratio == pytest.approx(1, rel=1e-4)
    assert scene.matching_cpu_s_per_mp > 0 and scene.refining_cpu_s_per_mp > 0


def test_the_record_is_plain_and_names_what_was_measured_with(tmp_path: Path) -> None:
    record = measured(tmp_path).to_mapping()
    text = json.dumps(record, allow_nan=False)
    assert str(tmp_path) not in text
    assert json.loads(text) == record
    assert record["weights_sha256"] == weights_hash(identity_weights(tmp_path))
    assert record["options"]["refine"]["passes"] == 2
    assert record["options"]["stereo"]["num_iterations"] == FAST.num_iterations
    assert record["mean"]["mae_ratio"] == record["scenes"]["Plane"]["mae_ratio"]


def result_of_error(tmp_path: Path, error: float, columns: slice) -> SceneResult:
    truth = write_stereo_pair(tmp_path / "Plane")
    depth = truth.copy()
    depth[:, columns] += np.float32(error)
    pair = read_pair(tmp_path / "Plane")
    matching = Matching(depth=depth, cpu_s=0.48)
    network = load_weights(identity_weights(tmp_path))
    return measure_pair(pair, matching, network, RefineConfig())


def test_what_only_one_view_sees_does_not_count_against_the_matcher(
    tmp_path: Path,
) -> None:
    scene = result_of_error(tmp_path, 0.5, slice(0, NUM_UNSEEN_COLUMNS))
    share = NUM_UNSEEN_COLUMNS / 80
    assert scene.unfiltered.bad_2 == pytest.approx(share)
    assert scene.unfiltered.mae == pytest.approx(0.5 * share, rel=1e-4)
    assert scene.seen.bad_1 == scene.seen.mae == scene.seen_median_relative_error == 0
    assert scene.matching_cpu_s_per_mp == pytest.approx(100)


def test_residuals_beyond_ten_metres_are_discarded_but_off(tmp_path: Path) -> None:
    scene = result_of_error(tmp_path, 11, slice(0, 8))
    assert scene.unfiltered.mae == 0
    assert scene.unfiltered.num_valid == 60 * 72
    assert scene.unfiltered.bad_2 == pytest.approx(0.1)


def test_a_perfect_start_has_no_ratio(tmp_path: Path) -> None:
    scene = result_of_error(tmp_path, 0, slice(None))
    assert math.isnan(scene.mae_ratio)
    assert scene.to_mapping()["mae_ratio"] is None


def test_what_was_matched_is_not_matched_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_stereo_pair(tmp_path / "Plane")
    pair, cache = read_pair(tmp_path / "Plane"), MatchCache(folder=tmp_path / "cache")
    first = match_pair(pair, FAST, cache)
    monkeypatch.delattr(middlebury, "match_view")
    again = match_pair(pair, FAST, cache)
    assert np.array_equal(again.depth, first.depth) and again.cpu_s == first.cpu_s
