"""A room or a table top full of things, its surfaces and its lights."""

import dataclasses
import enum

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.training import meshes, objects, thin_objects
from resdepth_colmap.training.meshes import Mesh, Rng
from resdepth_colmap.training.patterns import random_texture
from resdepth_colmap.training.textures import Picture

_OBJECT_TEXELS = 512
_WALL_TEXELS = 1024


class Style(enum.StrEnum):
    """What is photographed."""

    ROOM = "room"
    TABLE = "table"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """How one surface looks.

    Attributes:
        texture: Index of its texture.
        tint: Multiplies the texture, shape (3,).
        span: Side of one repeat of the texture, in metres.
        offset: Where the texture begins, shape (2,), in metres.
        gloss: Strength of highlights and reflections, 0..1.
        shininess: Phong exponent of the highlight.
        emission: Light of its own, in units of white.
    """

    texture: int
    tint: Matrix
    span: float
    offset: Matrix
    gloss: float = 0.0
    shininess: float = 30.0
    emission: float = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """A round lamp: position and radius in metres, color (3,) as power."""

    position: Matrix
    radius: float
    color: Matrix


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """Everything that can be seen.

    Attributes:
        mesh: All triangles; a face's slot is the index of its material.
        materials: The materials.
        textures: Pictures in 0..1 (sRGB), each (S, S, 3) with S a power of two.
        lights: The lamps.
        ambient: Light from everywhere, shape (3,).
        focus: Where the things are, shape (3,), metres.
        low: Lower corner of the free space, shape (3,), metres.
        high: Upper corner of the free space, shape (3,), metres.
        style: What kind of place it is.
    """

    mesh: Mesh
    materials: list[Material]
    textures: list[Picture]
    lights: list[Light]
    ambient: Matrix
    focus: Matrix
    low: Matrix
    high: Matrix
    style: Style


class _Furnisher:
    """Collects meshes and gives their slots materials."""

    def __init__(self, rng: Rng) -> None:
        self.rng = rng
        self.parts: list[Mesh] = []
        self.materials: list[Material] = []
        weak = rng.choice([0.12, 0.35, 0.35, 0.6])
        self.textures = [
            random_texture(rng, _OBJECT_TEXELS, weak)
            for _ in range(int(rng.integers(18, 30)))
        ]
        self.num_small = len(self.textures)
        wall_weak = rng.choice([0.25, 0.55, 0.85])
        self.textures += [
            random_texture(rng, _WALL_TEXELS, wall_weak, 0.2) for _ in range(5)
        ]

    def surface(self, large: bool = False, emission: float = 0.0) -> int:
        """A new material; its index."""
        rng = self.rng
        last = len(self.textures)
        texture = rng.integers(self.num_small, last) if large else rng.integers(last)
        glossy = rng.random() < (0.2 if large else 0.4)
        span = (
            rng.uniform(0.6, 3.0)
            if large
            else np.exp(rng.uniform(np.log(0.1), np.log(1.2)))
        )
        self.materials.append(
            Material(
                texture=int(texture),
                tint=rng.uniform(0.6, 1.1) * rng.uniform(0.8, 1.1, 3),
                span=float(span),
                offset=rng.uniform(0, 3, 2),
                gloss=float(rng.uniform(0.03, 0.5)) if glossy else 0.0,
                shininess=float(np.exp(rng.uniform(1.6, 5.5))),
                emission=emission,
            )
        )
        return len(self.materials) - 1

    def add(self, mesh: Mesh, large: bool = False, emission: float = 0.0) -> None:
        """Put a mesh in, each of its slots with a material of its own."""
        table = [self.surface(large, emission) for _ in range(mesh.num_slots)]
        self.parts.append(dataclasses.replace(mesh, slots=np.array(table)[mesh.slots]))


def furnish(rng: Rng, style: Style) -> Room:
    """A random place of that style.

    Args:
        rng: Everything random comes from it.
        style: A room, or a table top with a board behind it.
    """
    furnisher = _Furnisher(rng)
    size = rng.uniform([3.0, 3.5, 2.3], [6.0, 7.0, 3.2])
    low, high = size * [-0.5, -0.5, 0], size * [0.5, 0.5, 1]
    _add_shell(furnisher, low, high)
    _dress_walls(furnisher, low, high)
    if style is Style.TABLE:
        focus = _lay_table(furnisher, low, high)
    else:
        focus = _fill_room(furnisher, low, high)
    _hang_things(furnisher, focus, low, high)
    return Room(
        mesh=meshes.merge(furnisher.parts),
        materials=furnisher.materials,
        textures=furnisher.textures,
        lights=_lights(rng, low, high),
        ambient=rng.uniform(0.1, 0.6) * _warmth(rng),
        focus=focus,
        low=low,
        high=high,
        style=style,
    )


def _add_shell(furnisher: _Furnisher, low: Matrix, high: Matrix) -> None:
    rng = furnisher.rng
    x, y, z = np.diag(high - low)
    furnisher.add(meshes.rectangle(low, x, y, 0.12), large=True)
    furnisher.add(meshes.rectangle(low + z, x, y, 0.3), large=True)
    walls = [(low, x), (low + y, x), (low, y), (low + x, y)]
    shared = furnisher.surface(large=True)
    for corner, along in walls:
        inward = np.sign(-corner - along / 2) * (along == 0) * [1, 1, 0]
        wall = _wall(rng, corner, along, z, inward)
        if rng.random() < 0.65:
            table = [shared] + [
                furnisher.surface(large=True) for _ in range(wall.num_slots - 1)
            ]
            furnisher.parts.append(
                dataclasses.replace(wall, slots=np.array(table)[wall.slots])
            )
        else:
            furnisher.add(wall, large=True)


def _wall(rng: Rng, corner: Matrix, along: Matrix, up: Matrix, inward: Matrix) -> Mesh:
    """A wall; about half have an alcove or a window, and a skirting board."""
    length, height = float(np.linalg.norm(along)), float(up[2])
    direction = along / length
    parts = []
    if rng.random() < 0.5:
        left, right = np.sort(rng.uniform(0.1, 0.9, 2)) * length
        right = min(max(right, left + 0.5), length - 0.05)
        bottom, top = rng.choice([0.0, 0.3]) * height, rng.uniform(0.7, 0.9) * height
        back = -inward * rng.uniform(0.08, 0.6)
        floor_up = np.array([0, 0, 1.0])
        spans = [(0.0, left, 0.0, height), (right, length, 0.0, height)]
        spans += [(left, right, top, height)] + (
            [(left, right, 0.0, bottom)] if bottom else []
        )
        for u0, u1, v0, v1 in spans:
            start = corner + u0 * direction + v0 * floor_up
            panel = meshes.rectangle(
                start, (u1 - u0) * direction, (v1 - v0) * floor_up, 0.15
            )
            shift = dataclasses.replace(panel, uv=panel.uv + [u0, v0])
            parts.append(shift)
        start = corner + left * direction + bottom * floor_up
        wide, tall = (right - left) * direction, (top - bottom) * floor_up
        parts.append(meshes.rectangle(start + back, wide, tall, 0.15).slotted(1))
        for side in (
            (start, back, tall),
            (start + wide, back, tall),
            (start, wide, back),
        ):
            parts.append(meshes.rectangle(*side, 0.15).slotted(2))
        parts.append(meshes.rectangle(start + tall, wide, back, 0.15).slotted(2))
    else:
        parts.append(meshes.rectangle(corner, along, up, 0.15))
    skirting = meshes.rectangle(
        corner + inward * 0.015, along, np.array([0, 0, 0.08]), 0.3
    )
    return meshes.merge([*parts, skirting.slotted(3 if len(parts) > 1 else 1)])


def _dress_walls(furnisher: _Furnisher, low: Matrix, high: Matrix) -> None:
    rng = furnisher.rng
    on_walls = (
        thin_objects.picture_frame,
        thin_objects.picture_frame,
        thin_objects.curtain,
    )
    on_walls += (
        objects.shelf,
        thin_objects.relief,
        thin_objects.lattice,
        thin_objects.pipes,
    )
    for _ in range(int(rng.integers(2, 12))):
        thing = on_walls[rng.integers(len(on_walls))](rng)
        room = high[2] - thing.size[2]
        raised = thing.moved(
            [0, -0.03 - thing.vertices[:, 1].max(), max(room, 0) * rng.random()]
        )
        quarter = int(rng.integers(4)) if rng.random() < 0.5 else 0
        across, away = (high[0], high[1]) if quarter % 2 == 0 else (high[1], high[0])
        moved = raised.moved([rng.uniform(-0.8, 0.8) * across, away, 0])
        furnisher.add(moved.moved([0, 0, 0], meshes.turn_z(quarter * np.pi / 2)))


def _fill_room(furnisher: _Furnisher, low: Matrix, high: Matrix) -> Matrix:
    """Furniture and clutter on the floor; the camera will look along +y."""
    rng = furnisher.rng
    depth = rng.uniform(-0.1, 0.5) * high[1]
    focus = np.array([rng.uniform(-0.3, 0.3) * high[0], depth, rng.uniform(0.4, 0.9)])
    kinds = (
        *thin_objects.FURNITURE,
        *thin_objects.FURNITURE,
        *thin_objects.THIN,
        objects.pile,
    )
    for _ in range(int(rng.integers(7, 20))):
        thing = kinds[rng.integers(len(kinds))](rng)
        place = _spot(rng, focus, low, high)
        turn = meshes.turn_z(rng.uniform(0, 2 * np.pi))
        furnisher.add(thing.moved([*place, 0], turn))
        top = float(thing.size[2])
        if top < 1.2 and rng.random() < 0.6:
            for _ in range(int(rng.integers(1, 6))):
                small = objects.small_thing(rng)
                furnisher.add(
                    small.moved([*(place + rng.normal(0, 0.15, 2)), top * 0.99])
                )
    for _ in range(int(rng.integers(5, 25))):
        pool = objects.SMALL if rng.random() < 0.6 else thin_objects.THIN
        thing = pool[rng.integers(len(pool))](rng)
        turn = meshes.turn_z(rng.uniform(0, 2 * np.pi))
        furnisher.add(thing.moved([*_spot(rng, focus, low, high), 0], turn))
    return focus


def _spot(rng: Rng, focus: Matrix, low: Matrix, high: Matrix) -> Matrix:
    spot = focus[:2] + rng.normal(0, 1, 2) * [0.9, 0.9]
    spot[1] = max(
        spot[1], focus[1] - rng.uniform(0.2, 1.3)
    )  # leave the camera's side free
    return np.asarray(np.clip(spot, low[:2] + 0.25, high[:2] - 0.25))


def _lay_table(furnisher: _Furnisher, low: Matrix, high: Matrix) -> Matrix:
    """A slab with props and mostly a board or cloth behind them."""
    rng = furnisher.rng
    top, width, depth = rng.uniform([0.4, 1.2, 0.8], [0.9, 2.6, 1.6])
    slab = meshes.box([width, depth, 0.04], cell=0.06)
    furnisher.add(slab.moved([0, 0, top - 0.04]), large=bool(rng.random() < 0.7))
    for x in (-0.45, 0.45):
        furnisher.add(
            meshes.box([0.08, depth * 0.9, top - 0.05]).moved([x * width, 0, 0])
        )
    _add_backdrop(furnisher, width, depth, top)
    pools = (
        objects.SMALL,
        objects.SMALL,
        thin_objects.THIN,
        (objects.books, objects.pile),
    )
    count = int(rng.integers(8, 36))
    for _ in range(count):
        pool = pools[rng.integers(len(pools))]
        thing = pool[rng.integers(len(pool))](rng)
        thing = thing.scaled(min(1.0, rng.uniform(0.25, 0.8) / float(thing.size.max())))
        turn = meshes.turn_z(
            rng.normal(0, 0.5) if rng.random() < 0.5 else rng.uniform(0, 6.3)
        )
        place = rng.uniform(-0.5, 0.5, 2) * [width * 0.85, depth * 0.9]
        raised = rng.uniform(0, 0.3) if rng.random() < 0.08 else 0.0
        furnisher.add(thing.moved([*place, top + raised], turn))
    return np.array(
        [0.0, rng.uniform(-0.1, 0.2) * depth, top + rng.uniform(0.05, 0.25)]
    )


def _add_backdrop(
    furnisher: _Furnisher, width: float, depth: float, top: float
) -> None:
    rng = furnisher.rng
    behind = depth / 2 + rng.uniform(0.0, 0.5)
    kind = rng.random()
    if kind < 0.5:
        lean = rng.normal(0, 0.15)
        turn = meshes.turn_z(rng.normal(0, 0.2))
        turn = turn @ np.array(
            [
                [1, 0, 0],
                [0, np.cos(lean), -np.sin(lean)],
                [0, np.sin(lean), np.cos(lean)],
            ]
        )
        size = rng.uniform([0.8, 0.02, 0.5], [2.5, 0.03, 1.3])
        furnisher.add(
            meshes.box(size, 0.12).moved([rng.normal(0, 0.2), behind, top], turn),
            large=True,
        )
    elif kind < 0.75:
        curtain = thin_objects.curtain(rng)
        furnisher.add(
            curtain.moved([rng.normal(0, 0.3), behind, top * 0.5]), large=True
        )
    for _ in range(int(rng.integers(0, 5))):
        tall = (
            thin_objects.lattice,
            objects.chair,
            objects.shelf,
            thin_objects.plant,
            thin_objects.easel,
        )
        thing = tall[rng.integers(len(tall))](rng)
        spot = [rng.uniform(-0.6, 0.6) * width, behind + rng.uniform(0.2, 0.8), 0]
        furnisher.add(thing.moved(spot, meshes.turn_z(rng.uniform(0, 6.3))))


def _hang_things(
    furnisher: _Furnisher, focus: Matrix, low: Matrix, high: Matrix
) -> None:
    """Some things in the air: depth there knows no floor."""
    rng = furnisher.rng
    count = int(rng.integers(1, 9)) if rng.random() < 0.4 else 0
    for _ in range(count):
        pool = thin_objects.THIN if rng.random() < 0.5 else objects.SMALL
        thing = pool[rng.integers(len(pool))](rng).seated()
        thing = thing.moved([0, 0, 0], meshes.random_rotation(rng)).seated()
        room = max(float(high[2] - thing.size[2]), 0.1)
        place = focus + rng.normal(0, 1, 3) * [0.6, 0.4, 0.5]
        place[1] = max(place[1], focus[1] - 0.3)
        place[2] = np.clip(place[2], 0.05, room)
        furnisher.add(thing.moved(np.clip(place, low + 0.2, high - 0.2)))


def _warmth(rng: Rng) -> Matrix:
    """The colour of a lamp or of daylight, about white."""
    warm = rng.normal(0, 0.12)
    return np.array([1 + warm, 1.0, 1 - warm])


def _lights(rng: Rng, low: Matrix, high: Matrix) -> list[Light]:
    lights = []
    for index in range(int(rng.integers(1, 5))):
        position = rng.uniform(low + 0.3, high - 0.2)
        position[2] = rng.uniform(0.55, 0.95) * high[2]
        power = rng.uniform(1.5, 5.0) if index == 0 else rng.uniform(0.2, 2.5)
        radius = float(np.exp(rng.uniform(np.log(0.03), np.log(0.5))))
        lights.append(
            Light(position=position, radius=radius, color=power * _warmth(rng))
        )
    return lights
