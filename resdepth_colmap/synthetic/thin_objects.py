"""Objects that are hard for stereo: thin, bent or hanging."""

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.synthetic import meshes, objects
from resdepth_colmap.synthetic.meshes import Mesh, Rng, merge


def pipes(rng: Rng) -> Mesh:
    """Bent pipes along the axes, with flanges."""
    parts = []
    for _ in range(int(rng.integers(1, 4))):
        radius = rng.uniform(0.008, 0.06)
        knots = [rng.uniform([-0.3, -0.3, 0.1], [0.3, 0.3, 0.7])]
        for _ in range(int(rng.integers(2, 7))):
            axis, sign = np.eye(3)[rng.integers(3)], rng.choice([-1, 1])
            knots.append(knots[-1] + axis * sign * rng.uniform(0.15, 0.7))
        path = _rounded(np.array(knots), radius * 3)
        parts.append(meshes.tube(path, radius, sides=14))
        if rng.random() < 0.5:
            bumps = np.where(rng.random(len(path)) < 0.1, 1.25, 1.0)
            parts[-1] = meshes.tube(path, radius * bumps, sides=14)
    return merge(parts, keep_slots=False).seated()


def _rounded(knots: Matrix, radius: float) -> Matrix:
    """A path with rounded corners."""
    points = [knots[0]]
    for before, corner, after in zip(knots, knots[1:], knots[2:], strict=False):
        reach = min(radius, 0.45 * float(np.linalg.norm(before - corner)))
        reach = min(reach, 0.45 * float(np.linalg.norm(after - corner)))
        start = corner + reach * _unit(before - corner)
        end = corner + reach * _unit(after - corner)
        for t in np.linspace(0, 1, 7):
            points.append((1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end)
    points.append(knots[-1])
    return np.array(points)


def _unit(vector: Matrix) -> Matrix:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))


def plant(rng: Rng) -> Mesh:
    """A pot with many leaves on stems, or many blades of grass."""
    pot_height = rng.uniform(0.08, 0.25)
    rim = pot_height * rng.uniform(0.45, 0.7)
    pot = meshes.cylinder(pot_height * 0.4, pot_height, rim)
    height = rng.uniform(0.2, 0.9)
    leaf_length, leaf_width = rng.uniform([0.06, 0.15], [0.3, 0.6])
    parts = []
    for _ in range(int(rng.integers(8, 45))):
        out = np.array([*rng.normal(0, 0.25, 2), rng.uniform(0.3, 1)]) * height
        start = np.array([*rng.normal(0, 0.02, 2), pot_height * 0.9])
        knots = np.array([start, start + out * [0.3, 0.3, 0.6], start + out])
        stem = meshes.tube(meshes.smooth_path(knots, 8), 0.003, sides=5)
        direction = _unit(out * [1, 1, rng.uniform(-0.6, 0.8)])
        leaf = _leaf(rng, start + out, direction, leaf_length, leaf_width)
        parts += [stem.slotted(1), leaf.slotted(2)]
    return merge([pot, *parts])


def _leaf(
    rng: Rng, base: Matrix, direction: Matrix, length: float, width: float
) -> Mesh:
    t = np.linspace(0, 1, 9)[:, None]
    s = np.linspace(-1, 1, 5)[None, :]
    side = _unit(np.cross(direction, rng.normal(size=3)))
    up = np.cross(side, direction)
    breadth = length * width * 0.5 * np.sin(np.pi * np.clip(t, 0.03, 0.97)) ** 0.8
    droop = -rng.uniform(0, 0.6) * length * t**2 + rng.uniform(0, 0.5) * breadth * s**2
    along = length * t + 0 * s
    grid = base + along[..., None] * direction + (breadth * s)[..., None] * side
    return meshes.sheet(grid + droop[..., None] * up)


def lamp(rng: Rng) -> Mesh:
    """A foot, a rod and an open shade."""
    height, shade = rng.uniform([0.3, 0.08], [1.6, 0.22])
    foot = meshes.cylinder(shade * 0.8, 0.03)
    stem = meshes.rod([0, 0, 0], [0, 0, height], rng.uniform(0.006, 0.02))
    low, high = shade, shade * rng.uniform(0.3, 1)
    top = shade * 1.5
    profile = np.array([[low, 0], [high, top], [high * 0.97, top], [low * 0.97, 0]])
    cover = meshes.revolve(profile).moved([0, 0, height - shade * 0.5])
    return merge([foot, stem, cover.slotted(1)])


def easel(rng: Rng) -> Mesh:
    """A picture in its frame on three legs."""
    height = rng.uniform(0.5, 1.5)
    foot = height * 0.3
    tips = np.array([[-foot, -foot, 0], [foot, -foot, 0], [0, foot, 0]])
    legs = [meshes.rod(tip, [0, 0, height], 0.012).slotted(2) for tip in tips]
    board = picture_frame(rng).seated().moved([0, -foot * 0.7, height * 0.35])
    return merge([board, *legs])


def picture_frame(rng: Rng) -> Mesh:
    """A framed picture; its back lies in the plane y = 0."""
    width, height = rng.uniform(0.15, 0.9, 2)
    rim, deep = rng.uniform([0.01, 0.01], [0.06, 0.05])
    side = (width + rim) / 2
    across = meshes.box([width + 2 * rim, deep, rim])
    up = meshes.box([rim, deep, height])
    edges = [(across, 0, -rim), (across, 0, height), (up, -side, 0), (up, side, 0)]
    frame = merge(edge.moved([x, -deep / 2, z]) for edge, x, z in edges)
    panel = meshes.box([width, 0.008, height]).moved([0, -0.004, 0])
    return merge([panel, frame.slotted(1)])


def curtain(rng: Rng) -> Mesh:
    """A hanging cloth with folds, in the plane y = 0."""
    width, height = rng.uniform([0.4, 0.8], [1.8, 2.2])
    x = np.linspace(-width / 2, width / 2, 90)[None, :]
    z = np.linspace(0, height, 20)[:, None]
    position = np.stack(np.broadcast_arrays(x * 1.0, z * 0.25), axis=2)
    fold = meshes.waves(rng, position, rng.uniform(0.12, 0.6), 3)
    depth = rng.uniform(0.02, 0.08) * fold * (1.2 - 0.6 * z / height)
    return meshes.sheet(np.stack(np.broadcast_arrays(x, depth, z), axis=2))


def cloth(rng: Rng) -> Mesh:
    """A crumpled cloth, flat or over something round."""
    side = rng.uniform(0.25, 0.9)
    line = np.linspace(-side / 2, side / 2, 60)
    x, y = np.meshgrid(line, line * rng.uniform(0.5, 1))
    position = np.stack([x, y], axis=2)
    wrinkle = meshes.waves(rng, position, side * rng.uniform(0.3, 0.9), 4)
    hill = np.exp(-(x**2 + y**2) / (0.1 * side**2)) * rng.uniform(0, 0.3)
    z = np.maximum(0.02 + hill + side * rng.uniform(0.02, 0.12) * wrinkle, 0.003 * side)
    return meshes.sheet(np.stack([x, y, z], axis=2))


def relief(rng: Rng) -> Mesh:
    """A mask or a relief board, upright, with its back towards +y."""
    width, height = rng.uniform(0.15, 0.6, 2)
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, 64), np.linspace(0, 1, 64))
    bulge = np.zeros_like(x)
    for _ in range(int(rng.integers(2, 14))):
        cx, cz = rng.uniform([-0.45, 0.05], [0.45, 0.95])
        spread = rng.uniform(0.002, 0.03)
        mirror = rng.random() < 0.5
        for sign in (-1, 1) if mirror else (1,):
            distance2 = (x - sign * cx) ** 2 + (z - cz) ** 2
            bulge += rng.normal(0, 0.12) * np.exp(-distance2 / spread)
    bulge += 0.3 * np.sqrt(np.clip(0.25 - x**2, 0, 1)) * rng.integers(0, 2)
    grid = np.stack([x * width, -bulge * min(width, height), z * height], axis=2)
    back = meshes.box([width, 0.02, height]).moved([0, 0.03, 0])
    return merge([meshes.sheet(grid), back])


def wires(rng: Rng) -> Mesh:
    """Cables or ropes lying about and hanging in the air."""
    parts = []
    for _ in range(int(rng.integers(1, 5))):
        spread = rng.uniform(0.15, 0.6)
        knots = rng.uniform(-spread, spread, (int(rng.integers(4, 9)), 3))
        knots[:, 2] = np.abs(knots[:, 2]) * rng.choice([0.05, 0.5, 1.5]) + 0.01
        path = meshes.smooth_path(knots, 80)
        parts.append(meshes.tube(path, rng.uniform(0.002, 0.012), 7))
    return merge(parts)


def stairs(rng: Rng) -> Mesh:
    """A few steps."""
    width, tread, rise = rng.uniform([0.3, 0.1, 0.05], [0.9, 0.28, 0.18])
    count = int(rng.integers(3, 7))
    return merge(
        meshes.box([width, tread, rise * (i + 1)]).moved([0, i * tread, 0])
        for i in range(count)
    ).seated()


def lattice(rng: Rng) -> Mesh:
    """A grid of bars: a fence, a drying rack, a cage side, a ladder, a radiator."""
    width, height = rng.uniform([0.2, 0.3], [1.0, 1.4])
    radius = rng.uniform(0.003, 0.016)
    across, up = int(rng.integers(2, 12)), int(rng.integers(2, 12))
    parts = [
        meshes.rod([x, 0, 0], [x, 0, height], radius)
        for x in np.linspace(-width / 2, width / 2, across)
    ]
    parts += [
        meshes.rod([-width / 2, 0, z], [width / 2, 0, z], radius)
        for z in np.linspace(height * 0.05, height, up)
    ]
    return merge(parts).rotated(meshes.turn(0, rng.uniform(-0.3, 0.3))).seated()


def basket(rng: Rng) -> Mesh:
    """A wire basket or a cage, round."""
    radius, height = rng.uniform([0.08, 0.08], [0.25, 0.4])
    hoops = [
        meshes.torus(radius, 0.005).moved([0, 0, z])
        for z in np.linspace(0.005, height, int(rng.integers(2, 6)))
    ]
    angles = np.linspace(0, 2 * np.pi, int(rng.integers(8, 30)), endpoint=False)
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bars = [meshes.rod([*xy, 0], [*xy, height], 0.004) for xy in ring]
    return merge([*hoops, *bars])


def toy(rng: Rng) -> Mesh:
    """A figure of balls, blocks and sticks round a body."""
    body = meshes.superquadric(rng.uniform(0.1, 0.25, 3), (rng.uniform(0.2, 1), 1.0))
    parts = [body]
    for _ in range(int(rng.integers(3, 10))):
        end = _unit(rng.normal(size=3)) * rng.uniform(0.1, 0.28)
        parts.append(meshes.rod([0, 0, 0], end, rng.uniform(0.006, 0.03)))
        size, roundness = rng.uniform(0.02, 0.12, 3), rng.uniform(0.2, 1.2, 2)
        tip = meshes.superquadric(size, tuple(roundness), 14)
        parts.append(tip.moved(end, meshes.random_rotation(rng)))
    return merge(parts, keep_slots=False).seated()


THIN: tuple[objects.Builder, ...] = (
    *(pipes, pipes, plant, plant, plant, lamp, easel, cloth, relief, relief, wires),
    *(stairs, lattice, lattice, basket, toy, toy),
)
FURNITURE: tuple[objects.Builder, ...] = (
    *(objects.table, objects.table, objects.chair, objects.chair, objects.chair),
    *(objects.shelf, objects.shelf),
)
