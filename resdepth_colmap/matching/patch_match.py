"""PatchMatch multi-view stereo of one reference view, on the CPU.

The method is COLMAP's (Schoenberger et al., ECCV 2016: bilateral NCC, slanted planes,
a photometric and a geometric pass) with the red-black propagation and view selection of
ACMM (Xu & Tao, CVPR 2019), which suit many cores and need no sequential sweeps. What is
not COLMAP's: a truncated smoothness term (`smoothness.py`), which decides where the
photographs do not, and visibility in the geometric pass (`visibility.py`).
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.scene import (
    DepthMap,
    FloatMap,
    GrayImage,
    Matrix,
    NormalMap,
    cam_from_cam,
)

if TYPE_CHECKING:
    from resdepth_colmap.matching.cost import Sources, Window

BAND_PIXELS = 400_000  # of all sources
LEAST_ROWS = 16
METHOD = 2  # raised when the same input gives other maps: then old ones are made anew


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
class Surface:
    """Depth and normal of every pixel of a view.

    Attributes:
        depth: Shape (H, W), in workspace units; 0 = none.
        normals: Shape (H, W, 3), camera frame, towards the camera; (0, 0, 0) = none.
    """

    depth: DepthMap
    normals: NormalMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MatchResult(Surface):
    """What matching finds, unfiltered: every pixel has a depth and a normal.

    Attributes:
        source_costs: 1 - NCC of each pixel's plane in each source, shape (S, H, W), in
            0..2; 1 exactly where the source does not see it.
    """

    source_costs: FloatMap


def match_view(
    reference: MatchView,
    sources: Sequence[MatchView],
    depth_range: tuple[float, float],
    config: StereoConfig,
    *,
    start: Surface | None = None,
    source_depths: Sequence[DepthMap] | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> MatchResult:
    """Find depth and normal of every pixel of the reference view.

    The result depends on the inputs and `config.seed` alone, not on the number of
    threads. The photometric pass starts by chance; the geometric one (COLMAP's
    geom_consistency) starts from the photometric maps, and weighs the sources' maps.

    Args:
        reference: The view whose maps are made.
        sources: At least one other view.
        depth_range: Nearest and farthest depth, in workspace units.
        config: Options; `max_image_size` and `max_num_sources` are the caller's.
        start: The view's photometric maps; None = by chance.
        source_depths: Depth map of each source, of the size of its image, 0 = none;
            None = the photometric pass.
        on_step: Called after each fraction of a second's work with its number from 1
            and their total; what it raises ends the matching.

    Raises:
        ValueError: Without sources, or for a depth range that is empty.
    """
    near, far = depth_range
    if not sources:
        raise ValueError("a reference view without sources cannot be matched.")
    if not 0 < near < far:
        raise ValueError(f"{depth_range=} but expected 0 < near < far.")
    from resdepth_colmap.matching import sweeps  # numba: slow import

    gray = reference.gray
    levels = _blurred(gray)
    K = reference.K.astype(np.float32)
    flat = _flat_sources(reference, sources, source_depths)
    window = _window(config)
    w_range = np.array([1.0 / far, 1.0 / near], np.float32)
    planes = np.zeros((*gray.shape, 3), np.float32)
    source_costs = np.zeros((len(sources), *gray.shape), np.float32)
    if start is None:
        sweeps.random_planes(planes, K, w_range, config.seed)
    else:
        sweeps.planes_of(start.depth, start.normals, K, w_range, planes)
    sweeps.match_costs(levels, planes, flat, window, source_costs)
    costs = source_costs.mean(axis=0)
    geometric = source_depths is not None
    half = (config.num_iterations + 1) // 2
    total = half if geometric else config.num_iterations
    # The geometric pass goes on where the photometric one stopped.
    first = config.num_iterations + 1 if geometric else 1
    bands = _bands(gray, len(sources))
    step, num_steps = 0, total * 2 * len(bands)
    for number in range(first, first + total):
        # Smooth from the start, chance would freeze into islands.
        smoothness = np.float32(config.smoothness if number > half else 0.0)
        for color, rows in itertools.product((0, 1), bands):
            sweeps.sweep(
                *(levels, K, planes, costs, flat, window, w_range, smoothness),
                *(config.seed, number, color, geometric, rows),
            )
            step += 1
            if on_step:
                on_step(step, num_steps)
    sweeps.match_costs(levels, planes, flat, window, source_costs)
    normals = np.zeros((*gray.shape, 3), np.float32)
    sweeps.normals_of(planes, K, normals)
    return MatchResult(
        depth=np.reciprocal(planes[..., 0]), normals=normals, source_costs=source_costs
    )


def _bands(gray: GrayImage, num_sources: int) -> list[tuple[int, int]]:
    """Ranges of rows, of no more work than Ctrl-C and progress may wait for."""
    height, width = gray.shape
    rows = max(LEAST_ROWS, BAND_PIXELS // (width * num_sources))
    return [(top, min(top + rows, height)) for top in range(0, height, rows)]


def _flat_sources(
    reference: MatchView,
    sources: Sequence[MatchView],
    source_depths: Sequence[DepthMap] | None,
) -> "Sources":
    """The sources as the kernels take them."""
    from resdepth_colmap.matching.cost import NUM_LEVELS, Sources

    sizes = np.array([source.gray.shape[::-1] for source in sources], np.int64)
    ends = np.cumsum(sizes.prod(axis=1))
    pixels = np.concatenate(
        [_blurred(view.gray).reshape(NUM_LEVELS, -1) for view in sources], axis=1
    )
    inverse = np.zeros(0, np.float32)
    if source_depths is not None:
        depths = np.concatenate([depth.ravel() for depth in source_depths])
        inverse = np.divide(1.0, depths, out=np.zeros_like(depths), where=depths > 0)
    A, b = _projections(reference, sources)
    return Sources(
        A=A,
        b=b,
        pixels=pixels,
        inverse_depths=inverse.astype(np.float32),
        starts=ends - sizes.prod(axis=1),
        sizes=sizes,
    )


def _blurred(gray: GrayImage) -> FloatMap:
    """The image at each level of blur: with 0, 1, 2 px."""
    import cv2

    from resdepth_colmap.matching.cost import NUM_LEVELS

    sigmas = [2.0 ** (level - 1) for level in range(1, NUM_LEVELS)]
    blurred = [cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in sigmas]
    return np.stack([gray, *blurred]).astype(np.float32)


def _projections(
    reference: MatchView, sources: Sequence[MatchView]
) -> tuple[FloatMap, FloatMap]:
    """A (S, 3, 3) and b (S, 3): source pixel ~ A (x, y, 1) + b inverse_depth."""
    A, b = [], []
    for source in sources:
        pose = cam_from_cam(source, reference)
        A.append(source.K @ pose[:, :3] @ np.linalg.inv(reference.K))
        b.append(source.K @ pose[:, 3])
    return np.array(A, np.float32), np.array(b, np.float32)


def _window(config: StereoConfig) -> "Window":
    """The window's samples, filled up to a multiple of 8."""
    from resdepth_colmap.matching.cost import Window

    radius = config.window_radius
    steps = np.arange(-radius, radius + 1, config.window_step, dtype=np.float32)
    dx, dy = (grid.ravel() for grid in np.meshgrid(steps, steps))
    # COLMAP: sigma_spatial is the window's radius.
    spatial = np.exp(-(dx**2 + dy**2) / (2.0 * radius**2))
    fill = (0, -len(dx) % 8)
    return Window(
        dx=np.pad(dx, fill),
        dy=np.pad(dy, fill),
        spatial=np.pad(spatial, fill).astype(np.float32),
        sigma_color=np.float32(config.sigma_color),
    )
