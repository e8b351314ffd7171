"""Law: a scene far from its origin gives the same shape as near it."""

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import NAMES
from scipy.spatial import cKDTree
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import FuseConfig, Fuser, RefineConfig
from resdepth_colmap.errors import FusionError
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import read_cloud
from resdepth_colmap.pipeline.run import run_refine
from resdepth_colmap.pipeline.run_config import RunConfig
from resdepth_colmap.report.write_report import write_report
from resdepth_colmap.scene import Scene

OFFSET = np.array([500000.0, 4500000.0, 100.0])


def moved_folder(path: Path, offset: np.ndarray) -> Path:
    folder = plane_folder(path)
    model = pycolmap.Reconstruction(folder / "sparse")
    model.transform(pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), offset))
    model.write(folder / "sparse")
    return folder


def refined(path: Path, offset: np.ndarray, fuser: Fuser = Fuser.OPEN3D) -> Path:
    folder = moved_folder(path, offset)
    config = RunConfig(
        refine=RefineConfig(tile_px=64, overlap_px=16, weights=identity_weights(path)),
        fuse=FuseConfig(fuser=fuser),
    )
    run_refine(folder, config)
    return folder


def scene_of(folder: Path) -> Scene:
    workspace = open_workspace(folder)
    return read_scene(workspace.sparse_path, workspace.images_path, workspace.path)


def test_what_a_scene_knows_of_its_views_does_not_depend_on_its_origin(
    tmp_path: Path,
) -> None:
    near, far = (
        scene_of(moved_folder(tmp_path / name, offset))
        for name, offset in (("near", np.zeros(3)), ("far", OFFSET))
    )
    assert not near.origin_in_world.any()
    np.testing.assert_allclose(far.origin_in_world, OFFSET, atol=20)
    for first, second in zip(near.views, far.views, strict=True):
        center = second.center_in_world + far.origin_in_world - OFFSET
        np.testing.assert_allclose(center, first.center_in_world, atol=1e-6)
    for name in ("num_shared_points", "triangulation_angle_deg", "depth_range"):
        expected, found = getattr(near, name), getattr(far, name)
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)


def test_maps_and_cloud_are_the_same_and_the_cloud_is_in_doubles(
    tmp_path: Path,
) -> None:
    near = refined(tmp_path / "near", np.zeros(3))
    far = refined(tmp_path / "far", OFFSET)
    for name in NAMES:
        maps = f"resdepth/stereo/depth_maps/{name}.geometric.bin"
        expected = read_depth_map(near / maps)
        np.testing.assert_allclose(read_depth_map(far / maps), expected, rtol=1e-4)
    assert b"property double x" in (far / "resdepth/fused.ply").read_bytes()[:500]
    found = read_cloud(far / "resdepth/fused.ply").points - OFFSET
    expected = read_cloud(near / "resdepth/fused.ply").points
    assert expected.dtype == np.float32
    assert len(found) == pytest.approx(len(expected), rel=0.01)
    assert np.quantile(cKDTree(expected).query(found)[0], 0.99) < 1e-3
    write_report(far)  # the cameras stand where the cloud is


def test_colmaps_fusion_is_refused_there(tmp_path: Path) -> None:
    with pytest.raises(FusionError, match="too far from its origin"):
        refined(tmp_path, OFFSET, Fuser.COLMAP)
