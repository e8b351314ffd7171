"""Dense workspaces with `ground_truth/` as samples."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.sample import (
    DepthSample,
    InitialDepth,
    LazySample,
    SampleOptions,
)
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.colmap.cfg import SourceKind, read_sources
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, check_images, open_workspace
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.pipeline.initial_map import (
    InitialMap,
    candidate_kinds,
    choose_initial_map,
)
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.scene import DepthMap, Scene, View

TRUTH_FOLDER = "ground_truth"
SEEN_SUFFIX = ".nonoccluded.png"
IMAGE_CACHE_BYTES = 256 << 20
_SEEN = 1  # 255 in the file; occluded pixels are grey
_WAY_OUT = "see data/README.md for the layout of a workspace with ground truth"


def read_workspace_samples(path: Path, options: SampleOptions) -> list[LazySample]:
    """The views of a workspace with `ground_truth/<image>.bin`, and existing maps.

    The initial depth of a view is its map with the fewest holes; a view without a map
    is to be matched against the sources in patch-match.cfg, or the best ones. Nothing
    is written.

    Raises:
        WorkspaceError: If the workspace or its ground truth is missing, broken, or
            differs from the image in size.
    """
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    names = _names_with_truth(workspace, scene)
    check_images(workspace, scene)
    images = ViewImages(workspace, IMAGE_CACHE_BYTES)
    return [
        functools.partial(_sample, workspace, scene, scene.index(name), images, options)
        for name in names
    ]


def _names_with_truth(workspace: Workspace, scene: Scene) -> list[str]:
    folder = workspace.path / TRUTH_FOLDER
    if not folder.is_dir():
        raise WorkspaceError(
            f"{workspace.path}: no {TRUTH_FOLDER}/, so there is nothing to compare "
            f"with; {_WAY_OUT}."
        )
    names = [v.name for v in scene.views if workspace.truth_path(v.name).is_file()]
    if not names:
        raise WorkspaceError(
            f"{folder}: no map of any image of the model (that of "
            f"{scene.views[0].name} would be {scene.views[0].name}.bin); {_WAY_OUT}."
        )
    return names


def _sample(
    workspace: Workspace,
    scene: Scene,
    index: int,
    images: ViewImages,
    options: SampleOptions,
) -> DepthSample:
    view = scene.views[index]
    truth_path = workspace.truth_path(view.name)
    truth = read_depth_map(truth_path)
    _check_shape(truth_path, truth.shape, view)
    initial = _initial(workspace, view)
    num_sources = options.stereo.max_num_sources
    if initial is not None:
        num_sources = max(options.num_sources, NUM_SOURCE_MAPS)
    listed = _listed(workspace, scene, view.name)
    choices = choose_sources(scene, index, num_sources, listed)
    if not choices:
        raise WorkspaceError(
            f"{workspace.path}: no other view overlaps with {view.name}, so it can be "
            "neither matched nor refined; remove its map from ground_truth/."
        )
    sources = [choice.index for choice in choices]
    if initial is not None:
        maps = [_map_of(workspace, scene.views[other]) for other in sources]
        initial = dataclasses.replace(initial, source_depths=tuple(maps))
    near, far = options.stereo.depth_min, options.stereo.depth_max
    return DepthSample(
        name=view.name,
        reference=_match_view(images, view),
        sources=tuple(_match_view(images, scene.views[other]) for other in sources),
        depth_range=(near, far) if near > 0 else depth_range(scene, index, sources),
        truth=truth,
        seen=_seen(workspace, view),
        initial=initial,
        colors=images.colors(view, view.camera),
        source_colors=tuple(
            images.colors(scene.views[other], scene.views[other].camera)
            for other in sources[:NUM_SOURCE_MAPS]
        ),
    )


def _seen(workspace: Workspace, view: View) -> npt.NDArray[np.bool_] | None:
    path = workspace.path / TRUTH_FOLDER / f"{view.name}{SEEN_SUFFIX}"
    if not path.is_file():
        return None
    seen = read_gray(path) == _SEEN
    _check_shape(path, seen.shape, view)
    return np.asarray(seen)


def _initial(workspace: Workspace, view: View) -> InitialDepth | None:
    found = _fullest_map(workspace, view)
    if found is None:
        return None
    depth = read_depth_map(found.path)
    _check_shape(found.path, depth.shape, view)
    if not found.filled:
        raise WorkspaceError(f"{found.path}: no pixel has a depth; compute it again.")
    return InitialDepth(depth=depth, origin=f"{found.kind} maps in stereo/")


def _map_of(workspace: Workspace, view: View) -> DepthMap | None:
    """The map of a source at the size of its image; None if it has none."""
    found = _fullest_map(workspace, view)
    if found is None:
        return None
    size_px = (view.camera.width_px, view.camera.height_px)
    return nearest_resized(read_depth_map(found.path), size_px)


def _fullest_map(workspace: Workspace, view: View) -> InitialMap | None:
    kinds = candidate_kinds(workspace, view.name)
    name, camera = view.name, view.camera
    return choose_initial_map(workspace, name, camera, kinds) if kinds else None


def _check_shape(path: Path, shape: tuple[int, ...], view: View) -> None:
    expected = (view.camera.height_px, view.camera.width_px)
    if shape != expected:
        raise WorkspaceError(
            f"{path}: {shape[1]} x {shape[0]} pixels, but its image has "
            f"{expected[1]} x {expected[0]}; maps, masks and ground truth need the "
            "size of the image."
        )


def _listed(workspace: Workspace, scene: Scene, name: str) -> list[int] | None:
    """The sources of an image in patch-match.cfg; None if it lists none."""
    path = workspace.stereo_path / "patch-match.cfg"
    spec = read_sources(path).get(name) if path.is_file() else None
    if spec is None or spec.kind is not SourceKind.EXPLICIT:
        return None
    indices = [scene.index(source) for source in spec.names]
    return [index for index in indices if index >= 0] or None


def _match_view(images: ViewImages, view: View) -> MatchView:
    return MatchView(
        gray=images.gray(view, view.camera),
        K=index_K(view.camera),
        cam_from_world=view.cam_from_world,
    )
