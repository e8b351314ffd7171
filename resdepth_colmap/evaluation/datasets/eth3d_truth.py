"""ETH3D's ground-truth depth in the undistorted camera.

ETH3D stores the depth of the distorted image. Its pixels are back-projected with the
distorted camera and projected into the undistorted one with a z-buffer; a bilinear
remapping would mix surfaces with each other, and with unknown depth.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.pixels import CENTER_PX, index_K
from resdepth_colmap.geometry.projection import transform
from resdepth_colmap.geometry.splat import splat_depth
from resdepth_colmap.io.eth3d import (
    DistortedView,
    Eth3dScene,
    read_evaluated,
    read_raw_depth,
)
from resdepth_colmap.scene import Camera, DepthMap, Matrix, View, cam_from_cam

_PIXELS_AT_ONCE = 1 << 21
_LARGEST_ANGLE_DEG = 0.5
_LARGEST_SHIFT = 0.01  # metres; both models have the same camera centres


def undistorted_truth(
    scene: Eth3dScene, distorted: DistortedView, view: View, camera: Camera
) -> DepthMap:
    """The ground-truth depth of an undistorted image, at the size of `camera`.

    Returns:
        Shape (H, W), float32, in metres; 0 = unknown or masked.

    Raises:
        WorkspaceError: If a file is missing, broken or of another size, or the poses of
            the two models differ.
    """
    _check_poses(scene, distorted, view)
    file_name = distorted.name.rpartition("/")[2]
    width_px, height_px = distorted.size_px
    depth = read_raw_depth(scene.truth_path(file_name), width_px, height_px)
    for path in scene.mask_paths(file_name):
        if path.is_file():
            depth *= read_evaluated(path, width_px, height_px)
    chunks = _points(depth, distorted, cam_from_cam(view, distorted))
    return splat_depth(chunks, index_K(camera), camera.height_px, camera.width_px)


def _points(
    depth: DepthMap, distorted: DistortedView, view_from_distorted: Matrix
) -> Iterator[Matrix]:
    """The known points in the frame of the undistorted camera, in chunks."""
    pixels: npt.NDArray[np.int64] = np.flatnonzero(depth)
    for start in range(0, pixels.size, _PIXELS_AT_ONCE):
        chosen = pixels[start : start + _PIXELS_AT_ONCE]
        rows, columns = np.divmod(chosen, depth.shape[1])
        centers = np.stack([columns, rows], axis=1) + CENTER_PX  # index to COLMAP
        xyz = distorted.rays(centers) * depth.ravel()[chosen, np.newaxis]
        yield transform(view_from_distorted, xyz)


def _check_poses(scene: Eth3dScene, distorted: DistortedView, view: View) -> None:
    pose = cam_from_cam(view, distorted)
    cosine = np.clip((np.trace(pose[:, :3]) - 1) / 2, -1, 1)
    angle_deg = float(np.degrees(np.arccos(cosine)))
    shift = float(np.linalg.norm(pose[:, 3]))
    if angle_deg > _LARGEST_ANGLE_DEG or shift > _LARGEST_SHIFT:
        raise WorkspaceError(
            f"{scene.path}: {scene.undistorted_model_path.name} and "
            f"{scene.distorted_model_path.name} place {view.name} at different poses "
            f"({angle_deg:.1f} deg, {shift:.3f} m apart); unpack both anew."
        )
