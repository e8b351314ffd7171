"""PatchMatch multi-view stereo of one reference view, on the CPU.

The method is COLMAP's (Schoenberger et al., ECCV 2016: bilateral NCC, slanted planes,
photometric consistency) with the red-black propagation and view selection of ACMM
(Xu & Tao, CVPR 2019), which suit many cores and need no sequential sweeps.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.scene import DepthMap, FloatMap, GrayImage, Matrix, NormalMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MatchView:
    """What matching needs of a view.

    Attributes:
        gray: The image, shape (H, W), float32 in 0..1.
        K: Intrinsics for integer pixel centres (`geometry.pixels.index_K`), (3, 3).
        cam_from_world: Pose, shape (3, 4).
    """

    gray: GrayImage
    K: Matrix
    cam_from_world: Matrix


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MatchResult:
    """What matching finds, unfiltered: every pixel has a value.

    Attributes:
        depth: Shape (H, W), in workspace units, all > 0.
        normals: Shape (H, W, 3), camera frame, towards the camera.
        cost: 1 - NCC weighted over the chosen sources, in 0..2, shape (H, W).
    """

    depth: DepthMap
    normals: NormalMap
    cost: FloatMap


def match_view(
    reference: MatchView,
    sources: Sequence[MatchView],
    depth_range: tuple[float, float],
    config: StereoConfig,
    on_sweep: Callable[[int, int], None] | None = None,
) -> MatchResult:
    """Find depth and normal of every pixel of the reference view.

    The result depends on the inputs and `config.seed` alone, not on the number of
    threads.

    Args:
        reference: The view whose maps are made.
        sources: At least one other view.
        depth_range: Nearest and farthest depth, in workspace units.
        config: Options; `max_image_size` and `max_num_sources` are the caller's.
        on_sweep: Called after each sweep with its number from 1 and their total.

    Raises:
        ValueError: Without sources, or for a depth range that is empty.
    """
    near, far = depth_range
    if not sources:
        raise ValueError("a reference view without sources cannot be matched.")
    if not 0 < near < far:
        raise ValueError(f"{depth_range=} but expected 0 < near < far.")
    from resdepth_colmap.matching import sweeps  # numba: slow import

    height, width = reference.gray.shape
    planes = np.zeros((height, width, 3), np.float32)
    costs = np.zeros((height, width), np.float32)
    K = reference.K.astype(np.float32)
    arguments = (
        np.ascontiguousarray(reference.gray),
        K,
        planes,
        costs,
        *_projections(reference, sources),
        *_flat_images(sources),
        _window_offsets(config),
        np.array([1.0 / far, 1.0 / near], np.float32),
        np.float32(config.sigma_color),
        config.seed,
    )
    sweeps.start(*arguments)
    for number in range(1, config.num_iterations + 1):
        for color in (0, 1):
            sweeps.sweep(*arguments, number, color)
        if on_sweep:
            on_sweep(number, config.num_iterations)
    normals = np.zeros((height, width, 3), np.float32)
    sweeps.normals_of(planes, K, normals)
    return MatchResult(depth=1.0 / planes[..., 0], normals=normals, cost=costs)


def _projections(
    reference: MatchView, sources: Sequence[MatchView]
) -> tuple[FloatMap, FloatMap]:
    """A (S, 3, 3) and b (S, 3): source pixel ~ A (x, y, 1) + b inverse_depth."""
    rotation_from_world = reference.cam_from_world[:, :3]
    A, b = [], []
    for source in sources:
        rotation = source.cam_from_world[:, :3] @ rotation_from_world.T
        translation = (
            source.cam_from_world[:, 3] - rotation @ reference.cam_from_world[:, 3]
        )
        A.append(source.K @ rotation @ np.linalg.inv(reference.K))
        b.append(source.K @ translation)
    return np.array(A, np.float32), np.array(b, np.float32)


def _flat_images(
    sources: Sequence[MatchView],
) -> tuple[FloatMap, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """All pixels one after the other, where each image starts, and (width, height)."""
    sizes = np.array([source.gray.shape[::-1] for source in sources], np.int64)
    ends = np.cumsum(sizes.prod(axis=1))
    pixels = np.concatenate([source.gray.ravel() for source in sources])
    return pixels.astype(np.float32), ends - sizes.prod(axis=1), sizes


def _window_offsets(config: StereoConfig) -> FloatMap:
    """The window's samples: dx, dy and the logarithm of the spatial weight, (3, N)."""
    radius = config.window_radius
    steps = np.arange(-radius, radius + 1, config.window_step, dtype=np.float32)
    dx, dy = (grid.ravel() for grid in np.meshgrid(steps, steps))
    # COLMAP: sigma_spatial is the window's radius.
    spatial = -(dx**2 + dy**2) / (2.0 * radius**2)
    return np.stack([dx, dy, spatial]).astype(np.float32)
