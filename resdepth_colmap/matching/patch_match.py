"""PatchMatch multi-view stereo of one reference view, on the CPU.

The method is COLMAP's (Schoenberger et al., Pixelwise View Selection for Unstructured
Multi-View Stereo, ECCV 2016: bilateral NCC, a photometric and a geometric pass) on the
slanted planes of Bleyer et al. (PatchMatch Stereo, BMVC 2011), with the red-black
propagation and view selection of ACMM (Xu & Tao, Multi-Scale Geometric Consistency
Guided Multi-View Stereo, CVPR 2019), which suit many cores and need no sequential
sweeps. What is not COLMAP's: a truncated smoothness term (`smoothness.py`), which
decides where the images do not, and visibility in the geometric pass
(`visibility.py`).

=====================  =================================================
`plane.py`             a hypothesis: inverse depth and its gradient
`views.py`             reference and sources as arrays, projection
`cost.py`              1 - NCC of a plane in a source
`visibility.py`        the same beside the depth map of the source
`smoothness.py`        roughness of the surface
`random_planes.py`     random initialisation, perturbation
`propagation.py`       planes from the surroundings
`view_selection.py`    which sources count at a pixel
`sweeps.py`            the iteration: propagate, select views, refine
`plane_maps.py`        planes, normals and costs of all pixels
`filtering.py`         what too few sources agree with (`agreement.py`)
=====================  =================================================
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
    from resdepth_colmap.matching.sweeps import Iteration

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
    threads. The photometric pass starts from random planes; the geometric one (COLMAP's
    geom_consistency) from the photometric maps, and it weighs the sources' maps.

    Args:
        reference: The view whose maps are made.
        sources: At least one other view.
        depth_range: Nearest and farthest depth, in workspace units.
        config: Options; `max_image_size` and `max_num_sources` are the caller's.
        start: The view's photometric maps; None = random planes.
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
    from resdepth_colmap.matching import plane_maps, sweeps  # numba: slow import
    from resdepth_colmap.matching.cost import make_window
    from resdepth_colmap.matching.views import Reference, blur_levels, pack_sources

    gray = reference.gray
    K = reference.K.astype(np.float32)
    view = Reference(levels=blur_levels(gray), K=K)
    grays = [source.gray for source in sources]
    packed = pack_sources(*_projections(reference, sources), grays, source_depths)
    window = make_window(config)
    w_range = np.array([1.0 / far, 1.0 / near], np.float32)
    planes = np.zeros((*gray.shape, 3), np.float32)
    if start is None:
        plane_maps.random_planes(planes, K, w_range, config.seed)
    else:
        plane_maps.planes_of(start.depth, start.normals, K, w_range, planes)
    source_costs = np.zeros((len(sources), *gray.shape), np.float32)
    plane_maps.costs_of(planes, view, packed, window, source_costs)
    costs = source_costs.mean(axis=0)
    geometric = source_depths is not None
    iterations = _iterations(config, w_range, geometric)
    turns = list(itertools.product((0, 1), _bands(gray, len(sources))))
    step, num_steps = 0, len(iterations) * len(turns)
    for iteration in iterations:
        for color, rows in turns:
            sweeps.sweep(view, packed, window, iteration, planes, costs, color, rows)
            step += 1
            if on_step:
                on_step(step, num_steps)
    plane_maps.costs_of(planes, view, packed, window, source_costs)
    normals = np.zeros((*gray.shape, 3), np.float32)
    plane_maps.normals_of(planes, K, normals)
    return MatchResult(
        depth=np.reciprocal(planes[..., 0]), normals=normals, source_costs=source_costs
    )


def _iterations(
    config: StereoConfig, w_range: FloatMap, geometric: bool
) -> "list[Iteration]":
    """The iterations of a pass; half as many in the geometric one.

    That goes on where the photometric one stopped, in view selection and smoothness:
    smooth from the start, chance would freeze into islands.
    """
    from resdepth_colmap.matching.sweeps import Iteration  # numba: slow import

    half = (config.num_iterations + 1) // 2
    first = config.num_iterations + 1 if geometric else 1
    count = half if geometric else config.num_iterations
    return [
        Iteration(
            t=t,
            w_range=w_range,
            smoothness=np.float32(config.smoothness if t > half else 0.0),
            geometric=geometric,
            seed=config.seed,
        )
        for t in range(first, first + count)
    ]


def _bands(gray: GrayImage, num_sources: int) -> list[tuple[int, int]]:
    """Ranges of rows, of no more work than Ctrl-C and progress may wait for."""
    height, width = gray.shape
    rows = max(LEAST_ROWS, BAND_PIXELS // (width * num_sources))
    return [(top, min(top + rows, height)) for top in range(0, height, rows)]


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
