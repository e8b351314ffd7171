"""What a task reads, as arrays ready to be refined."""

from collections.abc import Mapping, Sequence

import numpy as np

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.pipeline.refine.cross_view import SourceMap
from resdepth_colmap.pipeline.refine.plan import ViewTask
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs
from resdepth_colmap.pipeline.view_images import ViewImages, camera_at_scale
from resdepth_colmap.scene import DepthMap, Scene, View, cam_from_cam


def load_view(task: ViewTask, scene: Scene, images: ViewImages) -> ViewInputs:
    """Read all that a task needs; each depth map once.

    Args:
        task: The view, its sources and its maps.
        scene: The views.
        images: Loads images and maps.

    Raises:
        WorkspaceError: If an image or a map is missing or cannot be read.
    """
    return view_inputs(
        scene,
        task.index,
        [choice.index for choice in task.sources],
        _scaled(images.whole_map(task.initial.path), task.initial.scale),
        images,
        {
            found.view_index: _scaled(images.whole_map(found.path), found.scale)
            for found in task.source_maps
        },
    )


def view_inputs(
    scene: Scene,
    index: int,
    sources: Sequence[int],
    depth: DepthMap,
    images: ViewImages,
    maps: Mapping[int, DepthMap] | None = None,
) -> ViewInputs:
    """The view at the size of its map, its sources at the same scale, and their masks.

    Args:
        scene: The views.
        index: Position of the reference in `scene.views`.
        sources: Positions of its second views, best first.
        depth: Initial depth, shape (H, W), in units; 0 = hole. It may be smaller than
            the image.
        images: Loads the images.
        maps: Depth maps of other views by their positions, best first, of any size.

    Raises:
        WorkspaceError: If an image is missing or cannot be read.
    """
    view = scene.views[index]
    height_px, width_px = depth.shape
    camera = view.camera.resized(width_px, height_px)
    scale = width_px / view.camera.width_px
    second_views = []
    for source_index in sources:
        source = scene.views[source_index]
        source_camera = camera_at_scale(source.camera, scale)
        second_views.append(
            SourceView(
                gray=images.gray(source, source_camera),
                K=index_K(source_camera),
                source_from_reference=cam_from_cam(source, view),
                wanted=images.wanted(source, source_camera),
            )
        )
    return ViewInputs(
        depth=depth,
        gray=images.gray(view, camera),
        colors=images.colors(view, camera),
        K=index_K(camera),
        sources=tuple(second_views),
        source_maps=tuple(
            _source_map(scene.views[other], view, source_depth, images)
            for other, source_depth in (maps or {}).items()
        ),
        wanted=images.wanted(view, camera),
    )


def _scaled(depth: DepthMap, scale: float) -> DepthMap:
    return depth if scale == 1.0 else np.float32(scale) * depth


def _source_map(
    source: View, reference: View, depth: DepthMap, images: ViewImages
) -> SourceMap:
    height_px, width_px = depth.shape
    camera = source.camera.resized(width_px, height_px)
    wanted = images.wanted(source, camera)
    return SourceMap(
        depth=depth if wanted is None else np.where(wanted, depth, np.float32(0)),
        K=index_K(camera),
        source_from_reference=cam_from_cam(source, reference),
    )
