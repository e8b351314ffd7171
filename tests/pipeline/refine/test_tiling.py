import itertools

import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor
from torch.nn.functional import avg_pool2d

from resdepth_colmap.pipeline.refine.tiling import (
    Window,
    apply_tiled,
    blend_weights,
    pad_to_multiple,
    tile_windows,
)

sides = st.integers(1, 150)
tiles = st.integers(1, 64)


@given(height=sides, width=sides, tile=tiles, share=st.floats(0, 0.5))
def test_the_windows_cover_the_map_and_overlap_as_asked(
    height: int, width: int, tile: int, share: float
) -> None:
    overlap = int(tile * share)
    windows = tile_windows(height, width, tile, overlap)
    covered = torch.zeros(height, width, dtype=torch.int)
    for window in windows:
        assert window.top_px + window.height_px <= height
        assert window.left_px + window.width_px <= width
        covered[window.rows, window.columns] += 1
    assert covered.min() >= 1
    assert len(set(windows)) == len(windows)
    starts = sorted({window.left_px for window in windows})
    for left, right in itertools.pairwise(starts):
        assert left + tile - right >= overlap


@given(height=sides, width=sides, tile=tiles, share=st.floats(0, 0.5))
def test_a_constant_stays_that_constant(
    height: int, width: int, tile: int, share: float
) -> None:
    def constant(window: Window) -> Tensor:
        return torch.full((2, window.height_px, window.width_px), 3.7)

    blended = apply_tiled(constant, (height, width), tile, int(tile * share))
    torch.testing.assert_close(blended, torch.full((2, height, width), 3.7))


@given(seed=st.integers(0, 1000), overlap=st.sampled_from([0, 3, 8, 16]))
def test_what_each_pixel_says_of_itself_comes_through(seed: int, overlap: int) -> None:
    values = torch.randn(1, 70, 45, generator=torch.Generator().manual_seed(seed))

    def affine(window: Window) -> Tensor:
        return 2.0 * values[:, window.rows, window.columns] + 1.0

    blended = apply_tiled(affine, (70, 45), 32, overlap)
    torch.testing.assert_close(blended, 2.0 * values + 1.0)


def test_tiled_is_near_the_whole_for_a_function_of_the_neighbourhood() -> None:
    values = torch.randn(1, 90, 80, generator=torch.Generator().manual_seed(0))

    def mean(part: Tensor) -> Tensor:
        return avg_pool2d(part, 3, stride=1, padding=1)

    whole = mean(values)
    tiled = apply_tiled(lambda w: mean(values[:, w.rows, w.columns]), (90, 80), 32, 16)
    # Only the outermost pixel of a tile lacks neighbours; it hardly counts.
    inner = (slice(None), slice(1, -1), slice(1, -1))
    assert (tiled - whole)[inner].abs().max() < 0.02


def test_a_step_between_two_tiles_becomes_a_smooth_ramp() -> None:
    def step(window: Window) -> Tensor:
        value = float(window.left_px > 0)
        return torch.full((1, window.height_px, window.width_px), value)

    row = apply_tiled(step, (8, 48), 32, 16)[0, 0]
    assert row[0] == 0
    assert row[-1] == 1
    assert row.diff().min() >= 0
    assert row.diff().max() < 0.12


@given(height=sides, width=sides, ramp=st.integers(0, 80))
def test_no_pixel_of_a_tile_weighs_nothing(height: int, width: int, ramp: int) -> None:
    weights = blend_weights(height, width, ramp)
    assert weights.min() > 0
    assert weights.max() <= 1


@given(height=st.integers(1, 20), width=st.integers(1, 20), multiple=st.integers(1, 16))
def test_padding_repeats_the_border(height: int, width: int, multiple: int) -> None:
    values = torch.arange(2.0 * height * width).reshape(1, 2, height, width)
    padded = pad_to_multiple(values, multiple)
    assert padded.shape[-2] % multiple == padded.shape[-1] % multiple == 0
    assert padded.shape[-2] - height < multiple
    assert torch.equal(padded[..., :height, :width], values)
    assert torch.equal(padded[..., -1, -1], values[..., -1, -1])
