"""Whether depth maps have the scale of the model that they are refined with.

Maps of another reconstruction, or of a network, may be in other units. Where there are
sparse points, a map has to pass through those that its image saw; where there are none,
a neighbouring photograph, warped by the map, has to look like the view's own.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import project, transform
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_sparse_points
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.initial_map import InitialMap
from resdepth_colmap.pipeline.masks import masked_depth
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.pipeline.refine.source_sampler import SourceTensors
from resdepth_colmap.pipeline.view_images import ViewImages, camera_of_size
from resdepth_colmap.scene import DepthMap, Matrix, Scene, View, cam_from_cam

logger = logging.getLogger(__name__)

TOLERANCE = 0.05
"""Relative difference from 1 up to which a scale is right."""

LEAST_POINTS = 10
LEAST_SHARE = 0.3
"""Of points or pixels that agree at the best scale; with fewer, it says nothing."""

NUM_PAIRS = 3
"""Of views whose photographs are compared, where there are no points."""

SIDE_PX = 160
"""Longest side of the photographs that are compared."""

AGREEING_ERROR = 0.15
"""Photometric error (an NCC of 0.7) up to which two photographs agree."""

_LARGEST_SCALE = 50.0
_NUM_COARSE, _NUM_FINE = 61, 17  # odd: 1 is one of the coarse ones

LEAST_GAIN = 0.08
"""Share that has to agree more at another scale, for that to be the right one."""

ReadMap = Callable[[int], DepthMap]
"""Reads the initial map of a view, by its index in the scene."""


class ScaleFit(NamedTuple):
    """The factor that brings depths to the scale of the model.

    Attributes:
        factor: Depth by the model over depth in the map, a median.
        spread: Relative: half of the points are within it.
        num: Points, or pixels, that were compared.
        agree_now: Share of them within `TOLERANCE` as the map is.
        agree_then: The same after the map was multiplied by the factor.
    """

    factor: float
    spread: float
    num: int
    agree_now: float
    agree_then: float

    @property
    def is_off(self) -> bool:
        """Whether the map has another scale, beyond doubt."""
        is_clear = self.agree_then >= LEAST_SHARE
        is_clear &= self.agree_then - self.agree_now >= LEAST_GAIN
        return abs(self.factor - 1.0) > TOLERANCE and is_clear


def fit_to_points(depth: DepthMap, view: View, xyz: Matrix) -> ScaleFit | None:
    """Compare a map with the sparse points that its image saw.

    Args:
        depth: Shape (H, W), in any unit; 0 = no depth.
        view: Its view.
        xyz: Points in the world, shape (N, 3), in units of the model.

    Returns:
        None where fewer than `LEAST_POINTS` fall on a pixel with a depth.
    """
    height_px, width_px = depth.shape
    K = index_K(view.camera.resized(width_px, height_px))
    ratios = _ratios(depth, K, transform(view.cam_from_world, xyz))
    return _fit(ratios) if ratios.size >= LEAST_POINTS else None


def initial_scales(
    workspace: Workspace,
    scene: Scene,
    maps: Mapping[int, InitialMap],
    read_map: Callable[[Path], DepthMap] = read_depth_map,
) -> dict[int, ScaleFit]:
    """The scale of each map that is not blank, by the index of its view.

    Only what the masks of the workspace leave counts. A view with too few points is
    left out. Without sparse points all maps get one
    scale, by what the photographs say; if they say nothing, the result is empty.

    Args:
        workspace: With sparse points and photographs.
        scene: Its views.
        maps: Initial maps by view.
        read_map: Reads a depth map.

    Raises:
        WorkspaceError: If a file cannot be read.
    """
    filled = {index: found for index, found in maps.items() if found.filled}

    def read(index: int) -> DepthMap:
        depth = read_map(filled[index].path)
        return masked_depth(workspace.masks, scene.views[index].name, depth)

    if scene.num_shared_points is None:
        fit = _fit_to_photographs(workspace, scene, sorted(filled), read)
        return {} if fit is None else dict.fromkeys(filled, fit)
    points = read_sparse_points(workspace.sparse_path).about(scene.origin_in_world)
    fits = {}
    for index in filled:
        view = scene.views[index]
        seen = points.xyz[points.seen_by(view.image_id)]
        fit = fit_to_points(read(index), view, seen)
        if fit is not None:
            fits[index] = fit
    return fits


def check_scales(
    scene: Scene, maps: Mapping[int, InitialMap], fits: Mapping[int, ScaleFit]
) -> None:
    """Refuse maps of another scale.

    Raises:
        WorkspaceError: Naming the first of them, its scale, and the way out.
    """
    off = [index for index, fit in fits.items() if fit.is_off]
    if not off:
        return
    first = off[0]
    fit = fits[first]
    raise WorkspaceError(
        f"{maps[first].path}: the depth map of {scene.views[first].name} is not at the "
        f"scale of the model, which has {fit.factor:.4g} times its depths (spread "
        f"{fit.spread:.1%}, {fit.num} points); so are {len(off)} of {len(maps)} maps. "
        "Use maps that were made with this model, or --fit-scale to rescale them."
    )


def fitted_scales(scene: Scene, fits: Mapping[int, ScaleFit]) -> dict[int, float]:
    """The factor of each view whose map is off; what is done is logged.

    A view without a fit gets the median of the others, if all of these are off.
    """
    factors = {index: fit.factor for index, fit in fits.items() if fit.is_off}
    if factors and len(factors) == len(fits):
        median = float(np.median(list(factors.values())))
        for index in range(len(scene.views)):
            factors.setdefault(index, median)
    for index, factor in sorted(factors.items()):
        name = scene.views[index].name
        logger.info("%s: its depth map is multiplied by %.4g.", name, factor)
    return factors


def _ratios(depth: DepthMap, K: Matrix, xyz_in_cam: Matrix) -> Matrix:
    """Depth of points over the depth of the pixels that they fall on, shape (M,)."""
    xy, z = project(xyz_in_cam, K)
    height_px, width_px = depth.shape
    column, row = np.rint(xy[:, 0]), np.rint(xy[:, 1])
    inside = (z > 0) & (column >= 0) & (row >= 0)
    inside &= (column < width_px) & (row < height_px)
    found = depth[row[inside].astype(np.int64), column[inside].astype(np.int64)]
    known = found > 0
    return np.asarray(z[inside][known] / found[known], dtype=np.float64)


def _fit(ratios: Matrix) -> ScaleFit:
    factor = float(np.median(ratios))
    off = np.abs(ratios / factor - 1.0)
    return ScaleFit(
        factor=factor,
        spread=float(np.median(off)),
        num=int(ratios.size),
        agree_now=float((np.abs(ratios - 1.0) < TOLERANCE).mean()),
        agree_then=float((off < TOLERANCE).mean()),
    )


def _fit_to_photographs(
    workspace: Workspace, scene: Scene, indices: Sequence[int], read: ReadMap
) -> ScaleFit | None:
    """The scale at which the photographs agree best."""
    images = ViewImages(workspace, _CACHE_BYTES)
    pairs = [
        _Pair.of(scene.views[first], scene.views[second], read(first), images)
        for first, second in _neighbours(scene, indices)
    ]
    num = sum(pair.num for pair in pairs)
    if not num:
        return None

    def shares(scales: Matrix) -> Matrix:
        counts = [sum(pair.num_agreeing(scale) for pair in pairs) for scale in scales]
        return np.array(counts) / num

    largest = np.log(_LARGEST_SCALE)
    coarse = np.exp(np.linspace(-largest, largest, _NUM_COARSE))
    found = shares(coarse)
    now, best = float(found[_NUM_COARSE // 2]), coarse[found.argmax()]
    step = coarse[1] / coarse[0]
    fine = best * np.geomspace(1 / step, step, _NUM_FINE)
    found = shares(fine)
    spread = float(fine[1] / fine[0] - 1.0)
    factor, then = float(fine[found.argmax()]), float(found.max())
    return ScaleFit(factor, spread, num, now, then)


def _neighbours(scene: Scene, indices: Sequence[int]) -> list[tuple[int, int]]:
    """Some views, each with the best of all others."""
    step = max(1, len(indices) // NUM_PAIRS)
    return [
        (index, choice.index)
        for index in indices[::step][:NUM_PAIRS]
        for choice in choose_sources(scene, index, 1)
    ]


class _Pair(NamedTuple):
    """A small view with its depth, and its source."""

    gray: Tensor
    inverse_depth: Tensor
    K: Tensor
    source: SourceTensors
    num: int

    @classmethod
    def of(cls, view: View, source: View, depth: DepthMap, images: ViewImages) -> Self:
        cameras = [camera_of_size(it, SIDE_PX) for it in (view, source)]
        grays = [
            torch.from_numpy(np.array(images.gray(it, camera)))[None, None]
            for it, camera in zip((view, source), cameras, strict=True)
        ]
        K, source_K = (torch.from_numpy(index_K(camera))[None] for camera in cameras)
        small = nearest_resized(depth, (cameras[0].width_px, cameras[0].height_px))
        pose = torch.from_numpy(cam_from_cam(source, view))[None]
        return cls(
            gray=grays[0],
            inverse_depth=torch.from_numpy(invert_map(small))[None, None],
            K=K,
            source=SourceTensors(grays[1], source_K, pose),
            num=int((small > 0).sum()),
        )

    def num_agreeing(self, scale: float) -> int:
        """Pixels where the source, warped by the scaled map, looks like the view."""
        inverse_depth = self.inverse_depth / float(scale)
        warped = warp_to_reference(
            self.source.gray,
            inverse_depth,
            self.K,
            self.source.K,
            self.source.source_from_reference,
        )
        agrees = photometric_error(self.gray, [warped]) < AGREEING_ERROR
        return int((agrees & (inverse_depth > 0)).sum())


_CACHE_BYTES = 1 << 26
