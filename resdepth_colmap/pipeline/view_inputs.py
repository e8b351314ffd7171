"""One view of a workspace, as arrays ready to be refined."""

from collections.abc import Callable, Sequence

from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_depth
from resdepth_colmap.pipeline.refine import SourceView, ViewInputs
from resdepth_colmap.pipeline.view_images import ViewImages, camera_at_scale
from resdepth_colmap.scene import DepthMap, Scene, cam_from_cam


def view_inputs(
    scene: Scene,
    index: int,
    sources: Sequence[int],
    depth: DepthMap,
    images: ViewImages,
    depth_of: Callable[[int], DepthMap | None] | None = None,
) -> ViewInputs:
    """The view at the size of its map, its sources at the same scale.

    Args:
        scene: The views.
        index: Position of the reference in `scene.views`.
        sources: Positions of its second views, best first.
        depth: Initial depth, shape (H, W), in units; 0 = hole. It may be smaller than
            the image.
        images: Loads the images.
        depth_of: Gives the depth map of the view at a position, of any size of the
            image's shape; None for a view that has none. None = none has.

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
        gray = images.gray(source, source_camera)
        source_depth = None if depth_of is None else depth_of(source_index)
        if source_depth is not None:
            source_depth = nearest_depth(source_depth, gray.shape)
        second_views.append(
            SourceView(
                gray=gray,
                K=index_K(source_camera),
                source_from_reference=cam_from_cam(source, view),
                depth=source_depth,
            )
        )
    return ViewInputs(
        depth=depth,
        gray=images.gray(view, camera),
        K=index_K(camera),
        sources=tuple(second_views),
    )
