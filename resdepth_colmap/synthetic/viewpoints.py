"""The poses of the cameras: mostly well chosen, sometimes badly."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from resdepth_colmap.config import SynthesisConfig
from resdepth_colmap.scene import Camera, DepthMap, Matrix, View
from resdepth_colmap.synthetic.meshes import Rng
from resdepth_colmap.synthetic.room import Room, Style

Probe = Callable[[View], DepthMap]

_ATTEMPTS = 40
_PROBE_WIDTH_PX = 48
_NEAREST_OF_MEDIAN = 0.3


class _Stand(NamedTuple):
    """The pose of the first camera: its centre, the point that it faces, its lens."""

    eye: Matrix
    target: Matrix
    camera: Camera


def choose_views(
    rng: Rng, room: Room, config: SynthesisConfig, probe: Probe
) -> tuple[View, ...]:
    """Overlapping views of a room, with free space in front of each.

    Args:
        rng: Source of randomness.
        room: The room.
        config: Number and size of the views.
        probe: Renders the exact depth of a (small) view.

    Returns:
        The views, names 0000.png and so on, ids from 1. If no attempt has free space in
        front of every view, those of the best attempt.
    """
    best: tuple[View, ...] = ()
    best_score = -1.0
    plan = _draw_plan(rng, config.num_views)
    for _ in range(_ATTEMPTS):
        stand = _draw_stand(rng, room, config)
        depth = probe(_small(_view(0, stand.camera, stand.eye, stand.target, 0.0)))
        near, median = _near_and_median(depth)
        views = _views(rng, stand, plan, config.num_views, (near, median))
        score = min(_freedom(view, room, probe) for view in views)
        if score > best_score:
            best, best_score = views, score
        if score >= 1:
            break
    return best


class _Plan(NamedTuple):
    """Relative poses: pattern, angle from one view to the next, rotations."""

    pattern: str
    step_deg: float = 0.0
    converge: float = 0.0
    wobble_deg: float = 0.0
    roll_deg: float = 0.0


def _draw_plan(rng: Rng, num_views: int) -> _Plan:
    if rng.random() < (0.35 if num_views == 2 else 0.1):
        return _Plan("rectified")
    widest = 9.0 if num_views <= 3 else 7.0
    step = float(np.exp(rng.uniform(np.log(1.5), np.log(widest))))
    pattern = str(rng.choice(["line", "line", "arc", "cloud", "cloud", "forward"]))
    bad = rng.random() < 0.1
    if bad:
        step *= float(rng.choice([0.2, 2.5]))
    return _Plan(
        pattern=pattern,
        step_deg=min(step, 22.0),
        converge=float(rng.choice([0.0, 0.5, 1.0])),
        wobble_deg=float(rng.uniform(0, 3)) * (3 if bad else 1),
        roll_deg=float(rng.choice([0.0, 1.0, 4.0])) * (4 if bad else 1),
    )


def _draw_stand(rng: Rng, room: Room, config: SynthesisConfig) -> _Stand:
    table = room.style is Style.TABLE
    distance = rng.uniform(0.9, 2.4) if table else rng.uniform(1.8, 4.5)
    elevation = np.radians(rng.uniform(3, 42) if table else rng.uniform(-3, 32))
    azimuth = np.radians(rng.normal(0, 22))
    back = np.array([np.sin(azimuth), -np.cos(azimuth), np.tan(elevation)])
    eye = room.focus + distance * back / np.linalg.norm(back)
    eye = np.clip(eye, room.low + 0.2, room.high - 0.15)
    spread = np.array([0.15, 0.15, 0.1]) * distance
    focal = rng.uniform(0.75, 1.6) * config.width_px
    shift = rng.normal(0, 0.01, 2) * config.width_px
    camera = Camera(
        width_px=config.width_px,
        height_px=config.height_px,
        fx=float(focal),
        fy=float(focal * rng.choice([1.0, 1.0, rng.uniform(0.995, 1.005)])),
        cx=float(config.width_px / 2 + shift[0]),
        cy=float(config.height_px / 2 + shift[1]),
    )
    return _Stand(eye, room.focus + rng.normal(0, 0.6, 3) * spread, camera)


def _near_and_median(depth: DepthMap) -> tuple[float, float]:
    seen = depth[depth > 0]
    if len(seen) == 0:
        return 1.0, 1.0
    near, median = np.percentile(seen, [3, 50])
    return float(near), float(median)


def _views(
    rng: Rng, stand: _Stand, plan: _Plan, count: int, near_median: tuple[float, float]
) -> tuple[View, ...]:
    near, median = near_median
    first = _view(0, stand.camera, stand.eye, stand.target, 0.0)
    right, down, forward = first.cam_from_world[:, :3]
    if plan.pattern == "rectified":
        disparity = rng.uniform(15, 90) * stand.camera.width_px / 640
        step = disparity * near / stand.camera.fx
        rotation, eye = first.cam_from_world[:, :3], first.center_in_world
        return tuple(
            _posed(i, first.camera, rotation, eye + i * step * right)
            for i in range(count)
        )
    slope = np.tan(np.radians(plan.step_deg))
    offsets = _offsets(rng, plan.pattern, count) * slope * median
    middle = stand.eye + median * forward
    views = []
    for index, (x, y, z) in enumerate(offsets):
        eye = stand.eye + x * right + y * down + z * forward
        if plan.pattern == "arc":  # keep the distance to the middle of the scene
            eye = middle + median * (eye - middle) / np.linalg.norm(eye - middle)
        followed = middle + (1 - plan.converge) * (eye - stand.eye)
        wobble = np.tan(np.radians(rng.normal(0, 1, 3) * plan.wobble_deg)) * median
        roll = float(np.radians(rng.normal(0, 1) * plan.roll_deg))
        views.append(_view(index, stand.camera, eye, followed + wobble, roll))
    return tuple(views)


def _offsets(rng: Rng, pattern: str, count: int) -> Matrix:
    """Centres of the cameras, shape (count, 3), in steps right, down and forward."""
    along = np.arange(count) - (count - 1) / 2
    jitter: Matrix = rng.normal(0, 0.15, (count, 3))
    if pattern == "forward":
        side = rng.uniform(0.2, 0.7, 2)
        parts = [side[0] * along, 0.3 * side[1] * along, along * 1.2]
        return np.stack(parts, axis=1) + jitter
    if pattern == "cloud":
        radius = 0.6 * np.sqrt(count)
        reach = np.array([1.0, 0.6, 0.35]) * radius
        return rng.uniform(-reach, reach, (count, 3))
    slope = rng.normal(0, 0.25)
    return np.stack([along, slope * along, 0 * along], axis=1) + jitter


def _view(index: int, camera: Camera, eye: Matrix, target: Matrix, roll: float) -> View:
    forward = target - eye
    forward = forward / max(float(np.linalg.norm(forward)), 1e-9)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= max(float(np.linalg.norm(right)), 1e-9)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.stack([c * right + s * down, c * down - s * right, forward])
    return _posed(index, camera, rotation, eye)


def _posed(index: int, camera: Camera, rotation: Matrix, eye: Matrix) -> View:
    return View(
        image_id=index + 1,
        name=f"{index:04d}.png",
        camera=camera,
        cam_from_world=np.column_stack([rotation, -rotation @ eye]),
    )


def _small(view: View) -> View:
    camera = view.camera
    height = max(round(_PROBE_WIDTH_PX * camera.height_px / camera.width_px), 8)
    return dataclasses.replace(view, camera=camera.resized(_PROBE_WIDTH_PX, height))


def _freedom(view: View, room: Room, probe: Probe) -> float:
    """Free space in front of a view: 1 and more is enough, 0 is inside an object."""
    eye = view.center_in_world
    if np.any(eye < room.low + 0.05) or np.any(eye > room.high - 0.05):
        return 0.0
    depth = probe(_small(view))
    if np.mean(depth > 0) < 0.98:
        return 0.0
    near, median = float(np.percentile(depth[depth > 0], 0.5)), float(np.median(depth))
    if median < 0.4:
        return 0.0
    variety = float(np.ptp(np.percentile(depth, [5, 95]))) / median
    return min(near / median / _NEAREST_OF_MEDIAN, variety / 0.2)
