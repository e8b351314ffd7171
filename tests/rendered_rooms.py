"""Small rendered rooms, each rendered once for all tests of a run."""

import functools
from typing import Any
from unittest import mock

from resdepth_colmap.config import SynthesisConfig
from resdepth_colmap.synthetic import synthesize
from resdepth_colmap.synthetic.render import Tracer
from resdepth_colmap.synthetic.room import Room
from resdepth_colmap.synthetic.synthesize import RenderedScene

CONFIG = SynthesisConfig(num_views=2, width_px=96, height_px=64)
SEED = 3
OTHER_SEED = 1


def rendered(seed: int = SEED) -> RenderedScene:
    """The room of that seed in two views of 96 x 64 pixels."""
    return _rendered(seed)[0]


def room_of(seed: int = SEED) -> Room:
    """What was rendered: meshes, materials, lamps."""
    return _rendered(seed)[1]


@functools.cache
def _rendered(seed: int) -> tuple[RenderedScene, Room]:
    rooms: list[Room] = []

    def remember(room: Room, *options: Any) -> Tracer:
        rooms.append(room)
        return Tracer(room, *options)

    with mock.patch.object(synthesize, "Tracer", remember):
        scene = synthesize.render_room(CONFIG, seed)
    return scene, rooms[0]
