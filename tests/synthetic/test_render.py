"""Laws of the ray caster: depth as in closed form, and rooms without a way out."""

import dataclasses

import numpy as np
import pytest
from analytic_scene import depth_of_plane, turned, view_at
from rendered_rooms import room_of

from resdepth_colmap.scene import Camera, View
from resdepth_colmap.synthetic import meshes
from resdepth_colmap.synthetic.meshes import Mesh
from resdepth_colmap.synthetic.render import Tracer
from resdepth_colmap.synthetic.room import Light, Room, Style

CAMERA = Camera(width_px=48, height_px=32, fx=40.0, fy=42.0, cx=23.0, cy=16.7)
WIDE = Camera(width_px=32, height_px=32, fx=16.0, fy=16.0, cx=16.0, cy=16.0)


def _room(mesh: Mesh, ambient: float = 0.5, power: float = 0.0) -> Room:
    """A mesh in one grey material, with a lamp at (0, 0, -1)."""
    paint = dataclasses.replace(
        room_of().materials[0], texture=0, tint=np.ones(3), gloss=0.0, emission=0.0
    )
    lamp = Light(position=np.array([0, 0, -1.0]), radius=0.1, color=np.full(3, power))
    return Room(
        mesh=mesh.slotted(0),
        materials=[paint],
        textures=[np.full((8, 8, 3), 0.5, dtype=np.float32)],
        lights=[lamp],
        ambient=np.full(3, ambient),
        focus=np.zeros(3),
        low=np.full(3, -2.0),
        high=np.full(3, 2.0),
        style=Style.ROOM,
    )


def _square(z: float, half: float) -> Mesh:
    corner = np.array([-half, -half, z])
    side = 2 * half * np.eye(3)
    return meshes.rectangle(corner, side[0], side[1], cell=half)


def _six_views(center: tuple[float, float, float]) -> list[View]:
    """Six views of 90 degrees: together they see everything round a point."""
    half = np.pi / 2
    turns = [(0.0, index * half) for index in range(4)] + [(half, 0.0), (-half, 0.0)]
    return [view_at(center, WIDE, turned(*turn)) for turn in turns]


def test_depth_of_a_slanted_wall_is_that_of_the_closed_form() -> None:
    view = view_at((0.2, -0.1, 0.3), CAMERA, turned(0.2, -0.35))
    depth = Tracer(_room(_square(3.0, 20.0))).depth(view)
    expected = depth_of_plane(view, np.array([0, 0, 1.0]), 3.0)
    np.testing.assert_allclose(depth, expected, rtol=1e-5)


def test_a_ray_that_meets_nothing_has_no_depth_and_no_light() -> None:
    tracer = Tracer(_room(_square(2.0, 0.5)))
    view = view_at((0.0, 0.0, 0.0), CAMERA)
    depth, light = tracer.depth(view), tracer.radiance(view)
    assert depth[0, 0] == 0
    assert depth[16, 23] == pytest.approx(2.0, rel=1e-6)
    assert not light[0, 0].any()
    assert light[16, 23].all()


def test_a_thing_before_the_lamp_casts_a_shadow() -> None:
    wall = _square(2.0, 4.0)
    view = view_at((0.0, 1.5, 1.0), CAMERA)
    bright = Tracer(_room(wall, 0.0, 5.0)).radiance(view)
    between = _square(0.0, 3.0)
    dark = Tracer(_room(meshes.merge([wall, between]), 0.0, 5.0)).radiance(view)
    assert bright.min() > 0
    assert dark.max() == 0


def test_twice_the_light_is_twice_as_bright() -> None:
    view = view_at((0.0, 0.0, 0.0), CAMERA)
    once, twice = (
        Tracer(_room(_square(2.0, 4.0), 0.2 * factor, factor)).radiance(view)
        for factor in (1.0, 2.0)
    )
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-5)


def test_no_ray_finds_a_way_out_of_a_room() -> None:
    room = room_of()
    shell = dataclasses.replace(
        _room(room.mesh), focus=room.focus, low=room.low, high=room.high
    )
    tracer = Tracer(shell)  # its geometry is that of the room; its paint is not asked
    middle = (room.low + room.high) / 2
    for view in _six_views((float(middle[0]), float(middle[1]), float(middle[2]))):
        depth = tracer.depth(view)
        assert depth.min() > 0
        assert depth.max() < np.linalg.norm(room.high - room.low) + 1
