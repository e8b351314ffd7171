"""Laws of the CPU PatchMatch, on an exact slanted plane seen by three cameras."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numba import get_num_threads, set_num_threads
from numpy.typing import NDArray

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching import patch_match
from resdepth_colmap.matching.patch_match import (
    MatchResult,
    MatchView,
    Surface,
    match_view,
)

Array = NDArray[Any]

WIDTH, HEIGHT, FOCAL = 80, 60, 70.0
PLANE = np.array([0.2, -0.1, -1.0])  # n . xyz = -2.5 in the first camera's frame
OFFSET = -2.5
CONFIG = StereoConfig(num_iterations=4)
NEAR_FAR = (1.2, 6.0)


def intrinsics() -> Array:
    return np.array([[FOCAL, 0, 39.5], [0, FOCAL, 29.5], [0, 0, 1.0]])


def _texture(x: Array, y: Array) -> Array:
    waves = (
        np.sin(9 * x + 2 * y) + np.sin(7 * y - 3 * x) + np.sin(17 * x) * np.sin(13 * y)
    )
    return np.asarray(0.5 + 0.15 * waves, np.float32)


def _depth(cam_from_world: Array) -> Array:
    """Exact depth of the plane, shape (H, W)."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(intrinsics()).T
    rotation, translation = cam_from_world[:, :3], cam_from_world[:, 3]
    normal = rotation @ PLANE
    return np.asarray((OFFSET + normal @ translation) / (rays @ normal))


def _view(x: float, y: float = 0.0, gain: float = 1.0, turn: float = 0.0) -> MatchView:
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
    pose = np.column_stack([rotation, -rotation @ np.array([x, y, 0.0])])
    pixels = np.stack(np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), axis=-1)
    rays = np.concatenate([pixels, np.ones((HEIGHT, WIDTH, 1))], axis=-1)
    xyz_in_cam = _depth(pose)[..., None] * (rays @ np.linalg.inv(intrinsics()).T)
    xyz = (xyz_in_cam - pose[:, 3]) @ rotation
    gray = gain * _texture(xyz[..., 0], xyz[..., 1])
    return MatchView(gray=gray.astype(np.float32), K=intrinsics(), cam_from_world=pose)


def _match(*sources: MatchView, **changes: int) -> MatchResult:
    config = StereoConfig(**{**CONFIG.to_mapping(), **changes})
    return match_view(_view(0.0), sources, NEAR_FAR, config)


def _inner(values: Array) -> Array:
    return values[8:-8, 16:-16]


def test_an_exact_plane_is_found_to_a_per_mille() -> None:
    result = _match(_view(0.25), _view(-0.2, 0.1))
    truth = _depth(_view(0.0).cam_from_world)
    error = _inner(np.abs(result.depth - truth) / truth)
    assert np.median(error) < 1e-3
    assert np.mean(error < 0.01) > 0.97


def test_normals_are_those_of_the_plane_and_face_the_camera() -> None:
    result = _match(_view(0.25), _view(-0.2, 0.1))
    unit = PLANE / np.linalg.norm(PLANE)
    cos = _inner(result.normals) @ unit
    assert np.allclose(np.linalg.norm(result.normals, axis=-1), 1.0, atol=1e-5)
    assert np.degrees(np.arccos(np.clip(np.median(cos), -1, 1))) < 3.0


def test_a_turned_source_is_warped_with_its_whole_pose() -> None:
    result = _match(_view(0.3, turn=0.08))
    truth = _depth(_view(0.0).cam_from_world)
    assert np.median(_inner(np.abs(result.depth - truth) / truth)) < 2e-3


def test_the_same_seed_gives_the_same_maps_whatever_the_number_of_threads() -> None:
    num_threads = get_num_threads()
    many = _match(_view(0.25))
    set_num_threads(1)
    try:
        one = _match(_view(0.25))
    finally:
        set_num_threads(num_threads)
    assert np.array_equal(many.depth, one.depth)
    assert np.array_equal(many.normals, one.normals)


def test_another_seed_gives_other_maps() -> None:
    first, second = _match(_view(0.25)), _match(_view(0.25), seed=1)
    assert not np.array_equal(first.depth, second.depth)


def test_another_exposure_of_the_source_changes_little() -> None:
    truth = _depth(_view(0.0).cam_from_world)
    result = _match(_view(0.25, gain=0.6))
    assert np.median(_inner(np.abs(result.depth - truth) / truth)) < 2e-3


def test_a_scene_without_texture_gives_depths_within_the_range() -> None:
    flat = np.full((HEIGHT, WIDTH), 0.5, np.float32)
    views = [
        MatchView(gray=flat, K=view.K, cam_from_world=view.cam_from_world)
        for view in (_view(0.0), _view(0.25))
    ]
    result = match_view(views[0], views[1:], NEAR_FAR, CONFIG)
    assert np.all(np.isfinite(result.depth))
    assert result.depth.min() >= NEAR_FAR[0] * 0.999
    assert result.depth.max() <= NEAR_FAR[1] * 1.001


def test_a_source_that_is_the_reference_gives_finite_maps() -> None:
    result = _match(_view(0.0))
    assert np.all(np.isfinite(result.depth))
    assert np.all(np.isfinite(result.normals))


@pytest.mark.parametrize("depth_range", [(0.0, 1.0), (2.0, 1.0), (-1.0, 1.0)])
def test_an_empty_depth_range_is_refused(depth_range: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="depth_range"):
        match_view(_view(0.0), [_view(0.2)], depth_range, CONFIG)


def test_a_view_without_sources_is_refused() -> None:
    with pytest.raises(ValueError, match="sources"):
        match_view(_view(0.0), [], NEAR_FAR, CONFIG)


def test_a_range_of_three_powers_of_ten_still_finds_the_plane() -> None:
    truth = _depth(_view(0.0).cam_from_world)
    sources = [_view(0.25), _view(-0.2, 0.1)]
    result = match_view(_view(0.0), sources, (0.05, 100.0), CONFIG)
    assert np.median(_inner(np.abs(result.depth - truth) / truth)) < 2e-3


def _noisy(view: MatchView, contrast: float, seed: int) -> MatchView:
    """The view with so weak a texture that the noise of 1 % hides the plane."""
    noise = np.random.default_rng(seed).normal(0.0, 0.01, view.gray.shape)
    gray = 0.5 + contrast * (view.gray - 0.5) + noise
    return dataclasses.replace(view, gray=gray.astype(np.float32))


def test_smoothness_decides_where_the_texture_is_as_weak_as_the_noise() -> None:
    views = [_noisy(_view(x), 0.4, seed) for seed, x in enumerate((0.0, 0.25, -0.25))]
    truth = _depth(_view(0.0).cam_from_world)
    bad = {}
    for smoothness in (0.0, 1.0):
        config = StereoConfig(smoothness=smoothness)
        result = match_view(views[0], views[1:], NEAR_FAR, config)
        bad[smoothness] = np.mean(_inner(np.abs(result.depth - truth) / truth) > 0.02)
    assert bad[1.0] < 0.5 * bad[0.0]


def test_a_strip_that_no_source_sees_goes_on_as_its_surroundings_do() -> None:
    truth = _depth(_view(0.0).cam_from_world)
    right = {}
    for smoothness in (0.0, 1.0):
        config = StereoConfig(smoothness=smoothness)
        result = match_view(_view(0.0), [_view(0.6)], NEAR_FAR, config)
        unseen = np.all(result.source_costs == 1.0, axis=0)
        assert np.mean(unseen[8:-8, :12]) > 0.8
        right[smoothness] = np.mean(
            (np.abs(result.depth - truth) / truth)[unseen] < 0.1
        )
    assert right[1.0] > 1.5 * right[0.0]


def test_the_costs_of_the_sources_are_those_of_a_match_and_of_no_match() -> None:
    seen, blind = _view(0.25), dataclasses.replace(_view(-0.25), gray=_gray_noise())
    result = _match(seen, blind)
    assert result.source_costs.shape == (2, HEIGHT, WIDTH)
    assert np.median(_inner(result.source_costs[0])) < 0.05
    assert np.median(_inner(result.source_costs[1])) > 0.5


def _gray_noise() -> Array:
    return np.random.default_rng(0).random((HEIGHT, WIDTH)).astype(np.float32)


def _second_pass(source_depths: list[Array], *sources: MatchView) -> MatchResult:
    """The geometric pass, from a photometric map that is wrong in a block."""
    truth = _depth(_view(0.0).cam_from_world).astype(np.float32)
    depth = truth.copy()
    depth[20:40, 30:50] = 1.6
    normals = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    normals[:] = PLANE / np.linalg.norm(PLANE)
    start = Surface(depth=depth, normals=normals)
    flat = np.full((HEIGHT, WIDTH), 0.5, np.float32)
    views = [dataclasses.replace(v, gray=flat) for v in (_view(0.0), *sources)]
    return match_view(
        *(views[0], views[1:], NEAR_FAR, StereoConfig(smoothness=0.0)),
        start=start,
        source_depths=source_depths,
    )


def test_without_any_texture_the_maps_of_the_sources_decide() -> None:
    sources = [_view(0.25), _view(-0.2, 0.1)]
    depths = [_depth(view.cam_from_world).astype(np.float32) for view in sources]
    result = _second_pass(depths, *sources)
    truth = _depth(_view(0.0).cam_from_world)
    block = (np.abs(result.depth - truth) / truth)[20:40, 30:50]
    assert np.mean(block < 0.02) > 0.6


def test_empty_maps_of_the_sources_decide_nothing() -> None:
    sources = [_view(0.25), _view(-0.2, 0.1)]
    depths = [np.zeros((HEIGHT, WIDTH), np.float32) for _ in sources]
    result = _second_pass(depths, *sources)
    assert np.all(np.isfinite(result.depth))
    truth = _depth(_view(0.0).cam_from_world)
    block = (np.abs(result.depth - truth) / truth)[20:40, 30:50]
    assert np.mean(block < 0.02) < 0.1


def test_shading_too_weak_for_a_window_is_matched_with_a_wider_one() -> None:
    views = []
    for view in (_view(0.0), _view(0.3)):
        depth = _depth(view.cam_from_world)
        x = np.arange(WIDTH) - 39.5
        along = depth * x / FOCAL - view.cam_from_world[0, 3]
        shading = 0.5 + 0.006 * np.sin(5.0 * along)
        views.append(dataclasses.replace(view, gray=shading.astype(np.float32)))
    result = match_view(views[0], views[1:], NEAR_FAR, CONFIG)
    truth = _depth(views[0].cam_from_world)
    error = np.abs(result.depth - truth) / truth
    assert np.var(views[0].gray[20:29, 30:39]) < 1e-5
    assert np.median(error[8:-8, 20:-20]) < 0.03


def test_steps_are_counted_to_their_total_and_may_end_the_matching() -> None:
    steps: list[tuple[int, int]] = []

    def on_step(number: int, total: int) -> None:
        steps.append((number, total))

    match_view(_view(0.0), [_view(0.2)], NEAR_FAR, CONFIG, on_step=on_step)
    total = steps[-1][1]
    assert steps == [(number, total) for number in range(1, total + 1)]

    def interrupted(number: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        match_view(_view(0.0), [_view(0.2)], NEAR_FAR, CONFIG, on_step=interrupted)


def test_the_maps_do_not_depend_on_the_bands(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = _match(_view(0.25))
    monkeypatch.setattr(patch_match, "BAND_PIXELS", 1)
    monkeypatch.setattr(patch_match, "LEAST_ROWS", 7)
    banded = _match(_view(0.25))
    assert np.array_equal(whole.depth, banded.depth)
