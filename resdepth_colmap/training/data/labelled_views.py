"""Views with an initial depth map and ground truth, to train on and to validate with.

Each map of a view counts by itself: unfiltered and filtered maps have other errors.
"""

import dataclasses
import functools
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.pipeline.initial_map import (
    candidate_kinds,
    check_map_size,
    map_path,
)
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS
from resdepth_colmap.pipeline.refine.load_view import view_inputs
from resdepth_colmap.pipeline.refine.loop import IMAGE_CACHE_BYTES
from resdepth_colmap.pipeline.refine.view import ViewInputs
from resdepth_colmap.pipeline.stereo.stage import stereo_workspace
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Progress
from resdepth_colmap.scene import DepthMap, Scene
from resdepth_colmap.training.data.scenes import scene_name

logger = logging.getLogger(__name__)

LEAST_RIGHT_SHARE = 0.3
"""Least share of known pixels within 5 % of the truth: below it, matching failed."""

LEAST_FILLED_SHARE = 0.05


class Loaded(NamedTuple):
    """A labelled view in memory.

    Attributes:
        inputs: Inputs of the refinement.
        truth: True depth at the size of the map, shape (H, W), in units; 0 = unknown.
    """

    inputs: ViewInputs
    truth: DepthMap


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class LabelledView:
    """A depth map of a view with ground truth.

    Attributes:
        workspace: Its workspace.
        scene: All views.
        index: Its index in `scene.views`.
        kind: Kind of the initial map, the word before ".bin".
    """

    workspace: Workspace
    scene: Scene
    index: int
    kind: str

    @property
    def image_name(self) -> str:
        """Name of its image."""
        return self.scene.views[self.index].name

    @property
    def name(self) -> str:
        """Scene, image and kind of map, as a file name without suffix."""
        image = self.image_name.replace("/", "-")
        return f"{scene_name(self.workspace.path)}-{image}-{self.kind}"

    @property
    def map_path(self) -> Path:
        """Its initial depth map."""
        return map_path(self.workspace, self.image_name, self.kind)

    @property
    def truth_path(self) -> Path:
        """Its true depth map."""
        return self.workspace.truth_path(self.image_name)

    @functools.cached_property
    def other_map_paths(self) -> dict[int, Path]:
        """The maps of its kind that it is compared with, by the index of their view."""
        paths = {}
        for choice in choose_sources(self.scene, self.index, NUM_SOURCE_MAPS):
            name = self.scene.views[choice.index].name
            if self.kind in candidate_kinds(self.workspace, name):
                paths[choice.index] = map_path(self.workspace, name, self.kind)
        return paths

    def load(self, num_sources: int, images: ViewImages | None = None) -> Loaded | None:
        """Read the view; None if its map is almost empty or mostly wrong.

        Args:
            num_sources: Number of sources.
            images: Loads images and maps; several views of a workspace can share one.

        Raises:
            WorkspaceError: If a file is missing or broken.
        """
        images = images or ViewImages(self.workspace, IMAGE_CACHE_BYTES)
        check_map_size(self.map_path, self.scene.views[self.index].camera)
        depth = images.whole_map(self.map_path)
        truth = nearest_resized(read_depth_map(self.truth_path), depth.shape[::-1])
        if not _is_usable(depth, truth):
            return None
        choices = choose_sources(self.scene, self.index, num_sources)
        sources = [choice.index for choice in choices]
        maps = {i: images.whole_map(path) for i, path in self.other_map_paths.items()}
        inputs = view_inputs(self.scene, self.index, sources, depth, images, maps)
        return Loaded(inputs, truth)


def load_views(
    views: Sequence[LabelledView], num_sources: int
) -> Iterator[tuple[LabelledView, Loaded]]:
    """Load views, those with unusable maps left out.

    Of consecutive views of one workspace, images and maps that they share are read
    once, as far as the cache holds them.

    Raises:
        WorkspaceError: If a file is missing or broken.
    """
    images: ViewImages | None = None
    for view in views:
        if images is None or images.workspace != view.workspace:
            images = ViewImages(view.workspace, IMAGE_CACHE_BYTES)
        loaded = view.load(num_sources, images)
        if loaded is not None:
            yield view, loaded


def labelled_views(
    path: Path, stereo: StereoConfig | None = None, progress: Progress | None = None
) -> list[LabelledView]:
    """All depth maps of a workspace whose views have ground truth.

    A workspace without any is matched first, as `resdepth-colmap stereo` does.

    Args:
        path: The workspace.
        stereo: Options of the matcher.
        progress: Advances with the matching.

    Raises:
        WorkspaceError: If the workspace is broken, or cannot be matched.
    """
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    views = _with_maps(workspace, scene)
    has_truth = any(workspace.truth_path(view.name).is_file() for view in scene.views)
    if has_truth and not views:
        logger.info("%s: no depth maps; matching.", workspace.path)
        options = stereo or StereoConfig()
        stereo_workspace(workspace, scene, options, progress=progress)
        views = _with_maps(workspace, scene)
    return views


def _with_maps(workspace: Workspace, scene: Scene) -> list[LabelledView]:
    return [
        LabelledView(workspace=workspace, scene=scene, index=index, kind=kind)
        for index, view in enumerate(scene.views)
        if workspace.truth_path(view.name).is_file()
        for kind in candidate_kinds(workspace, view.name)
    ]


def _is_usable(depth: DepthMap, truth: DepthMap) -> bool:
    filled = depth > 0
    known = filled & (truth > 0)
    right = np.abs(depth - truth) < 0.05 * truth
    return bool(
        filled.mean() >= LEAST_FILLED_SHARE
        and known.any()
        and right[known].mean() >= LEAST_RIGHT_SHARE
    )
