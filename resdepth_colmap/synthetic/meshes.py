"""Triangle meshes made of a few primitives, with normals and texture coordinates.

All lengths are in metres, z is up. Texture coordinates are in metres too: a texture has
the same scale on every mesh.
"""

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import Matrix

Rng = np.random.Generator
Vector = Sequence[float] | Matrix
Faces = npt.NDArray[np.int64]

_POLE_RADIUS = 1e-4  # a pole keeps a little width, so that its normal is defined


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """Triangles with shading attributes at their vertices.

    Attributes:
        vertices: Corners, shape (V, 3), float64, metres.
        normals: Unit shading normals, shape (V, 3), float64; their sign is arbitrary.
        uv: Texture coordinates, shape (V, 2), float64, metres.
        faces: Vertex indices, shape (F, 3), int64.
        slots: Material slot of each face, shape (F,), int64, from 0.
    """

    vertices: Matrix
    normals: Matrix
    uv: Matrix
    faces: Faces
    slots: Faces

    @property
    def num_slots(self) -> int:
        """Number of material slots."""
        return int(self.slots.max()) + 1

    @property
    def size(self) -> Matrix:
        """Extent of the axis-aligned bounding box, shape (3,), metres."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    def moved(self, shift: Vector, rotation: Matrix | None = None) -> "Mesh":
        """Rotated by a (3, 3) matrix, then shifted."""
        turn = np.eye(3) if rotation is None else rotation
        vertices = self.vertices @ turn.T + np.asarray(shift, dtype=np.float64)
        return dataclasses.replace(
            self, vertices=vertices, normals=self.normals @ turn.T
        )

    def rotated(self, rotation: Matrix) -> "Mesh":
        """Rotated by a (3, 3) matrix about the origin."""
        return self.moved([0, 0, 0], rotation)

    def scaled(self, factor: float) -> "Mesh":
        """Scaled by a factor; the texture keeps its physical size."""
        return dataclasses.replace(
            self, vertices=self.vertices * factor, uv=self.uv * factor
        )

    def slotted(self, slot: int) -> "Mesh":
        """All faces in one material slot."""
        return dataclasses.replace(self, slots=np.full_like(self.slots, slot))

    def seated(self) -> "Mesh":
        """Centred on the z axis, standing on z = 0."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        middle = (low + high) / 2
        return self.moved([-middle[0], -middle[1], -low[2]])


def merge(meshes: Iterable[Mesh], keep_slots: bool = True) -> Mesh:
    """One mesh of many; without `keep_slots` each part gets other slots."""
    faces, slots = [], []
    parts, num_vertices, num_slots = list(meshes), 0, 0
    for part in parts:
        faces.append(part.faces + num_vertices)
        slots.append(part.slots + num_slots)
        num_vertices += len(part.vertices)
        num_slots += 0 if keep_slots else part.num_slots
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uv=np.concatenate([part.uv for part in parts]),
        faces=np.concatenate(faces),
        slots=np.concatenate(slots),
    )


def sheet(points: Matrix, closed: bool = False) -> Mesh:
    """A smooth surface through a grid of points.

    Args:
        points: Grid, shape (R, C, 3), metres.
        closed: The last column repeats the first one (a tube): smooth across it.
    """
    rows, columns, _ = points.shape
    along = np.gradient(points, axis=1)
    if closed:
        seam = (points[:, 1] - points[:, -2]) / 2
        along[:, 0] = along[:, -1] = seam
    normals = np.cross(along, np.gradient(points, axis=0))
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    unit = np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    u, v = _arc_length(points), _arc_length(points.transpose(1, 0, 2))
    index = np.arange(rows * columns).reshape(rows, columns)
    quads = [index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]]
    a, b, c, d = (quad.ravel() for quad in quads)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=2)
    return Mesh(
        vertices=points.reshape(-1, 3).astype(np.float64),
        normals=unit.reshape(-1, 3),
        uv=uv.reshape(-1, 2).astype(np.float64),
        faces=faces,
        slots=np.zeros(len(faces), dtype=np.int64),
    )


def _arc_length(points: Matrix) -> Matrix:
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2).mean(axis=0)
    return np.concatenate([[0.0], np.cumsum(steps)])


def rectangle(corner: Matrix, along_u: Matrix, along_v: Matrix, cell: float) -> Mesh:
    """A flat rectangle in cells of about that size; light is baked at their corners."""
    nu, nv = (
        int(np.clip(np.ceil(np.linalg.norm(side) / cell), 1, 60)) + 1
        for side in (along_u, along_v)
    )
    u, v = np.linspace(0, 1, nu), np.linspace(0, 1, nv)
    grid = corner + u[None, :, None] * along_u + v[:, None, None] * along_v
    return sheet(grid)


def box(size: Vector, cell: float = 0.25) -> Mesh:
    """A box standing on z = 0, centred on the z axis."""
    width, depth, height = (float(side) for side in size)
    x, y, z = np.diag([width, depth, height])
    low = np.array([-width / 2, -depth / 2, 0.0])
    sides = [(low, x, z), (low + y, x, z), (low, y, z), (low + x, y, z)]
    sides += [(low, x, y), (low + z, x, y)]
    return merge(rectangle(*side, cell) for side in sides)


def revolve(profile: Matrix, segments: int = 32) -> Mesh:
    """A surface of revolution; profile (N, 2) is radius and height."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    radius = np.maximum(profile[:, 0], _POLE_RADIUS)[:, None]
    height = np.broadcast_to(profile[:, 1:2], (len(profile), segments + 1))
    grid = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2)
    return sheet(grid, closed=True)


def cylinder(radius: float, height: float, top: float | None = None) -> Mesh:
    """A cylinder, or a cone if the radius at the top differs; closed, on z = 0."""
    upper = radius if top is None else top
    wall = revolve(np.array([[radius, 0.0], [upper, height]]))
    caps = [
        revolve(np.array([[0.0, z], [r, z]]))
        for z, r in ((0.0, radius), (height, upper))
    ]
    return merge([wall, *caps])


def tube(path: Matrix, radius: float | Matrix, sides: int = 10) -> Mesh:
    """A bent tube along a path (N, 3); its radius is constant or of shape (N,)."""
    forward = np.gradient(path, axis=0)
    forward /= np.maximum(np.linalg.norm(forward, axis=1, keepdims=True), 1e-12)
    side = np.empty_like(forward)
    least = np.argmin(np.abs(forward[0]))
    last = np.eye(3)[least]
    for index, direction in enumerate(forward):  # parallel transport: no twist
        last = last - direction * (last @ direction)
        last = last / np.maximum(np.linalg.norm(last), 1e-12)
        side[index] = last
    other = np.cross(forward, side)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[None, :, None]
    reach = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(path))
    ring = np.cos(angle) * side[:, None] + np.sin(angle) * other[:, None]
    return sheet(path[:, None] + reach[:, None, None] * ring, closed=True)


def rod(start: Vector, end: Vector, radius: float) -> Mesh:
    """A straight round bar."""
    path = np.linspace(np.asarray(start, float), np.asarray(end, float), 4)
    return tube(path, radius, sides=8)


def torus(radius: float, thickness: float) -> Mesh:
    """A ring in the xy plane."""
    angle = np.linspace(0, 2 * np.pi, 41)
    path = radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return tube(path, thickness, sides=12)


def superquadric(
    size: Vector, roundness: tuple[float, float] = (1.0, 1.0), cells: int = 28
) -> Mesh:
    """A rounded box (roundness near 0), an ellipsoid (1) or an octahedron (2)."""
    lat = np.linspace(-np.pi / 2 + 1e-3, np.pi / 2 - 1e-3, cells)[:, None]
    lon = np.linspace(-np.pi, np.pi, 2 * cells + 1)[None, :]

    def power(value: Matrix, exponent: float) -> Matrix:
        return np.asarray(np.sign(value) * np.abs(value) ** exponent)

    ring = power(np.cos(lat), roundness[0])
    x = ring * power(np.cos(lon), roundness[1])
    y = ring * power(np.sin(lon), roundness[1])
    z = np.broadcast_to(power(np.sin(lat), roundness[0]), x.shape)
    half = np.asarray(size, dtype=np.float64) / 2
    return sheet(np.stack([x, y, z], axis=2) * half, closed=True)


def waves(rng: Rng, position: Matrix, wavelength: float, octaves: int = 4) -> Matrix:
    """Smooth solid noise, about -1..1: sums of random sine waves.

    Args:
        rng: Source of randomness.
        position: Points, shape (..., D), metres.
        wavelength: Longest wavelength, in metres.
        octaves: Number of octaves; each halves wavelength and amplitude.
    """
    total: Matrix = np.zeros(position.shape[:-1])
    for octave in range(octaves):
        for _ in range(4):
            direction = rng.normal(size=position.shape[-1])
            direction /= float(np.linalg.norm(direction)) * wavelength * 0.5**octave
            angle = 2 * np.pi * (position @ direction + rng.random())
            total += 0.5 ** (octave + 1) * np.sin(angle)
    return total / 1.6


def smooth_path(knots: Matrix, num_points: int = 48) -> Matrix:
    """A Catmull-Rom curve through knots (K, 3), shape (num_points, 3)."""
    ends = np.concatenate(
        [2 * knots[:1] - knots[1:2], knots, 2 * knots[-1:] - knots[-2:-1]]
    )
    time = np.linspace(0, len(knots) - 1 - 1e-9, num_points)
    index = time.astype(int)
    t = (time - index)[:, None]
    a, b, c, d = (ends[index + offset] for offset in range(4))
    linear, square = c - a, 2 * a - 5 * b + 4 * c - d
    cube = 3 * b - a - 3 * c + d
    return np.asarray(0.5 * (2 * b + linear * t + square * t**2 + cube * t**3))


def turn(axis: int, angle: float) -> Matrix:
    """Rotation about a coordinate axis (0 = x, 1 = y, 2 = z), angle in radians."""
    c, s = np.cos(angle), np.sin(angle)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = c
    rotation[first, second], rotation[second, first] = -s, s
    return rotation


def turn_z(angle: float) -> Matrix:
    """Rotation about the vertical, angle in radians."""
    return turn(2, angle)


def random_rotation(rng: Rng) -> Matrix:
    """A uniformly drawn rotation."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) < 0:
        q[:, 0] = -q[:, 0]
    return np.asarray(q, dtype=np.float64)
