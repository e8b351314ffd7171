"""Laws of the procedural textures."""

import numpy as np
import pytest

from resdepth_colmap.synthetic import patterns, textures

MAKERS = [*dict.fromkeys([*textures.WEAK, *textures.RICH, *patterns.REPEATED])]


@pytest.mark.parametrize("seed", range(12))
def test_colours_stay_between_black_and_white(seed: int) -> None:
    picture = patterns.random_texture(np.random.default_rng(seed), 64)
    assert picture.shape == (64, 64, 3)
    assert picture.dtype == np.float32
    assert picture.min() >= 0
    assert picture.max() <= 1


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
def test_every_maker_gives_finite_colours(maker: textures.Maker) -> None:
    picture = maker(np.random.default_rng(0), 64)
    assert picture.shape == (64, 64, 3)
    assert np.isfinite(picture).all()


def test_the_same_seed_gives_the_same_texture() -> None:
    first = patterns.random_texture(np.random.default_rng(7), 64)
    second = patterns.random_texture(np.random.default_rng(7), 64)
    np.testing.assert_array_equal(first, second)


def test_a_third_of_the_textures_is_weak() -> None:
    rng = np.random.default_rng(0)
    contrast = [
        patterns.random_texture(rng, 32).std(axis=(0, 1)).mean() for _ in range(100)
    ]
    assert 0.2 < np.mean(np.array(contrast) < 0.02) < 0.5


def test_spectral_noise_tiles_and_falls_off_with_frequency() -> None:
    field = textures.spectral(np.random.default_rng(0), 128, 1.5)
    inner = np.abs(np.diff(field, axis=0)).mean()
    seam = np.abs(field[0] - field[-1]).mean()
    assert seam < 2 * inner  # the last row goes on in the first
    power = np.abs(np.fft.rfft2(field)) ** 2
    assert power[1:4, 1:4].mean() > 100 * power[30:33, 30:33].mean()
