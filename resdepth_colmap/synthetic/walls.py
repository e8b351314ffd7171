"""The shell of a room, and the objects on its walls."""

import dataclasses

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.synthetic import meshes, objects, thin_objects
from resdepth_colmap.synthetic.meshes import Mesh, Rng
from resdepth_colmap.synthetic.scene_builder import SceneBuilder

_CELL = 0.15  # metres between points where light is baked
_UP = np.array([0.0, 0.0, 1.0])
_SKIRTING = 0.08

_ON_WALLS: tuple[objects.Builder, ...] = (
    thin_objects.picture_frame,
    thin_objects.picture_frame,
    thin_objects.curtain,
    objects.shelf,
    thin_objects.relief,
    thin_objects.lattice,
    thin_objects.pipes,
)


def add_shell(builder: SceneBuilder, low: Matrix, high: Matrix) -> None:
    """Floor, ceiling and four walls between two corners (3,), in metres."""
    rng = builder.rng
    x, y, z = np.diag(high - low)
    builder.add(meshes.rectangle(low, x, y, _CELL), large=True)
    builder.add(meshes.rectangle(low + z, x, y, 2 * _CELL), large=True)
    paint = builder.surface(large=True)
    for corner, along in ((low, x), (low + y, x), (low, y), (low + x, y)):
        inward = np.sign(-corner - along / 2) * (along == 0) * [1, 1, 0]
        wall = _wall(rng, corner, along, z, inward)
        slots = [builder.surface(large=True) for _ in range(wall.num_slots)]
        if rng.random() < 0.65:
            slots[0] = paint
        if wall.num_slots > 2 and rng.random() < 0.4:  # a window by day
            slots[1] = builder.surface(large=True, emission=rng.uniform(0.5, 3))
        builder.add_with(wall, slots)


def _wall(rng: Rng, corner: Matrix, along: Matrix, up: Matrix, inward: Matrix) -> Mesh:
    """A wall with its skirting board; about half also have an opening."""
    if rng.random() < 0.5:
        parts = _open_wall(rng, corner, along, up, inward)
    else:
        parts = [meshes.rectangle(corner, along, up, _CELL)]
    last_slot = max(part.num_slots for part in parts)
    start = corner + inward * 0.015
    skirting = meshes.rectangle(start, along, _SKIRTING * _UP, 2 * _CELL)
    return meshes.merge([*parts, skirting.slotted(last_slot)])


def _open_wall(
    rng: Rng, corner: Matrix, along: Matrix, up: Matrix, inward: Matrix
) -> list[Mesh]:
    """Slot 0: a wall with an alcove, door or window; 1: its back; 2: its sides."""
    length, height = float(np.linalg.norm(along)), float(up[2])
    direction = along / length
    left, right = np.sort(rng.uniform(0.1, 0.9, 2)) * length
    right = min(max(right, left + 0.5), length - 0.05)
    bottom = float(rng.choice([_SKIRTING, 0.3 * height]))
    top = rng.uniform(0.7, 0.9) * height
    back = -inward * rng.uniform(0.08, 0.6)
    beside = [(0.0, left, 0.0, height), (right, length, 0.0, height)]
    between = [(left, right, top, height), (left, right, 0.0, bottom)]
    panels = [_panel(span, corner, direction) for span in beside + between]
    start = corner + left * direction + bottom * _UP
    wide, tall = (right - left) * direction, (top - bottom) * _UP
    pane = meshes.rectangle(start + back, wide, tall, _CELL)
    sides = (
        meshes.rectangle(start, back, tall, _CELL),
        meshes.rectangle(start + wide, back, tall, _CELL),
        meshes.rectangle(start, wide, back, _CELL),
        meshes.rectangle(start + tall, wide, back, _CELL),
    )
    return [*panels, pane.slotted(1), *(side.slotted(2) for side in sides)]


def _panel(
    span: tuple[float, float, float, float], corner: Matrix, direction: Matrix
) -> Mesh:
    """A piece of a wall; the texture continues from piece to piece."""
    u0, u1, v0, v1 = span
    start = corner + u0 * direction + v0 * _UP
    panel = meshes.rectangle(start, (u1 - u0) * direction, (v1 - v0) * _UP, _CELL)
    return dataclasses.replace(panel, uv=panel.uv + np.array([u0, v0]))


def dress_walls(builder: SceneBuilder, high: Matrix) -> None:
    """Add pictures, shelves, curtains and pipes, half of them on the wall at +y.

    Args:
        builder: The scene to add them to.
        high: Upper corner of the room, shape (3,), metres; the lower one mirrors it.
    """
    rng = builder.rng
    for _ in range(int(rng.integers(2, 12))):
        thing = _ON_WALLS[rng.integers(len(_ON_WALLS))](rng)
        free = max(float(high[2] - thing.size[2]), 0.0)
        quarter = int(rng.integers(4)) if rng.random() < 0.5 else 0
        across, away = high[:2] if quarter % 2 == 0 else high[1::-1]
        depth = away - 0.03 - float(thing.vertices[:, 1].max())
        shift = [rng.uniform(-0.8, 0.8) * across, depth, free * rng.random()]
        turn = meshes.turn_z(quarter * np.pi / 2)
        builder.add(thing.moved(shift).rotated(turn))
