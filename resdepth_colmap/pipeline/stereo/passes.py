"""The CPU PatchMatch over a workspace: pass by pass, view by view.

As in COLMAP (patch_match.cc), the first pass matches the photographs of all views,
unfiltered; the second matches each view again, against the first one's depth maps of
its sources, too.
"""

import dataclasses
import functools

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.holes import fill_holes
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.consistency_graph import write_consistency_graph
from resdepth_colmap.io.colmap.depth_map import write_depth_map
from resdepth_colmap.io.colmap.masks import Wanted, mask_file, read_mask
from resdepth_colmap.io.colmap.model import read_image_indices
from resdepth_colmap.io.colmap.normal_map import read_normal_map, write_normal_map
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.matching.filtering import filter_result
from resdepth_colmap.matching.patch_match import MatchView, Surface, match_view
from resdepth_colmap.pipeline.stereo.depth_range_probe import (
    SIDE_PX,
    WIDE,
    probed_range,
)
from resdepth_colmap.pipeline.stereo.ledger import (
    GEOMETRIC,
    PHOTOMETRIC,
    UNFINISHED,
    StereoLedger,
)
from resdepth_colmap.pipeline.stereo.plan import StereoPlan
from resdepth_colmap.pipeline.view_images import ViewImages, camera_at_scale
from resdepth_colmap.progress import Advance
from resdepth_colmap.scene import Camera, DepthMap, NormalMap, Scene, View

BYTES_PER_GB = 1 << 30  # COLMAP's unit of cache_size


@dataclasses.dataclass(frozen=True, kw_only=True)
class StereoPass:
    """One of the two passes.

    Attributes:
        kind: The word before ".bin" in the names of its maps.
        is_filtered: Whether what too few sources agree with is dropped.
        num_units: How long it takes, in units of the second pass.
    """

    kind: str
    is_filtered: bool
    num_units: int = 1


def passes_of(config: StereoConfig) -> tuple[StereoPass, ...]:
    """The passes of a configuration; only the last one is filtered."""
    if not config.geom_consistency:
        return (StereoPass(kind=PHOTOMETRIC, is_filtered=config.filter, num_units=2),)
    return (
        StereoPass(kind=PHOTOMETRIC, is_filtered=False, num_units=2),
        StereoPass(kind=GEOMETRIC, is_filtered=config.filter),
    )


class ViewMatcher:
    """Matches views of a workspace, and writes what it finds."""

    def __init__(
        self,
        workspace: Workspace,
        scene: Scene,
        config: StereoConfig,
        ledger: StereoLedger,
    ) -> None:
        """Read nothing yet."""
        self.workspace = workspace
        self.scene = scene
        self.config = config
        self.ledger = ledger
        num_bytes = int(min(config.cache_size, 1 << 20) * BYTES_PER_GB)
        self.images = ViewImages(workspace, num_bytes)
        self._probed: dict[int, tuple[float, float]] = {}

    def match(self, plan: StereoPlan, which: StereoPass, advance: Advance) -> str:
        """Match a view and write its maps.

        Args:
            plan: The view.
            which: The pass.
            advance: Is told of each step; `which.num_units` for all of them.

        Returns:
            Why there is nothing to match, or "".

        Raises:
            WorkspaceError: If a file cannot be read or written.
        """
        view = self.scene.views[plan.index]
        camera = self._camera(view)
        wanted = self._wanted(view, camera)
        if not wanted.any():
            self._write(plan, which, _nothing(camera), None)
            advance(which.num_units)
            return ""
        start, source_depths, reason = None, None, ""
        if which.kind == GEOMETRIC:
            start, source_depths, reason = self._first_pass(plan, camera)
        if reason:
            advance(which.num_units)
            return reason
        reference, sources = self._match_views(plan, self.config.max_image_size)
        result = match_view(
            reference,
            sources,
            self._depth_range(plan),
            self.config,
            start=start,
            source_depths=source_depths,
            on_step=lambda _, total: advance(which.num_units / total),
        )
        found: Surface = result
        agrees = None
        if which.is_filtered:
            found, agrees = filter_result(
                result, reference, sources, source_depths, self.config
            )
        self._write(plan, which, masked(found, wanted), agrees)
        return ""

    def _first_pass(
        self, plan: StereoPlan, camera: Camera
    ) -> tuple[Surface | None, list[DepthMap], str]:
        """Where the second pass starts from, the depth of the sources, or why not."""
        view = self.scene.views[plan.index]
        depth = self.images.depth(view, camera, PHOTOMETRIC)
        if not depth.any():
            return None, [], "its photometric map has no depth at all"
        others = self._sources(plan)
        depths = [self.images.depth(v, self._camera(v), PHOTOMETRIC) for v in others]
        if not any(found.any() for found in depths):
            return None, [], "none of its sources has a photometric depth map"
        whole = fill_holes(depth)
        start = Surface(
            depth=np.clip(whole, *self._depth_range(plan)).astype(np.float32),
            normals=self._normals(view, camera, whole),
        )
        return start, depths, ""

    def _normals(self, view: View, camera: Camera, whole: DepthMap) -> NormalMap:
        """Normals of the first pass; where it has none, those of its depth."""
        path = self.workspace.normal_map_path(view.name, PHOTOMETRIC)
        normals = np.zeros((*whole.shape, 3), np.float32)
        if path.is_file():
            normals = read_normal_map(path)
        if normals.shape[:2] != whole.shape:
            normals = np.zeros((*whole.shape, 3), np.float32)
        known = normals.any(axis=2, keepdims=True)
        if known.all():
            return normals
        computed = normals_from_depth(whole, index_K(camera))
        return np.where(known, normals, computed)

    def _write(
        self,
        plan: StereoPlan,
        which: StereoPass,
        found: Surface,
        agrees: npt.NDArray[np.bool_] | None,
    ) -> None:
        """Write the maps, each whole or not at all."""
        name, kind = self.scene.views[plan.index].name, which.kind
        # What is interrupted between two files must not look finished.
        self.ledger.add(name, kind, UNFINISHED)
        if agrees is not None and self.config.write_consistency_graph:
            write_consistency_graph(
                self.workspace.consistency_graph_path(name, kind),
                agrees & (found.depth > 0),
                [self._model_indices[view.image_id] for view in self._sources(plan)],
            )
        normal_path = self.workspace.normal_map_path(name, kind)
        write_normal_map(normal_path, found.normals)
        write_depth_map(self.workspace.depth_map_path(name, kind), found.depth)

    @functools.cached_property
    def _model_indices(self) -> dict[int, int]:
        return read_image_indices(self.workspace.sparse_path)

    def _sources(self, plan: StereoPlan) -> list[View]:
        return [self.scene.views[index] for index in plan.sources]

    def _depth_range(self, plan: StereoPlan) -> tuple[float, float]:
        """That of the plan; a wide guess is narrowed by what small pictures show."""
        near, far = plan.depth_range
        if not plan.is_guess or far <= WIDE * near:
            return near, far
        if plan.index not in self._probed:
            views = self._match_views(plan, SIDE_PX)
            limits = probed_range(*views, plan.depth_range, self.config)
            self._probed[plan.index] = limits
        return self._probed[plan.index]

    def _match_views(
        self, plan: StereoPlan, max_image_size: int
    ) -> tuple[MatchView, list[MatchView]]:
        """The view and its sources at that size."""
        reference, *sources = (
            self._match_view(view, _camera_of_size(view, max_image_size))
            for view in (self.scene.views[plan.index], *self._sources(plan))
        )
        return reference, sources

    def _camera(self, view: View) -> Camera:
        """The camera at matching size."""
        return _camera_of_size(view, self.config.max_image_size)

    def _match_view(self, view: View, camera: Camera) -> MatchView:
        return MatchView(
            gray=self.images.gray(view, camera),
            K=index_K(camera),
            cam_from_world=view.cam_from_world,
        )

    def _wanted(self, view: View, camera: Camera) -> Wanted:
        """Where a depth is wanted: everywhere, or where the mask says so."""
        size = (camera.width_px, camera.height_px)
        if self.config.mask_path is not None:
            path = mask_file(self.config.mask_path, view.name)
            if path.is_file():
                return nearest_resized(read_mask(path), size)
        return np.ones(size[::-1], np.bool_)


def _camera_of_size(view: View, max_image_size: int) -> Camera:
    """The camera of an image that is no larger than that; -1 = as it is."""
    longest_px = max(view.camera.width_px, view.camera.height_px)
    is_smaller = 0 < max_image_size < longest_px
    return camera_at_scale(
        view.camera, max_image_size / longest_px if is_smaller else 1.0
    )


def masked(found: Surface, wanted: Wanted) -> Surface:
    """The same without depth and normals where none is wanted."""
    return Surface(
        depth=np.where(wanted, found.depth, np.float32(0)),
        normals=np.where(wanted[..., np.newaxis], found.normals, np.float32(0)),
    )


def _nothing(camera: Camera) -> Surface:
    """Maps without any depth."""
    shape = (camera.height_px, camera.width_px)
    return Surface(
        depth=np.zeros(shape, np.float32),
        normals=np.zeros((*shape, 3), np.float32),
    )
