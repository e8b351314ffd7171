"""Textures of repeated patterns: tiles, bricks, stripes, weaves, wallpaper."""

import numpy as np
import numpy.typing as npt

from resdepth_colmap.synthetic.textures import (
    RICH,
    WEAK,
    Field,
    Maker,
    Picture,
    Rng,
    dead_leaves,
    palette,
    spectral,
)


def _cells(rng: Rng, size: int, low: int, high: int) -> tuple[Field, Field, int]:
    """Position 0..1 within each of count x count cells, and count (divides 2^n)."""
    count = int(2 ** rng.integers(low, high))
    position = ((np.arange(size, dtype=np.float32) + 0.5) * count / size) % 1
    x, y = np.meshgrid(position.astype(np.float32), position.astype(np.float32))
    return x, y, count


def _dirty(rng: Rng, picture: Picture) -> Picture:
    """Mostly a little uneven, as real repeats are."""
    if rng.random() < 0.3:
        return picture
    noise = spectral(rng, len(picture), rng.uniform(0.7, 1.8))
    return np.asarray(picture * (1 + rng.uniform(0.005, 0.06) * noise[..., None]))


def _mix(colors: Picture, share: npt.ArrayLike) -> Picture:
    s = np.asarray(share, np.float32)[..., None]
    return np.asarray(colors[0] * (1 - s) + colors[1] * s, np.float32)


def _tone_per_cell(rng: Rng, size: int, count: int) -> Field:
    tones = 1 + rng.uniform(0, 0.12) * rng.standard_normal((count, count))
    cell = np.ones((size // count, size // count), np.float32)
    return np.asarray(np.kron(tones.astype(np.float32), cell))


def _tiles(rng: Rng, size: int) -> Picture:
    x, y, count = _cells(rng, size, 1, 4)
    gap = rng.uniform(0.015, 0.05)
    joint = (x < gap) | (y < gap)
    tile = _mix(palette(rng, 2), joint)
    tone = np.where(joint, 1, _tone_per_cell(rng, size, count))
    return _dirty(rng, tile * tone[..., None])


def _bricks(rng: Rng, size: int) -> Picture:
    _, y, count = _cells(rng, size, 2, 5)
    row = (np.arange(size) * count) // size
    column = np.arange(size)[None, :] * count / 2 / size
    across = (column + 0.5 * (row % 2)[:, None]) % 1
    gap = rng.uniform(0.06, 0.14)
    joint = (y < gap) | (across < gap / 2)
    wall = _mix(palette(rng, 2), joint) * _tone_per_cell(rng, size, count)[..., None]
    grain = 1 + rng.uniform(0.02, 0.1) * spectral(rng, size, 0.5)
    return _dirty(rng, wall * grain[..., None])


def _checks(rng: Rng, size: int) -> Picture:
    x, y, _ = _cells(rng, size, 1, 5)
    return _dirty(rng, _mix(palette(rng, 2), (x < 0.5) ^ (y < 0.5)))


def _stripes(rng: Rng, size: int) -> Picture:
    x, _, _ = _cells(rng, size, 2, 6)
    edges = np.sort(rng.uniform(0, 1, 4))
    is_sharp = rng.random() >= 0.3
    share = np.digitize(x, edges) % 2 if is_sharp else 0.5 + 0.5 * np.sin(2 * np.pi * x)
    picture = _mix(palette(rng, 2), share)
    if rng.random() < 0.5:
        picture = picture.transpose(1, 0, 2)
    return _dirty(rng, picture)


def _plaid(rng: Rng, size: int) -> Picture:
    across = _stripes(rng, size)
    blend = rng.uniform(0.3, 0.7)
    return _dirty(rng, across * blend + across.transpose(1, 0, 2) * (1 - blend))


def _dots(rng: Rng, size: int) -> Picture:
    x, y, _ = _cells(rng, size, 2, 6)
    radius = rng.uniform(0.12, 0.45)
    edge = (radius - np.hypot(x - 0.5, y - 0.5)) * 20
    return _dirty(rng, _mix(palette(rng, 2), np.clip(0.5 + edge, 0, 1)))


def _weave(rng: Rng, size: int) -> Picture:
    x, y, _ = _cells(rng, size, 4, 7)
    over = (x < 0.5) ^ (y < 0.5)
    thread = np.where(over, np.sin(2 * np.pi * x) ** 2, np.sin(2 * np.pi * y) ** 2)
    base = _mix(palette(rng, 2), over)
    return _dirty(rng, base * (0.55 + 0.45 * thread)[..., None].astype(np.float32))


def _lines(rng: Rng, size: int) -> Picture:
    x, y, _ = _cells(rng, size, 2, 6)
    width = rng.uniform(0.03, 0.12)
    return _dirty(rng, _mix(palette(rng, 2), (x < width) | (y < width)))


def _wallpaper(rng: Rng, size: int) -> Picture:
    """One small picture, repeated."""
    times = int(rng.choice([2, 4, 8]))
    motif = dead_leaves(rng, size // times, int(rng.integers(4, 60)))
    return _dirty(rng, np.tile(motif, (times, times, 1)))


REPEATED: tuple[Maker, ...] = (
    *(_tiles, _tiles, _bricks, _checks, _stripes, _stripes),
    *(_plaid, _dots, _weave, _weave, _lines, _wallpaper, _wallpaper),
)


def random_texture(
    rng: Rng, size: int, weak: float = 0.35, repeated: float = 0.15
) -> Picture:
    """A random texture: weak, repeated or rich.

    Args:
        rng: Source of randomness.
        size: Side in texels, a power of two.
        weak: Probability of a uniform or almost uniform texture.
        repeated: Probability of a repeated pattern.

    Returns:
        Colours in 0..1 (sRGB), shape (size, size, 3), float32; it tiles.
    """
    kind = rng.random()
    makers = WEAK if kind < weak else REPEATED if kind < weak + repeated else RICH
    picture = makers[rng.integers(len(makers))](rng, size)
    if makers is RICH:
        picture = _faded(rng, picture)
    return np.clip(picture, 0.01, 0.99).astype(np.float32)


def _faded(rng: Rng, picture: Picture) -> Picture:
    """With contrast changed about the mean, sometimes blended with dead leaves."""
    if rng.random() < 0.25:
        other = dead_leaves(rng, len(picture), 200)
        picture = picture + rng.uniform(0.1, 0.5) * (other - picture)
    strength = rng.uniform(0.15, 0.6) if rng.random() < 0.4 else rng.uniform(0.6, 1.1)
    mean = picture.mean(axis=(0, 1))
    return np.asarray(mean + strength * (picture - mean))
