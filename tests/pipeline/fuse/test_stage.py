"""Laws of fusing a workspace, on one that is written to disk."""

import dataclasses
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from fusion_scene import (
    PLANE_UNIT_NORMAL,
    fuse_view,
    fusion_views,
    surface_distance,
    surface_normals,
)

from resdepth_colmap.config import FuseConfig, Fuser
from resdepth_colmap.errors import ConfigError, FusionError, WorkspaceError
from resdepth_colmap.io.colmap.depth_map import write_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.io.images import write_png
from resdepth_colmap.pipeline.fuse import stage as fuse
from resdepth_colmap.pipeline.fuse.stage import fuse_initial, fuse_workspace
from resdepth_colmap.pipeline.fuse.views import LazyViews, MapFiles
from resdepth_colmap.scene import Scene, View


def _write(path: Path, num_views: int = 4) -> tuple[OutputWorkspace, Scene]:
    """A workspace whose refined maps are exact, in `path`."""
    source = Workspace(
        path=path,
        sparse_path=path / "sparse",
        images_path=path / "images",
        stereo_path=path / "stereo",
    )
    output = OutputWorkspace(source=source)
    views = fusion_views(num_views)
    (path / "sparse").mkdir(parents=True)
    names = [view.name for view in views]
    for view in views:
        maps = fuse_view(view)
        write_png(source.image_path(view.name), maps.rgb)
        output.write_maps(view.name, maps.depth, maps.normals)
    output.prepare(names)
    output.write_cfgs(names)
    return output, Scene(views=tuple(views))


def _write_model(output: OutputWorkspace, views: tuple[View, ...]) -> None:
    """A sparse model whose points every view sees."""
    model = pycolmap.Reconstruction()
    points = np.array([(x, y, 3.5) for x in (-0.9, -0.5, 0.5, 0.9) for y in (-1, 0, 1)])
    for number, view in enumerate(views, start=1):
        camera = view.camera
        model.add_camera_with_trivial_rig(
            pycolmap.Camera(
                camera_id=number,
                model="PINHOLE",
                width=camera.width_px,
                height=camera.height_px,
                params=[camera.fx, camera.fy, camera.cx, camera.cy],
            )
        )
        image = pycolmap.Image(
            name=view.name,
            keypoints=np.zeros((len(points), 2)),
            camera_id=number,
            image_id=number,
        )
        pose = pycolmap.Rigid3d(view.cam_from_world)
        model.add_image_with_trivial_frame(image, pose)
    for index, xyz in enumerate(points):
        elements = [
            pycolmap.TrackElement(number, index) for number in range(1, len(views) + 1)
        ]
        model.add_point3D(xyz, pycolmap.Track(elements), np.zeros(3, np.uint8))
    sparse_path = output.workspace.sparse_path
    sparse_path.mkdir(exist_ok=True, parents=True)
    model.write(sparse_path)


def test_the_cloud_of_a_workspace_lies_on_the_surface(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    fused = fuse_workspace(output, scene, FuseConfig())
    assert len(fused.cloud) == fused.statistics.num_points > 2500
    assert surface_distance(fused.cloud.points).max() < 4e-3
    assert fused.num_outliers == fused.num_thinned == 0


def test_two_views_are_a_workspace(tmp_path: Path) -> None:
    output, scene = _write(tmp_path, num_views=2)
    assert len(fuse_workspace(output, scene, FuseConfig()).cloud) > 1500


def test_exact_maps_before_give_as_many_points_as_after(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    kinds = {view.name: {"input": "photometric"} for view in scene.views}
    for view in scene.views:
        path = output.source.depth_map_path(view.name, "photometric")
        write_depth_map(path, fuse_view(view).depth)
    before = fuse_initial(output.source, scene, kinds, FuseConfig()).statistics
    after = fuse_workspace(output, scene, FuseConfig()).statistics
    assert before.num_pixels == after.num_pixels
    # Normals computed across the silhouette differ from the exact ones.
    assert before.num_points == pytest.approx(after.num_points, rel=0.05)


def test_few_bytes_of_memory_change_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, scene = _write(tmp_path)
    expected = fuse_workspace(output, scene, FuseConfig()).cloud
    monkeypatch.setattr(fuse, "MAX_NUM_BYTES", 1)
    cloud = fuse_workspace(output, scene, FuseConfig()).cloud
    assert np.array_equal(cloud.points, expected.points)


def test_the_voxel_size_is_honoured(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    whole = fuse_workspace(output, scene, FuseConfig())
    thin = fuse_workspace(output, scene, FuseConfig(voxel_size=0.2))
    num_points = len(thin.cloud)
    assert thin.num_thinned == len(whole.cloud) - num_points > 0
    origin = whole.cloud.points.min(axis=0) - 0.1  # open3d's grid starts there
    cells = np.floor((whole.cloud.points - origin) / 0.2)
    assert num_points == pytest.approx(len(np.unique(cells, axis=0)), rel=0.02)
    assert np.linalg.norm(thin.cloud.normals, axis=1) == pytest.approx(1, abs=1e-5)


def test_voxels_too_small_to_count_are_refused(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    with pytest.raises(ConfigError, match="voxel_size=1e-12 is too small"):
        fuse_workspace(output, scene, FuseConfig(voxel_size=1e-12))


def test_outliers_are_removed_when_asked(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    # One pixel of one view, three times too far, and a single view is enough.
    maps = fuse_view(scene.views[0])
    maps.depth[5, 5] *= 3
    output.write_maps(scene.views[0].name, maps.depth, maps.normals)
    config = FuseConfig(min_num_views=1)
    kept = fuse_workspace(output, scene, config).cloud
    assert surface_distance(kept.points).max() > 1
    config = FuseConfig(min_num_views=1, remove_outliers=True)
    fused = fuse_workspace(output, scene, config)
    assert fused.num_outliers > 0
    assert surface_distance(fused.cloud.points).max() < 4e-3


def test_no_agreement_is_an_error_with_numbers_and_a_way_out(tmp_path: Path) -> None:
    output, scene = _write(tmp_path, num_views=3)
    for factor, view in zip((1.0, 1.3, 1.7), scene.views, strict=True):
        maps = fuse_view(view)
        output.write_maps(view.name, maps.depth * np.float32(factor), maps.normals)
    with pytest.raises(FusionError, match=r"of 9216 pixels.*--min-num-views"):
        fuse_workspace(output, scene, FuseConfig())


def test_without_refined_maps_the_error_names_the_command(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    missing = Scene(
        views=tuple(
            dataclasses.replace(view, name=f"other-{view.name}") for view in scene.views
        )
    )
    with pytest.raises(FusionError, match="resdepth-colmap refine"):
        fuse_workspace(output, missing, FuseConfig())


def test_colmap_fuses_the_same_surface(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    _write_model(output, scene.views)
    scene = dataclasses.replace(scene, num_shared_points=np.full((4, 4), 12))
    fused = fuse_workspace(output, scene, FuseConfig(fuser=Fuser.COLMAP))
    assert len(fused.cloud) == fused.statistics.num_points > 1000
    # COLMAP un-projects the corner of a pixel, not its centre: half a pixel is 0.03.
    assert surface_distance(fused.cloud.points).max() < 0.05
    on_plane = (
        np.abs(surface_normals(fused.cloud.points) - PLANE_UNIT_NORMAL).max(1) < 1e-6
    )
    cosine = fused.cloud.normals[on_plane] @ PLANE_UNIT_NORMAL
    assert np.median(cosine) > 0.999


def test_colmap_without_sparse_points_is_refused_with_the_other_fuser(
    tmp_path: Path,
) -> None:
    output, scene = _write(tmp_path)
    with pytest.raises(FusionError, match="--fuser open3d"):
        fuse_workspace(output, scene, FuseConfig(fuser=Fuser.COLMAP))


def test_maps_smaller_than_their_image_are_fused_as_well(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    for view in scene.views:
        small = dataclasses.replace(view, camera=view.camera.resized(32, 24))
        maps = fuse_view(small)
        output.write_maps(view.name, maps.depth, maps.normals)
    fused = fuse_workspace(output, scene, FuseConfig())
    assert len(fused.cloud) > 500
    assert surface_distance(fused.cloud.points).max() < 2e-2


def test_maps_of_different_sizes_are_refused_by_name(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    view = scene.views[0]
    write_depth_map(output.confidence_map_path(view.name), np.ones((5, 7), np.float32))
    with pytest.raises(WorkspaceError, match=r"confidence_maps.*7 x 5 px"):
        fuse_workspace(output, scene, FuseConfig())


def test_lazy_views_keep_no_more_than_they_may(tmp_path: Path) -> None:
    output, scene = _write(tmp_path)
    files = [
        MapFiles(
            view=view,
            image_path=output.workspace.image_path(view.name),
            depth_path=output.depth_map_path(view.name),
        )
        for view in scene.views
    ]
    one = files[0].read().nbytes
    views = LazyViews(files, 2 * one)
    first = views[0]
    assert views[1] is views[1] and views[0] is first
    assert views[2].name == "2.png"
    assert views[0] is first  # the oldest went: that was 1
    assert [view.name for view in views[1:3]] == ["1.png", "2.png"]
