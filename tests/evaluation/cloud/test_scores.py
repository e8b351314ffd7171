"""Laws of the cloud scores, and what ETH3D's own program says."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from laser_scans import ROOM_M, Points, in_world, pose, room_scan
from scipy.spatial.transform import Rotation

from resdepth_colmap.errors import ConfigError
from resdepth_colmap.evaluation.cloud import laser_scan, point_shares
from resdepth_colmap.evaluation.cloud.config import CloudConfig
from resdepth_colmap.evaluation.cloud.laser_truth import score_cloud_file
from resdepth_colmap.evaluation.cloud.scores import (
    CloudScores,
    PlacedScan,
    cloud_scores,
)

OFFICIAL_CASES = ("exact", "noisy", "floaters", "two_scans")
ALL_RIGHT = (1.0,) * len(CloudConfig().tolerances)
ALL_WRONG = (0.0,) * len(CloudConfig().tolerances)


def score(points: object, *scans: PlacedScan, **options: object) -> CloudScores:
    cloud = np.asarray(points, np.float32).reshape(-1, 3)
    return cloud_scores(cloud, scans or (room_scan(),), CloudConfig(**options))  # type: ignore[arg-type]


def towards(scan: PlacedScan, factor: npt.NDArray[np.float64] | float) -> Points:
    """The points of the scan, moved along their beams, which they stay in."""
    origin = scan.world_from_scan[:3, 3]
    return (origin + factor * (in_world(scan) - origin)).astype(np.float32)


def noisy(scan: PlacedScan, sigma_m: float = 0.02) -> Points:
    rng = np.random.default_rng(0)
    distances = np.linalg.norm(scan.points, axis=1, keepdims=True)
    return towards(scan, 1 + rng.normal(0, sigma_m, distances.shape) / distances)


@pytest.mark.parametrize("sample", OFFICIAL_CASES)
def test_scores_are_those_of_the_official_program(
    shared_data: Callable[[str], Path], sample: str
) -> None:
    folder = shared_data("eth3d_cloud_cases") / sample
    scores = score_cloud_file(
        folder / "reconstruction.ply", folder / "scan_alignment.mlp", CloudConfig()
    )
    official = json.loads((folder / "official.json").read_text())
    assert scores.tolerances == tuple(official["tolerances"])
    for name in ("accuracy", "completeness", "f1"):
        # It prints six digits; the aim is 1e-3.
        np.testing.assert_allclose(getattr(scores, name), official[name], atol=2e-6)


@pytest.mark.parametrize("turn_deg", [(0, 0, 0), (140, 30, -70)])
def test_the_scan_itself_is_complete_and_accurate(
    turn_deg: tuple[float, float, float],
) -> None:
    scan = room_scan(turn_deg=turn_deg)
    scores = score(in_world(scan), scan)
    assert scores.accuracy == scores.completeness == scores.f1 == ALL_RIGHT
    assert scores.num_points == scores.num_scan_points == len(scan.points)


def test_a_point_in_front_of_the_wall_is_inaccurate_until_the_tolerance() -> None:
    scan = room_scan()
    distances = np.linalg.norm(scan.points, axis=1)
    near = towards(scan, 0.7)[(distances > 1.7) & (distances < 2.6)]
    scores = score(near, scan)  # 0.5 to 0.8 m before the wall
    assert scores.accuracy[:5] == ALL_WRONG[:5]
    assert score(near, scan, tolerances=(0.1, 0.9)).accuracy == (0.0, 1.0)


def test_points_behind_the_wall_are_unobserved_and_change_nothing() -> None:
    scan = room_scan()
    cloud = noisy(scan)
    behind = towards(scan, 1.6)
    alone = score(behind, scan, tolerances=(0.01, 0.02, 0.05))
    assert alone.accuracy == alone.completeness == (0.0,) * 3
    both = score(np.concatenate([cloud, behind]), scan, tolerances=(0.01, 0.02, 0.05))
    before = score(cloud, scan, tolerances=(0.01, 0.02, 0.05))
    assert both.accuracy == before.accuracy
    assert both.completeness == before.completeness


def test_what_no_beam_has_met_does_not_count() -> None:
    scan = room_scan()
    half = PlacedScan(
        points=scan.points[scan.points[:, 0] > 0.5],
        world_from_scan=scan.world_from_scan,
    )
    other_side = scan.points[:, 0] < -0.5
    rubbish = towards(scan, 0.5)[other_side]
    before = score(in_world(half), half)
    after = score(np.concatenate([in_world(half), rubbish]), half)
    assert after.accuracy == before.accuracy == ALL_RIGHT


def test_accurate_in_one_scan_wins_over_inaccurate_in_another() -> None:
    first, second = room_scan(), room_scan(position=(3.1, 2.2, 1.5))
    # A board that stands before the wall, and that the second scan alone has seen.
    to_wall = second.world_from_scan[:3, :3].T @ (np.array([0, 1.6, 1.3]) - (3.1, 2, 1))
    to_wall = (to_wall / np.linalg.norm(to_wall)).astype(np.float32)
    spread = np.random.default_rng(0).normal(0, 0.01, (200, 3)).astype(np.float32)
    with_board = PlacedScan(
        points=np.concatenate([second.points, 0.8 * to_wall + spread]),
        world_from_scan=second.world_from_scan,
    )
    board = in_world(with_board)[-200:]
    assert score(board, first).accuracy[0] == 0
    assert score(board, first, with_board).accuracy == ALL_RIGHT
    assert score(board, with_board, first).accuracy == ALL_RIGHT


def test_free_space_of_one_scan_is_not_mended_by_a_scan_that_saw_nothing() -> None:
    scan = room_scan()
    sees_little = PlacedScan(
        points=scan.points[:10], world_from_scan=scan.world_from_scan
    )
    cloud = np.concatenate([in_world(scan), towards(scan, 0.5)])
    scores = [score(cloud, scan, sees_little), score(cloud, sees_little, scan)]
    assert scores[0].accuracy == scores[1].accuracy == score(cloud, scan).accuracy
    assert scores[0].accuracy[0] < 0.6


def test_a_common_motion_changes_scores_by_the_grids_alone() -> None:
    scan = room_scan()
    cloud = noisy(scan)
    before = score(cloud, scan)
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("xyz", [40, 20, 100], degrees=True).as_matrix()
    motion[:3, 3] = [3.2, -1.3, 0.4]
    moved = PlacedScan(
        points=scan.points,
        world_from_scan=(motion @ scan.world_from_scan).astype(np.float32),
    )
    after = score(cloud @ motion[:3, :3].T + motion[:3, 3], moved)
    np.testing.assert_allclose(after.accuracy, before.accuracy, atol=0.01)
    np.testing.assert_allclose(after.completeness, before.completeness, atol=0.01)
    assert 0.2 < before.accuracy[1] < 0.98


def test_neither_order_nor_repetition_of_points_counts() -> None:
    scan = room_scan()
    cloud = noisy(scan)
    shuffled = np.random.default_rng(1).permutation(np.concatenate([cloud, cloud]))
    before, after = score(cloud, scan), score(shuffled, scan)
    np.testing.assert_allclose(after.accuracy, before.accuracy, atol=1e-12)
    assert after.completeness == before.completeness


def test_scores_grow_with_the_tolerance_and_shrink_with_the_noise() -> None:
    scan = room_scan()
    little, much = score(noisy(scan, 0.005), scan), score(noisy(scan, 0.05), scan)
    for scores in (little, much):
        for values in (scores.accuracy, scores.completeness, scores.f1):
            assert all(0 <= a <= b <= 1 for a, b in itertools.pairwise(values))
    assert little.f1[1] > much.f1[1] + 0.2
    a, c = much.accuracy[1], much.completeness[1]
    assert much.f1[1] == pytest.approx(2 / (1 / a + 1 / c))


def test_half_of_the_scan_is_accurate_but_incomplete() -> None:
    scan = room_scan()
    points = in_world(scan)
    scores = score(points[points[:, 0] < ROOM_M[0] / 2], scan)
    assert scores.accuracy == ALL_RIGHT
    assert 0.3 < scores.completeness[0] < 0.7


def test_the_size_of_the_pieces_changes_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scans = room_scan(num_rows=24), room_scan((3, 2, 1.5), (0, 10, 0), num_rows=24)
    cloud = np.concatenate([noisy(scan) for scan in scans])
    before = score(cloud, *scans)
    monkeypatch.setattr(laser_scan, "_SPANS_AT_ONCE", 7)
    monkeypatch.setattr(laser_scan, "_PAIRS_AT_ONCE", 5)
    monkeypatch.setattr(point_shares, "_POINTS_AT_ONCE", 11)
    monkeypatch.setattr("resdepth_colmap.evaluation.cloud.scores._POINTS_AT_ONCE", 300)
    assert score(cloud, *scans) == before


def test_an_empty_cloud_scores_0_and_is_told(caplog: pytest.LogCaptureFixture) -> None:
    scores = score([])
    assert scores.accuracy == scores.completeness == scores.f1 == ALL_WRONG
    assert "the cloud has no point" in caplog.text


def test_points_that_are_not_finite_are_left_out_and_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    scan = room_scan()
    cloud = noisy(scan)
    odd = [[np.nan, 0, 0], [1, np.inf, 1], [1, 1, -np.inf]]
    scores = score(np.concatenate([cloud, odd]), scan)
    assert scores == score(cloud, scan)
    assert "the cloud: 3 points are not finite" in caplog.text
    odd_scan = PlacedScan(
        points=np.concatenate([scan.points, np.array(odd, np.float32)]),
        world_from_scan=scan.world_from_scan,
    )
    assert score(cloud, scan, odd_scan).accuracy == scores.accuracy
    assert "scan 2: 3 points are not finite" in caplog.text


def test_scans_without_a_point_are_a_bug_of_the_caller() -> None:
    empty = PlacedScan(
        points=np.empty((0, 3), np.float32), world_from_scan=pose([0] * 3)
    )
    with pytest.raises(ValueError, match="no point"):
        score([[1, 2, 3]], empty)


@pytest.mark.parametrize("scale", [1000, 0.001])
def test_other_units_are_told_in_one_line(
    caplog: pytest.LogCaptureFixture, scale: float
) -> None:
    scan = room_scan()
    score(in_world(scan), scan)
    assert not caplog.records
    scores = score(scale * in_world(scan), scan)
    assert scores.f1[1] < 0.01
    assert len(caplog.records) == 1
    assert "in other units or not aligned" in caplog.text


def test_a_point_far_out_or_in_the_scanner_does_no_harm() -> None:
    scan = room_scan()
    cloud = noisy(scan)
    origin = scan.world_from_scan[np.newaxis, :3, 3]
    far = np.array([[1e12, -1e12, 3e30]], np.float32)
    scores = score(np.concatenate([cloud, origin, far]), scan)
    np.testing.assert_allclose(scores.accuracy, score(cloud, scan).accuracy, atol=1e-3)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tolerances": ()}, "one or more distances"),
        ({"tolerances": (0.0, 0.1)}, "above 0"),
        ({"tolerances": (-0.1,)}, "above 0"),
        ({"tolerances": (float("nan"),)}, "above 0"),
        ({"tolerances": (0.02, 0.01)}, "increasing"),
        ({"tolerances": (0.01, 0.01)}, "increasing"),
        ({"voxel_size": 0.0}, "voxel_size=0.0"),
        ({"beam_start_radius_meters": -1.0}, "beam_start_radius_meters=-1.0"),
        ({"beam_divergence_halfangle_deg": 90.0}, "0 to 45 degrees"),
    ],
)
def test_options_out_of_range_are_refused(
    options: dict[str, object], text: str
) -> None:
    with pytest.raises(ConfigError, match=text):
        CloudConfig(**options)  # type: ignore[arg-type]
