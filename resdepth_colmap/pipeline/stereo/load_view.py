"""What a matching task reads, as arrays."""

import dataclasses

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.holes import fill_holes
from resdepth_colmap.geometry.normals import normals_from_depth
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.io.colmap.maps import read_normal_map
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.matching.patch_match import MatchView, Surface
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.pipeline.stereo.depth_range_probe import PROBE_SIDE_PX, is_wide
from resdepth_colmap.pipeline.stereo.passes import GEOMETRIC, PHOTOMETRIC, MatchTask
from resdepth_colmap.pipeline.view_images import ViewImages, camera_of_size
from resdepth_colmap.scene import Camera, DepthMap, NormalMap, Scene, View, Wanted

BYTES_PER_GB = 1 << 30  # COLMAP's unit of cache_size


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class MatchData:
    """A view and its sources at the size to match at.

    Attributes:
        reference: The view.
        sources: Its sources, at least one.
        depth_range: Near and far depth, in units.
        wanted: Where a depth is wanted, shape (H, W).
        probe: View and sources as small pictures, where the depth range is a guess and
            has to be narrowed; else None.
        first_depth: In the second pass the photometric depth, shape (H, W), in units;
            0 = hole; else None.
        first_normals: Its normals, shape (H, W, 3); likewise.
        source_depths: In the second pass that of each source; likewise.
    """

    reference: MatchView
    sources: list[MatchView]
    depth_range: tuple[float, float]
    wanted: Wanted
    probe: tuple[MatchView, list[MatchView]] | None = None
    first_depth: DepthMap | None = None
    first_normals: NormalMap | None = None
    source_depths: list[DepthMap] | None = None

    def start(self, depth_range: tuple[float, float]) -> Surface | None:
        """Where the second pass starts from: the first one's surface, in the range."""
        if self.first_depth is None or self.first_normals is None:
            return None
        depth = np.clip(self.first_depth, *depth_range).astype(np.float32)
        return Surface(depth=depth, normals=self.first_normals)

    @property
    def why_nothing(self) -> str:
        """Why there is nothing to match, or ""."""
        if self.source_depths is None:
            return ""
        if self.first_depth is None:
            return "its photometric map has no depth at all"
        if not any(depth.any() for depth in self.source_depths):
            return "none of its sources has a photometric depth map"
        return ""


class MatchLoader:
    """Loads what tasks need; the last images and maps stay in memory."""

    def __init__(
        self, workspace: Workspace, scene: Scene, config: StereoConfig
    ) -> None:
        """Read nothing yet."""
        self._workspace = workspace
        self._scene = scene
        self._config = config
        num_bytes = int(min(config.cache_size, 1 << 20) * BYTES_PER_GB)
        self._images = ViewImages(workspace, num_bytes)

    def load(
        self, task: MatchTask, known_range: tuple[float, float] | None = None
    ) -> MatchData:
        """Read what a task needs.

        Args:
            task: The view and the pass.
            known_range: The depth range, if the view was probed before.

        Raises:
            WorkspaceError: If a file cannot be read.
        """
        plan = task.plan
        view = self._scene.views[plan.index]
        camera = self._camera(view)
        reference, sources = self._views(task, self._config.max_image_size)
        probe = None
        if known_range is None and plan.is_guess and is_wide(plan.depth_range):
            probe = self._views(task, PROBE_SIDE_PX)
        data = MatchData(
            reference=reference,
            sources=sources,
            depth_range=known_range or plan.depth_range,
            wanted=self._wanted(view, camera),
            probe=probe,
        )
        return self._with_first_pass(data, task) if self._is_second(task) else data

    def _is_second(self, task: MatchTask) -> bool:
        return task.which.kind == GEOMETRIC

    def _with_first_pass(self, data: MatchData, task: MatchTask) -> MatchData:
        view = self._scene.views[task.plan.index]
        camera = self._camera(view)
        depth = self._images.depth(view, camera, PHOTOMETRIC)
        others = [self._scene.views[index] for index in task.plan.sources]
        depths = [self._images.depth(v, self._camera(v), PHOTOMETRIC) for v in others]
        if not depth.any():
            return dataclasses.replace(data, source_depths=depths)
        filled = fill_holes(depth)
        return dataclasses.replace(
            data,
            first_depth=filled,
            first_normals=self._normals(view, camera, filled),
            source_depths=depths,
        )

    def _normals(self, view: View, camera: Camera, filled: DepthMap) -> NormalMap:
        """Normals of the first pass; where it has none, those of its depth."""
        path = self._workspace.normal_map_path(view.name, PHOTOMETRIC)
        normals = np.zeros((*filled.shape, 3), np.float32)
        if path.is_file():
            normals = read_normal_map(path)
        if normals.shape[:2] != filled.shape:
            normals = np.zeros((*filled.shape, 3), np.float32)
        known = normals.any(axis=2, keepdims=True)
        if known.all():
            return normals
        computed = normals_from_depth(filled, index_K(camera))
        return np.where(known, normals, computed)

    def _views(
        self, task: MatchTask, max_image_size: int
    ) -> tuple[MatchView, list[MatchView]]:
        """The view and its sources at that size."""
        indices = (task.plan.index, *task.plan.sources)
        reference, *sources = (
            self._match_view(view, camera_of_size(view, max_image_size))
            for view in (self._scene.views[index] for index in indices)
        )
        return reference, sources

    def _camera(self, view: View) -> Camera:
        """The camera at matching size."""
        return camera_of_size(view, self._config.max_image_size)

    def _match_view(self, view: View, camera: Camera) -> MatchView:
        return MatchView(
            gray=self._images.gray(view, camera),
            K=index_K(camera),
            cam_from_world=view.cam_from_world,
        )

    def _wanted(self, view: View, camera: Camera) -> Wanted:
        """Where a depth is wanted: everywhere, or where the mask says so."""
        size = (camera.width_px, camera.height_px)
        wanted = wanted_pixels(self._workspace.masks, view.name, size)
        return np.ones(size[::-1], np.bool_) if wanted is None else wanted
