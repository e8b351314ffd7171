"""COLMAP's PatchMatch on a few views, unfiltered: the initial depth of the paper."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import BackendUnavailableError
from resdepth_colmap.geometry.pixels import CENTER_PX
from resdepth_colmap.io.colmap.cfg import (
    SourceKind,
    SourceSpec,
    write_patch_match_cfg,
)
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.io.png import encode_png
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap


def match_by_colmap(
    views: Sequence[MatchView], depth_range: tuple[float, float], config: StereoConfig
) -> DepthMap:
    """Match the first view against the others, in a temporary workspace.

    Of `config` window and weights count; other options keep COLMAP's defaults.

    Returns:
        The photometric depth map without COLMAP's filter, shape (H, W), in units; 0 =
        no depth.

    Raises:
        BackendUnavailableError: If COLMAP fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        write_pair_workspace(path, views)
        options = pycolmap.PatchMatchOptions()
        options.window_radius = config.window_radius
        options.window_step = config.window_step
        options.sigma_color = config.sigma_color
        options.depth_min, options.depth_max = depth_range
        options.geom_consistency = False
        options.filter = False
        try:
            pycolmap.patch_match_stereo(str(path), options=options)
        except (RuntimeError, ValueError) as error:
            raise BackendUnavailableError(
                f"COLMAP's PatchMatch failed ({error}); use --stereo cpu."
            ) from error
        name = f"{_name(0)}.photometric.bin"
        return read_depth_map(path / "stereo" / "depth_maps" / name)


def write_pair_workspace(path: Path, views: Sequence[MatchView]) -> None:
    """Write a dense workspace, images of 8 bits, for COLMAP to match the first view.

    Raises:
        WorkspaceError: If a file cannot be written.
    """
    model = pycolmap.Reconstruction()
    for index, view in enumerate(views):
        gray = np.rint(view.gray * 255).astype(np.uint8)
        write_whole(path / "images" / _name(index), encode_png(gray))
        model.add_camera_with_trivial_rig(_camera(index + 1, view))
        image = pycolmap.Image(
            name=_name(index), camera_id=index + 1, image_id=index + 1
        )
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(view.cam_from_world))
    (path / "sparse").mkdir()
    model.write_binary(str(path / "sparse"))
    for folder in ("depth_maps", "normal_maps", "consistency_graphs"):
        (path / "stereo" / folder).mkdir(parents=True)
    names = tuple(_name(index) for index in range(1, len(views)))
    sources = {_name(0): SourceSpec(kind=SourceKind.EXPLICIT, names=names)}
    write_patch_match_cfg(path / "stereo" / "patch-match.cfg", sources)


def _camera(camera_id: int, view: MatchView) -> pycolmap.Camera:
    height_px, width_px = view.gray.shape
    K = view.K
    return pycolmap.Camera(
        camera_id=camera_id,
        model="PINHOLE",
        width=width_px,
        height=height_px,
        # Index to COLMAP's pixel origin.
        params=[K[0, 0], K[1, 1], K[0, 2] + CENTER_PX, K[1, 2] + CENTER_PX],
    )


def _name(index: int) -> str:
    return f"{index}.png"
