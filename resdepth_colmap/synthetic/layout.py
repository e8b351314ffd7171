"""The layout of a scene: objects on the floor or on a table, stacked or in the air."""

from collections.abc import Sequence

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.synthetic import meshes, objects, thin_objects
from resdepth_colmap.synthetic.meshes import Mesh, Rng
from resdepth_colmap.synthetic.objects import SMALL, Builder
from resdepth_colmap.synthetic.scene_builder import SceneBuilder
from resdepth_colmap.synthetic.thin_objects import FURNITURE, THIN

_ROWS: tuple[Builder, ...] = (objects.books, objects.pile)
_BEHIND_TABLES: tuple[Builder, ...] = (
    thin_objects.lattice,
    objects.chair,
    objects.shelf,
    thin_objects.plant,
    thin_objects.easel,
)


def _any(rng: Rng, builders: Sequence[Builder]) -> Mesh:
    return builders[int(rng.integers(len(builders)))](rng)


def _any_turn(rng: Rng) -> Matrix:
    return meshes.turn_z(rng.uniform(0, 2 * np.pi))


def fill_room(builder: SceneBuilder, low: Matrix, high: Matrix) -> Matrix:
    """Put furniture and small objects on the floor, most of them near a focus.

    Args:
        builder: The scene to add them to.
        low: Lower corner of the room, shape (3,), metres.
        high: Upper corner.

    Returns:
        The focus, shape (3,), metres; the camera faces it roughly along +y.
    """
    rng = builder.rng
    depth = rng.uniform(-0.1, 0.5) * high[1]
    focus = np.array([rng.uniform(-0.3, 0.3) * high[0], depth, rng.uniform(0.4, 0.9)])
    kinds = (*FURNITURE, *FURNITURE, *THIN, objects.pile)
    for _ in range(int(rng.integers(7, 20))):
        thing = _any(rng, kinds)
        xy = _spot(rng, focus, low, high)
        builder.add(thing.moved([*xy, 0], _any_turn(rng)))
        if thing.size[2] < 1.2 and rng.random() < 0.6:
            _put_on_top(builder, xy, float(thing.size[2]))
    for _ in range(int(rng.integers(5, 25))):
        thing = _any(rng, SMALL if rng.random() < 0.6 else THIN)
        xy = _spot(rng, focus, low, high)
        builder.add(thing.moved([*xy, 0], _any_turn(rng)))
    return focus


def _put_on_top(builder: SceneBuilder, xy: Matrix, height: float) -> None:
    rng = builder.rng
    for _ in range(int(rng.integers(1, 6))):
        x, y = xy + rng.normal(0, 0.15, 2)
        builder.add(objects.small_thing(rng).moved([x, y, height * 0.99]))


def _spot(rng: Rng, focus: Matrix, low: Matrix, high: Matrix) -> Matrix:
    """A point on the floor, shape (2,), seldom on the camera's side of the focus."""
    x, y = focus[:2] + rng.normal(0, 0.9, 2)
    y = max(y, focus[1] - rng.uniform(0.2, 1.3))
    return np.asarray(np.clip([x, y], low[:2] + 0.25, high[:2] - 0.25))


def lay_table(builder: SceneBuilder) -> Matrix:
    """Add a table with objects on it, and mostly a board or a curtain behind them.

    Returns:
        The focus among the objects, shape (3,), metres.
    """
    rng = builder.rng
    top, width, depth = rng.uniform([0.4, 1.2, 0.8], [0.9, 2.6, 1.6])
    slab = meshes.box([width, depth, 0.04], cell=0.06)
    builder.add(slab.moved([0, 0, top - 0.04]), large=bool(rng.random() < 0.7))
    for x in (-0.45 * width, 0.45 * width):
        leg = meshes.box([0.08, depth * 0.9, top - 0.05])
        builder.add(leg.moved([x, 0, 0]))
    _add_backdrop(builder, depth / 2 + rng.uniform(0.0, 0.5), top)
    for _ in range(int(rng.integers(0, 5))):
        x, y = rng.uniform([-0.6 * width, depth / 2 + 0.2], [0.6 * width, depth + 0.5])
        thing = _any(rng, _BEHIND_TABLES)
        builder.add(thing.moved([x, y, 0], _any_turn(rng)))
    for _ in range(int(rng.integers(8, 36))):
        x, y = rng.uniform(-0.5, 0.5, 2) * [width * 0.85, depth * 0.9]
        raised = rng.uniform(0, 0.3) if rng.random() < 0.08 else 0.0
        prop, turn = _prop(rng)
        builder.add(prop.moved([x, y, top + raised], turn))
    y, z = rng.uniform([-0.1 * depth, top + 0.05], [0.2 * depth, top + 0.25])
    return np.array([0.0, y, z])


def _prop(rng: Rng) -> tuple[Mesh, Matrix]:
    """An object of table size, and its rotation: half of them face the camera."""
    pools = (SMALL, SMALL, THIN, _ROWS)
    thing = _any(rng, pools[int(rng.integers(len(pools)))])
    limit = rng.uniform(0.25, 0.8)
    thing = thing.scaled(min(1.0, limit / float(thing.size.max())))
    frontal = rng.random() < 0.5
    return thing, meshes.turn_z(rng.normal(0, 0.5)) if frontal else _any_turn(rng)


def _add_backdrop(builder: SceneBuilder, behind: float, top: float) -> None:
    rng = builder.rng
    kind = rng.random()
    if kind < 0.5:
        lean = meshes.turn(0, rng.normal(0, 0.15))
        turn = meshes.turn_z(rng.normal(0, 0.2)) @ lean
        board = meshes.box(rng.uniform([0.8, 0.02, 0.5], [2.5, 0.03, 1.3]), 0.12)
        builder.add(board.moved([rng.normal(0, 0.2), behind, top], turn), large=True)
    elif kind < 0.75:
        curtain = thin_objects.curtain(rng)
        shift = [rng.normal(0, 0.3), behind, top * 0.5]
        builder.add(curtain.moved(shift), large=True)


def hang_things(
    builder: SceneBuilder, focus: Matrix, low: Matrix, high: Matrix
) -> None:
    """Add objects in mid-air, in some scenes: their depth does not depend on a floor.

    Args:
        builder: The scene to add them to.
        focus: Their mean position, shape (3,), metres.
        low: Lower corner of the room, shape (3,), metres.
        high: Upper corner.
    """
    rng = builder.rng
    count = int(rng.integers(1, 9)) if rng.random() < 0.4 else 0
    for _ in range(count):
        thing = _any(rng, THIN if rng.random() < 0.5 else SMALL)
        thing = thing.rotated(meshes.random_rotation(rng)).seated()
        free = max(float(high[2] - thing.size[2]), 0.1)
        shift = focus + rng.normal(0, 1, 3) * [0.6, 0.4, 0.5]
        shift[1] = max(shift[1], focus[1] - 0.3)
        shift[2] = np.clip(shift[2], 0.05, free)
        builder.add(thing.moved(np.clip(shift, low + 0.2, high - 0.2)))
