"""Furniture and small objects, built of primitives; each stands on z = 0.

A slot of a mesh is one material: the legs of a chair share one, its seat has another.
Sizes are those of real objects, in metres.
"""

from collections.abc import Callable

import numpy as np

from resdepth_colmap.synthetic import meshes
from resdepth_colmap.synthetic.meshes import Mesh, Rng, merge

Builder = Callable[[Rng], Mesh]
"""Builds one random object."""


def carton(rng: Rng) -> Mesh:
    """A box."""
    return meshes.box(rng.uniform(0.06, 0.5, 3) * rng.uniform(0.5, 1.2))


def table(rng: Rng) -> Mesh:
    """A table: round or square top, three or four legs, perhaps a shelf below."""
    width, depth, height = rng.uniform([0.5, 0.4, 0.4], [1.6, 0.9, 0.8])
    thick = rng.uniform(0.015, 0.06)
    if rng.random() < 0.3:
        depth = width = min(width, 1.1)
        top = meshes.cylinder(width / 2, thick)
    else:
        top = meshes.box([width, depth, thick])
    parts = [top.moved([0, 0, height])]
    inset = 0.35 if rng.random() < 0.2 else 0.44
    splay = rng.uniform(0, 0.08) * rng.integers(0, 2)
    for x in (-inset, inset):
        for y in (-inset, inset):
            parts.append(_leg(rng, [x * width, y * depth], height, splay))
    if rng.random() < 0.4:
        low = meshes.box([width * 0.85, depth * 0.85, 0.02]).moved([0, 0, height * 0.3])
        parts.append(low.slotted(0))
    return merge(parts)


def _leg(rng: Rng, foot: list[float], height: float, splay: float) -> Mesh:
    radius = 0.5 * rng.uniform(0.02, 0.06)
    x, y = foot
    outward = 1 + splay / 0.4
    leg = meshes.rod([x * outward, y * outward, 0], [x, y, height], radius)
    return leg.slotted(1)


def chair(rng: Rng) -> Mesh:
    """A chair with thin legs and a slatted, barred or solid back."""
    width, depth, seat = rng.uniform([0.36, 0.36, 0.4], [0.5, 0.5, 0.5])
    thin = rng.uniform(0.01, 0.02)
    back = seat + rng.uniform(0.3, 0.55)
    lean = rng.uniform(0, 0.12)
    if rng.random() < 0.5:
        cushion = meshes.superquadric([width, depth, 0.07], (0.3, 0.3))
        cushion = cushion.moved([0, 0, seat])
    else:
        cushion = meshes.box([width, depth, 0.03]).moved([0, 0, seat - 0.015])
    x, y = width / 2 - thin, depth / 2 - thin
    splay = rng.uniform(0, 0.06)
    parts = []
    for sx, sy in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        foot = [sx * (x + splay), sy * (y + splay), 0]
        parts.append(meshes.rod(foot, [sx * x, sy * y, seat], thin))
    parts += _pair(x, (y, seat), (y + lean, back), thin)
    parts += _chair_back(rng, x, (y, y + lean), (seat, back))
    if rng.random() < 0.4:
        parts += _pair(x, (-y, 0.2), (y, 0.2), thin * 0.7)
    if rng.random() < 0.25:
        rest = seat + 0.2
        parts += _pair(x, (-y, rest), (y, rest), thin)
        parts += _pair(x, (-y, seat), (-y, rest), thin)
    frame = merge(parts).slotted(1)
    return merge([cushion, frame])


def _pair(
    x: float, start: tuple[float, float], end: tuple[float, float], radius: float
) -> list[Mesh]:
    """A bar from `start` to `end`, both (y, z), at -x and at x."""
    return [meshes.rod([s * x, *start], [s * x, *end], radius) for s in (-1, 1)]


def _chair_back(
    rng: Rng, x: float, y: tuple[float, float], z: tuple[float, float]
) -> list[Mesh]:
    kind = rng.integers(3)
    if kind == 0:  # slats across
        heights = np.linspace(0.35, 1, int(rng.integers(2, 6)))
        slats = [meshes.box([2 * x, 0.012, rng.uniform(0.03, 0.07)]) for _ in heights]
        return [
            slat.moved([0, y[0] + h * (y[1] - y[0]), z[0] + h * (z[1] - z[0]) - 0.05])
            for slat, h in zip(slats, heights, strict=True)
        ]
    if kind == 1:  # upright bars
        across = np.linspace(-x, x, int(rng.integers(4, 9)))
        bars = [meshes.rod([u, y[0], z[0]], [u, y[1], z[1]], 0.006) for u in across]
        return [*bars, meshes.rod([-x, y[1], z[1]], [x, y[1], z[1]], 0.014)]
    panel = meshes.box([2 * x, 0.015, 0.55 * (z[1] - z[0])])
    return [panel.moved([0, y[1], z[0] + 0.45 * (z[1] - z[0])])]


def books(rng: Rng, length: float | None = None) -> Mesh:
    """A row of upright books, the last ones leaning."""
    end = rng.uniform(0.15, 0.6) if length is None else length
    x, parts = 0.0, []
    height = rng.uniform(0.18, 0.3)
    while x < end:
        thick, tall, deep = rng.uniform([0.008, 0.75, 0.12], [0.05, 1.1, 0.2])
        book = meshes.box([thick, deep, height * tall], cell=0.15)
        lean = rng.uniform(0.1, 0.4) if rng.random() < 0.08 else 0.0
        push = rng.uniform(-0.02, 0.02)
        parts.append(book.moved([x + thick / 2, push, 0], meshes.turn(1, lean)))
        x += thick + 0.001 + lean * height * 0.5 + (0.05 if rng.random() < 0.05 else 0)
    return merge(parts, keep_slots=False)


def book_pile(rng: Rng) -> Mesh:
    """Books lying on each other, each turned a little."""
    z, parts = 0.0, []
    for _ in range(int(rng.integers(2, 9))):
        size = rng.uniform([0.12, 0.16, 0.008], [0.22, 0.3, 0.05])
        turn = meshes.turn_z(rng.normal(0, 0.25))
        book = meshes.box(size, cell=0.15)
        parts.append(book.moved([*rng.normal(0, 0.01, 2), z], turn))
        z += size[2]
    return merge(parts, keep_slots=False)


def shelf(rng: Rng) -> Mesh:
    """A shelf with books and small things."""
    width, depth = rng.uniform([0.5, 0.22], [1.4, 0.35])
    levels, gap = int(rng.integers(2, 6)), rng.uniform(0.28, 0.42)
    height = levels * gap
    board, side = meshes.box([width, depth, 0.02]), meshes.box([0.02, depth, height])
    boards = [board.moved([0, 0, z * gap]) for z in range(levels + 1)]
    sides = [side.moved([s * width / 2, 0, 0]) for s in (-1, 1)]
    if rng.random() < 0.6:
        sides.append(meshes.box([width, 0.01, height]).moved([0, depth / 2, 0]))
    parts = [merge(boards + sides)]
    for level in range(levels + rng.integers(0, 2)):
        base = np.array([-width / 2 + 0.03, 0, level * gap + 0.02])
        if rng.random() < 0.6:
            row = books(rng, rng.uniform(0.2, 0.9) * (width - 0.1))
            parts.append(row.moved(base))
        else:
            for x in np.arange(0.1, width - 0.1, rng.uniform(0.15, 0.4)):
                thing = _fitted(small_thing(rng), min(0.24, gap - 0.04))
                parts.append(thing.moved(base + np.array([x, 0, 0])))
    return merge(parts, keep_slots=False)


def _fitted(mesh: Mesh, limit: float) -> Mesh:
    return mesh.scaled(min(1.0, limit / float(mesh.size.max()))).seated()


def cylinder(rng: Rng) -> Mesh:
    """A tin, a column, a cone or a lying roll."""
    radius, height = rng.uniform([0.02, 0.05], [0.14, 0.6])
    top = radius * rng.uniform(0, 1.3) if rng.random() < 0.35 else None
    return _perhaps_tipped(rng, meshes.cylinder(radius, height, top), 0.25)


def _perhaps_tipped(rng: Rng, mesh: Mesh, chance: float) -> Mesh:
    if rng.random() < chance:
        return mesh.rotated(meshes.random_rotation(rng)).seated()
    return mesh


def vase(rng: Rng) -> Mesh:
    """A vase, bottle, bowl or lamp foot: a random profile turned round."""
    height, width = rng.uniform([0.08, 0.03], [0.5, 0.16])
    knots = np.stack([rng.uniform(0.25, 1, 6) * width, np.linspace(0, height, 6)], 1)
    if rng.random() < 0.4:  # a bowl opens upwards
        knots = np.stack([np.sort(knots[:, 0]), knots[:, 1] * rng.uniform(0.2, 0.6)], 1)
    curve = meshes.smooth_path(np.pad(knots, ((0, 0), (0, 1))), 40)[:, :2]
    inner = curve[::-1] * [0.93, 1.0]
    inner = np.concatenate([inner[inner[:, 1] > 0.05 * height], [[0, 0.05 * height]]])
    profile = np.concatenate([[[0.0, 0.0]], curve, inner])
    return _perhaps_tipped(rng, meshes.revolve(profile, 40), 0.1)


def cup(rng: Rng) -> Mesh:
    """A cup with a handle, perhaps with pencils in it."""
    radius, height = rng.uniform([0.03, 0.06], [0.06, 0.13])
    profile = np.array([[0, 0], [0.8, 0], [1, 1], [0.93, 1], [0.75, 0.1], [0, 0.1]])
    body = meshes.revolve(profile * [radius, height])
    upright = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    handle = meshes.torus(height * 0.3, 0.005).moved([radius, 0, height / 2], upright)
    parts = [merge([body, handle])]
    for _ in range(int(rng.integers(0, 7))):
        lean = rng.normal(0, 0.5 * radius, 2)
        parts.append(meshes.rod([*(-lean), 0.01], [*(1.6 * lean), height * 1.9], 0.004))
    return merge(parts, keep_slots=False)


def ball(rng: Rng) -> Mesh:
    """A ball, an egg, a cushion, a rounded block."""
    size = rng.uniform(0.05, 0.35) * rng.uniform(0.5, 1.2, 3)
    roundness = (rng.uniform(0.15, 1.6), rng.uniform(0.15, 1.6))
    if rng.random() < 0.25:
        size, roundness = np.full(3, size[0]), (1.0, 1.0)
    return _perhaps_tipped(rng, meshes.superquadric(size, roundness), 0.6).seated()


def ring(rng: Rng) -> Mesh:
    """A ring, a tyre, a hoop; some with spokes."""
    radius = rng.uniform(0.05, 0.3)
    parts = [meshes.torus(radius, radius * rng.uniform(0.03, 0.45))]
    if rng.random() < 0.4:
        count = int(rng.integers(5, 20))
        for angle in np.linspace(0, 2 * np.pi, count, endpoint=False):
            end = radius * np.array([np.cos(angle), np.sin(angle), 0])
            parts.append(meshes.rod([0, 0, 0], end, 0.004).slotted(1))
    return merge(parts).rotated(meshes.random_rotation(rng)).seated()


def blob(rng: Rng) -> Mesh:
    """A stone, a bust, a crumpled thing: a ball pushed in and out by noise."""
    size = rng.uniform(0.1, 0.45) * rng.uniform(0.6, 1, 3)
    base = meshes.superquadric(size, cells=44)
    scale = float(base.size.max())
    push = meshes.waves(rng, base.vertices, scale * rng.uniform(0.3, 1.2), 4)
    if rng.random() < 0.3:
        push = -np.abs(push)  # ridges, as of crumpled paper
    amount = 1 + rng.uniform(0.08, 0.5) * push
    grid = (base.vertices * amount[:, None]).reshape(44, 89, 3)
    return _perhaps_tipped(rng, meshes.sheet(grid, closed=True), 0.5).seated()


def small_thing(rng: Rng) -> Mesh:
    """One of the small objects."""
    return SMALL[rng.integers(len(SMALL))](rng)


def pile(rng: Rng) -> Mesh:
    """Several objects on top of each other."""
    z, parts = 0.0, []
    for _ in range(int(rng.integers(2, 5))):
        kind = carton if rng.random() < 0.6 else small_thing
        turn = meshes.turn_z(rng.uniform(0, 2 * np.pi))
        thing = kind(rng).rotated(turn)
        parts.append(thing.moved([*rng.normal(0, 0.03, 2), z]))
        z += thing.size[2]
    return merge(parts, keep_slots=False)


SMALL: tuple[Builder, ...] = (
    *(carton, carton, cylinder, vase, vase, cup, ball, ring, blob, book_pile),
)
