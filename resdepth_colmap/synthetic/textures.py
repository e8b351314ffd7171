"""Procedural textures: square pictures that repeat without a seam.

Natural images have 1/f spectra and occlusion edges. Spectral noise and dead leaves
(Lee, Mumford, Huang 2001) have both at little cost; most textures are made of them.
"""

import itertools
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

Rng = np.random.Generator
Picture = npt.NDArray[np.float32]
"""Colours in 0..1 (sRGB), shape (S, S, 3)."""
Field = npt.NDArray[np.float32]
"""One value per texel, shape (S, S)."""
Maker = Callable[[Rng, int], Picture]
"""Makes one random texture with a given side in texels."""


def color(rng: Rng) -> npt.NDArray[np.float32]:
    """A surface colour: mostly muted, sometimes vivid, shape (3,)."""
    warm = rng.random() < 0.5  # wood, skin, clay, paper: indoor colours are warm
    hue = rng.normal(0.55, 0.3) if warm else rng.uniform(0, 6)
    saturation = rng.beta(1.1, 4.0) if rng.random() < 0.8 else rng.uniform(0.4, 0.9)
    value = rng.uniform(0.18, 0.95)
    wheel = np.clip(np.abs((hue + np.array([0, 4, 2])) % 6 - 3) - 1, 0, 1)
    rgb = value * (1 - saturation * (1 - wheel))
    return np.asarray(rgb, dtype=np.float32)


def palette(rng: Rng, count: int) -> npt.NDArray[np.float32]:
    """Colours, more or less similar, shape (count, 3)."""
    base = color(rng)
    spread = rng.choice([0.1, 0.3, 0.6, 1.0])
    others = np.stack([color(rng) for _ in range(count)])
    light = rng.uniform(1 - spread, 1 + spread, (count, 1))
    mixed = (base + spread * (others - base)) * light
    return np.asarray(np.clip(mixed, 0.02, 0.98), dtype=np.float32)


def spectral(rng: Rng, size: int, slope: float, stretch: float = 1.0) -> Field:
    """Noise with power ~ 1/f^(2 slope), mean 0, deviation 1; stretched along x."""
    fy = np.fft.fftfreq(size)[:, None].astype(np.float32)
    fx = np.fft.rfftfreq(size)[None, :].astype(np.float32) * np.float32(stretch)
    frequency = np.sqrt(fx**2 + fy**2)
    frequency[0, 0] = 1.0
    amplitude = frequency ** np.float32(-slope)
    amplitude[0, 0] = 0.0
    white = np.fft.rfft2(rng.standard_normal((size, size), dtype=np.float32))
    field = np.fft.irfft2(white * amplitude, s=(size, size)).astype(np.float32)
    return np.asarray(field / max(float(field.std()), 1e-12), dtype=np.float32)


def _ramp(colors: npt.NDArray[np.float32], field: Field) -> Picture:
    """Colours interpolated along 0..1."""
    position = np.clip(field, 0, 1) * (len(colors) - 1)
    index = np.minimum(position.astype(np.int64), len(colors) - 2)
    share = (position - index)[..., None]
    mixed = colors[index] * (1 - share) + colors[index + 1] * share
    return np.asarray(mixed, np.float32)


def _uniform(rng: Rng, size: int) -> Picture:
    return np.broadcast_to(color(rng), (size, size, 3)).copy()


def _faint(rng: Rng, size: int) -> Picture:
    noise = spectral(rng, size, rng.uniform(0.2, 1.6))
    plain = _uniform(rng, size)
    return np.asarray(plain * (1 + rng.uniform(0.006, 0.04) * noise[..., None]))


def _plaster(rng: Rng, size: int) -> Picture:
    height = spectral(rng, size, rng.uniform(0.6, 1.3))
    relief = height - np.roll(height, (1, 1), (0, 1))
    shade = 1 + rng.uniform(0.01, 0.09) * relief / max(float(relief.std()), 1e-6)
    return np.asarray(_uniform(rng, size) * shade[..., None])


def _stains(rng: Rng, size: int) -> Picture:
    blotch = np.clip(spectral(rng, size, rng.uniform(1.2, 2.0)) - 0.4, 0, 1.5)
    amount = (rng.uniform(0.1, 0.5) * blotch)[..., None]
    return np.asarray(_faint(rng, size) * (1 - amount) + color(rng) * amount)


def _cloudy(rng: Rng, size: int) -> Picture:
    colors = palette(rng, int(rng.integers(2, 6)))
    field = 0.5 + rng.uniform(0.1, 0.35) * spectral(rng, size, rng.uniform(0.8, 1.7))
    return _ramp(colors, field)


def _grain(rng: Rng, size: int) -> Picture:
    """Carpet, felt, granite, sand: fine and strong."""
    layers = [spectral(rng, size, rng.uniform(0, 0.9)) for _ in range(3)]
    mixing = rng.normal(size=(3, 3)) * rng.uniform(0.02, 0.06) + rng.uniform(0.02, 0.12)
    grain = np.stack(layers, 2) @ mixing.astype(np.float32)
    return np.asarray(_uniform(rng, size) + grain)


def _wood(rng: Rng, size: int) -> Picture:
    y = np.arange(size, dtype=np.float32)[:, None] / size
    slow = spectral(rng, size, 1.6, stretch=rng.uniform(4, 16))
    rings = int(rng.integers(3, 16))
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * rings * y + rng.uniform(1.5, 5) * slow)
    fibre = spectral(rng, size, 0.6, stretch=rng.uniform(10, 40))
    dark = np.array([0.30, 0.18, 0.09]) * rng.uniform(0.5, 2.0)
    light = dark + np.array([0.30, 0.24, 0.16]) * rng.uniform(0.2, 1.4)
    colors = np.stack([dark, light]).astype(np.float32)
    picture = _ramp(colors, (wave ** rng.uniform(0.5, 2)).astype(np.float32))
    picture *= 1 + rng.uniform(0.03, 0.12) * fibre[..., None]
    if rng.random() < 0.5:
        planks = int(rng.choice([2, 4, 8]))
        row = (np.arange(size) * planks) // size
        tone = rng.uniform(0.7, 1.2, planks)[row]
        tone[np.arange(size) % (size // planks) < max(size // 200, 1)] *= 0.4
        picture = picture * tone[:, None, None].astype(np.float32)
    return picture


def _marble(rng: Rng, size: int) -> Picture:
    field = spectral(rng, size, rng.uniform(1.3, 1.9))
    vein = np.abs(np.sin(rng.uniform(1, 4) * field)) ** rng.uniform(0.15, 0.7)
    return _ramp(palette(rng, 3), 0.2 + 0.7 * vein + 0.05 * spectral(rng, size, 0.8))


def _camouflage(rng: Rng, size: int) -> Picture:
    field = spectral(rng, size, rng.uniform(1.2, 2.0))
    colors = palette(rng, int(rng.integers(3, 7)))
    level = np.digitize(field, np.linspace(-1.2, 1.2, len(colors) - 1))
    return colors[level]


def _leaf(rng: Rng, radius: float) -> npt.NDArray[np.float64]:
    """Outline of a leaf about the origin: disc, ellipse, polygon or rectangle."""
    corners = int(rng.choice([3, 4, 4, 5, 7, 20, 20]))
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False) + rng.uniform(0, 6.3)
    reach = radius * (1 if corners == 20 else rng.uniform(0.5, 1.2, corners))
    shape = np.stack([np.cos(angle), np.sin(angle) * rng.uniform(0.25, 1)], 1)
    turn = rng.uniform(0, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    return np.asarray((np.reshape(reach, (-1, 1)) * shape) @ [[c, s], [-s, c]])


def _draw_wrapped(
    picture: Picture, outline: npt.NDArray[np.float64], tone: npt.NDArray[np.float32]
) -> None:
    size = len(picture)
    (x0, y0), (x1, y1) = outline.min(axis=0), outline.max(axis=0)
    for dx, dy in itertools.product((-size, 0, size), repeat=2):
        if x1 + dx >= 0 and x0 + dx <= size and y1 + dy >= 0 and y0 + dy <= size:
            points = np.round((outline + np.array([dx, dy])) * 16).astype(np.int32)
            cv2.fillPoly(picture, [points], tone.tolist(), cv2.LINE_AA, 4)


def dead_leaves(rng: Rng, size: int, count: int = 500) -> Picture:
    """Leaves that occlude each other, with radii of density r^-3."""
    picture = np.ascontiguousarray(np.broadcast_to(color(rng), (size, size, 3)))
    colors = palette(rng, 24)
    smallest, largest = size * rng.uniform(0.006, 0.02), size * rng.uniform(0.1, 0.35)
    share = np.sort(rng.uniform(0, 1, count))  # small leaves last, on top
    radii = (largest**-2 + share * (smallest**-2 - largest**-2)) ** -0.5
    order = radii[rng.permutation(count)] if rng.random() < 0.3 else radii
    for radius in order:
        tone = colors[rng.integers(24)] * np.float32(rng.uniform(0.75, 1.2))
        outline = _leaf(rng, radius) + rng.uniform(0, size, 2)
        _draw_wrapped(picture, outline, np.clip(tone, 0, 1))
    texture = spectral(rng, size, rng.uniform(0.5, 1.3))[..., None]
    shade = spectral(rng, size, 1.8)[..., None]
    picture *= 1 + rng.uniform(0.01, 0.12) * texture + rng.uniform(0, 0.12) * shade
    return picture


def _scribbles(rng: Rng, size: int) -> Picture:
    """A map, a drawing: thin curved lines on a plain ground."""
    ground = _cloudy if rng.random() < 0.3 else _uniform
    picture = np.ascontiguousarray(ground(rng, size))
    colors = palette(rng, 6) * rng.choice([0.3, 1.0])
    for _ in range(int(rng.integers(10, 120))):
        steps = rng.normal(0, size * 0.03, (30, 2)).cumsum(axis=0)
        path = np.cumsum(steps, axis=0) * rng.uniform(0.05, 0.3)
        path += rng.uniform(0, size, 2)
        width = int(rng.integers(1, max(size // 100, 2)))
        points = [np.round(path * 16).astype(np.int32)]
        tone = colors[rng.integers(6)].tolist()
        cv2.polylines(picture, points, False, tone, width, cv2.LINE_AA, 4)
    return picture


def _print(rng: Rng, size: int) -> Picture:
    """A printed page: lines of glyphs, headlines, a picture or two."""
    dark, light = 0.4 * color(rng), rng.uniform(0.75, 0.95) * (0.9 + 0.1 * color(rng))
    ink, paper = (dark, light) if rng.random() < 0.8 else (light, dark)
    share = (_text_lines(rng, size).astype(np.float32) / 255)[..., None]
    picture = (paper * (1 - share) + ink * share).astype(np.float32)
    for _ in range(int(rng.integers(0, 3))):
        side = int(size * rng.uniform(0.2, 0.5))
        x, top = rng.integers(0, size - side, 2)
        inset = dead_leaves(rng, 256, 150)
        picture[top : top + side, x : x + side] = cv2.resize(inset, (side, side))
    return picture


def _text_lines(rng: Rng, size: int) -> npt.NDArray[np.uint8]:
    """Lines of random letters, some large, 255 where there is ink."""
    ink = np.zeros((size, size), np.uint8)
    letters = np.array(list("abcdefghijklmnoprstuvwxyzABCEHKMORSTW0123456789  ,.;&"))
    usual, font = rng.uniform(0.3, 0.7), int(rng.choice([0, 2, 3, 4]))
    y = size * 0.04
    while y < size * 0.97:
        scale = size / 512 * (rng.uniform(1, 3) if rng.random() < 0.12 else usual)
        y += 26 * scale
        count = int(size * rng.uniform(0.6, 0.92) / (18 * scale))
        text = "".join(rng.choice(letters, count))
        start, width = (int(size * 0.04), int(y)), max(int(1.5 * scale), 1)
        cv2.putText(ink, text, start, font, scale, 255, width, cv2.LINE_AA)
        y += 12 * scale
    return ink


def _poster(rng: Rng, size: int) -> Picture:
    """A painting or photograph: soft large shapes, sharp small ones, shading."""
    large = dead_leaves(rng, size, 40)
    soft = cv2.GaussianBlur(large, (0, 0), size * rng.uniform(0.002, 0.03))
    sharp = dead_leaves(rng, size, 300)
    field = spectral(rng, size, 1.8)[..., None]
    blend = np.clip(0.5 + 3 * (field - rng.uniform(-0.8, 0.8)), 0, 1)
    return np.asarray(soft * blend + sharp * (1 - blend))


def _pixels(rng: Rng, size: int) -> Picture:
    """Random square cells, as of a code or a mosaic."""
    cells = int(rng.choice([16, 32, 64]))
    colors = palette(rng, int(rng.integers(2, 9)))
    index = rng.integers(0, len(colors), (cells, cells))
    repeat = np.arange(size) * cells // size
    return colors[index][repeat][:, repeat]


def _terrazzo(rng: Rng, size: int) -> Picture:
    picture = np.ascontiguousarray(_plaster(rng, size), dtype=np.float32)
    colors = palette(rng, 8)
    for _ in range(int(rng.integers(60, 500))):
        radius = size * rng.uniform(0.003, 0.03)
        outline = _leaf(rng, radius) + rng.uniform(0, size, 2)
        _draw_wrapped(picture, outline, colors[rng.integers(8)])
    return picture


WEAK: tuple[Maker, ...] = (_uniform, _faint, _faint, _plaster, _stains)
RICH: tuple[Maker, ...] = (
    *(dead_leaves, dead_leaves, _poster, _poster, _print, _scribbles, _wood, _wood),
    *(_marble, _cloudy, _cloudy, _grain, _grain, _camouflage, _pixels, _terrazzo),
)
