"""A room: its mesh, its materials and its lights."""

import dataclasses
import enum

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.synthetic import meshes
from resdepth_colmap.synthetic.layout import fill_room, hang_things, lay_table
from resdepth_colmap.synthetic.meshes import Mesh, Rng
from resdepth_colmap.synthetic.scene_builder import Material, SceneBuilder
from resdepth_colmap.synthetic.textures import Picture
from resdepth_colmap.synthetic.walls import add_shell, dress_walls


class Style(enum.StrEnum):
    """What the cameras look at."""

    ROOM = "room"
    TABLE = "table"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Light:
    """A round lamp: position and radius in metres, color (3,) as power."""

    position: Matrix
    radius: float
    color: Matrix


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """Everything that the cameras can see.

    Attributes:
        mesh: All triangles; the slot of a face is the index of its material.
        materials: The materials.
        textures: Pictures in 0..1 (sRGB), each (S, S, 3) with S a power of two.
        lights: The lamps.
        ambient: Ambient light, shape (3,).
        focus: The point that the cameras face, shape (3,), metres.
        low: Lower corner of the free space, shape (3,), metres.
        high: Upper corner of the free space, shape (3,), metres.
        style: What the cameras look at.
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


def build_room(rng: Rng, style: Style, width_px: int) -> Room:
    """Build a random room.

    Args:
        rng: Source of randomness.
        style: Objects in the room, or on a table.
        width_px: Width of the images; textures are as fine as it requires.
    """
    texels = 2 ** round(np.clip(np.log2(0.8 * width_px), 6, 10))
    builder = SceneBuilder(rng, texels)
    size = rng.uniform([3.0, 3.5, 2.3], [6.0, 7.0, 3.2])
    low, high = size * [-0.5, -0.5, 0], size * [0.5, 0.5, 1]
    add_shell(builder, low, high)
    dress_walls(builder, high)
    on_table = style is Style.TABLE
    focus = lay_table(builder) if on_table else fill_room(builder, low, high)
    hang_things(builder, focus, low, high)
    return Room(
        mesh=meshes.merge(builder.parts),
        materials=builder.materials,
        textures=builder.textures,
        lights=_lights(rng, low, high),
        ambient=rng.uniform(0.1, 0.6) * _warmth(rng),
        focus=focus,
        low=low,
        high=high,
        style=style,
    )


def _warmth(rng: Rng) -> Matrix:
    """A warmer or colder white, shape (3,)."""
    warm = rng.normal(0, 0.12)
    return np.array([1 + warm, 1.0, 1 - warm])


def _lights(rng: Rng, low: Matrix, high: Matrix) -> list[Light]:
    lights = []
    for index in range(int(rng.integers(1, 5))):
        position = rng.uniform(low + 0.3, high - 0.2)
        position[2] = rng.uniform(0.55, 0.95) * high[2]
        power = rng.uniform(1.5, 5.0) if index == 0 else rng.uniform(0.2, 2.5)
        radius = float(np.exp(rng.uniform(np.log(0.03), np.log(0.5))))
        color = power * _warmth(rng)
        lights.append(Light(position=position, radius=radius, color=color))
    return lights
