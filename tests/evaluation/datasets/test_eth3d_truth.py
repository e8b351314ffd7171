"""Laws of bringing ETH3D's true depth to the undistorted camera."""

import os
from pathlib import Path

import numpy as np
import pytest
from eth3d_scene import (
    IMAGES,
    MISSING_SHARE,
    RenderedEth3d,
    write_eth3d_scene,
)
from scipy.ndimage import maximum_filter, minimum_filter
from warped_samples import difference_when_warped

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.datasets.eth3d import Eth3dOptions, eth3d_sources
from resdepth_colmap.evaluation.datasets.eth3d_truth import undistorted_truth
from resdepth_colmap.evaluation.datasets.paper import PAPER_IMAGE_WIDTH_PX
from resdepth_colmap.evaluation.datasets.sample import SampleOptions
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import project
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.eth3d import Eth3dScene, read_distorted_views
from resdepth_colmap.io.ply_points import read_ply_points
from resdepth_colmap.io.scan_alignment import read_scan_alignment
from resdepth_colmap.scene import Camera, DepthMap, View


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> RenderedEth3d:
    return write_eth3d_scene(tmp_path_factory.mktemp("eth3d") / "room")


def truth_of(rendered: RenderedEth3d, index: int, camera: Camera) -> DepthMap:
    files = Eth3dScene(path=rendered.path)
    distorted = read_distorted_views(files.distorted_model_path)[IMAGES[index]]
    return undistorted_truth(files, distorted, view_of(files, index), camera)


def view_of(files: Eth3dScene, index: int) -> View:
    model_path = files.undistorted_model_path
    return read_scene(model_path, files.images_path, files.path).views[index]


@pytest.mark.parametrize("width_px", [245, 120, 61])
@pytest.mark.parametrize("index", [0, 1])
def test_the_truth_is_exact_within_the_pixel_grid(
    rendered: RenderedEth3d, index: int, width_px: int
) -> None:
    camera = rendered.camera(width_px)
    exact = rendered.depth(index, camera)
    truth = truth_of(rendered, index, camera)
    known = truth > 0
    nearest = minimum_filter(exact, 3, mode="nearest")
    farthest = maximum_filter(exact, 3, mode="nearest")
    inside = (truth >= 0.999 * nearest) & (truth <= 1.001 * farthest)
    # Points in the border's pixels may lie beyond the outermost centres.
    assert inside[1:-1, 1:-1][known[1:-1, 1:-1]].all()
    if width_px < 200:  # several points a pixel: nearly all of them are known
        assert known[5:-5, 5:-5].mean() > 0.9


def test_the_half_pixel_is_right(rendered: RenderedEth3d) -> None:
    camera = rendered.camera(61)
    exact = rendered.depth(0, camera)
    error = truth_of(rendered, 0, camera) - exact
    slope = np.gradient(exact, axis=1)
    # On the wall, away from the ball; half a pixel too far left or right would show.
    wall = np.s_[4:36, 2:18]
    counted = error[wall][np.abs(error[wall]) < 0.05]
    assert counted.size > 300
    assert abs(counted.mean()) < 0.05 * abs(slope[wall].mean())


def test_what_the_mask_excludes_is_not_known(rendered: RenderedEth3d) -> None:
    camera = rendered.camera(120)
    exact = rendered.depth(0, camera)
    truth = truth_of(rendered, 0, camera)
    assert (truth < 1.2 * exact).all()  # it would be 1.5 times too far there
    assert (truth == 0).mean() > 20 * 30 / (160 * 240) * 0.8


def test_most_of_what_is_given_is_kept(rendered: RenderedEth3d) -> None:
    truth = truth_of(rendered, 0, rendered.camera(245))
    assert (truth > 0).mean() > 0.8 * (1 - MISSING_SHARE)


def test_the_scan_lies_on_the_same_surface(rendered: RenderedEth3d) -> None:
    (scan,) = read_scan_alignment(rendered.path / "dslr_scan_eval/scan_alignment.mlp")
    pose = scan.world_from_scan.astype(np.float64)
    xyz = read_ply_points(scan.path) @ pose[:3, :3].T + pose[:3, 3]
    camera = rendered.camera(120)
    xy, z = project(xyz, index_K(camera))  # view 0 is the world
    column, row = np.rint(xy).astype(int).T
    inside = (column >= 0) & (column < 120) & (row >= 0) & (row < camera.height_px)
    truth = truth_of(rendered, 0, camera)[row[inside], column[inside]]
    error = np.abs(z[inside] - truth)[truth > 0]
    assert np.median(error) < 0.02


def test_points_outside_of_the_image_are_passed_over(rendered: RenderedEth3d) -> None:
    camera = rendered.camera(120)
    cut = Camera(
        width_px=40,
        height_px=30,
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx - 50,
        cy=camera.cy - 20,
    )
    whole = truth_of(rendered, 0, camera)
    assert np.array_equal(truth_of(rendered, 0, cut), whole[20:50, 50:90])


def test_the_files_are_read_where_they_are(rendered: RenderedEth3d) -> None:
    files = Eth3dScene(path=rendered.path)
    assert files.name == "room"
    assert files.truth_path(IMAGES[0]).stat().st_size == 4 * 240 * 160
    assert files.mask_paths(IMAGES[0])[0].is_file()
    assert not files.mask_paths(IMAGES[0])[1].exists()
    assert files.image_path(view_of(files, 0).name).is_file()


OPTIONS = SampleOptions(stereo=StereoConfig(), num_sources=1)


def test_the_truth_carries_one_image_into_the_other(rendered: RenderedEth3d) -> None:
    (scene,) = eth3d_sources(rendered.path.parent, Eth3dOptions())
    sample = scene.read(OPTIONS)[0]()
    right = difference_when_warped(sample)
    assert right < 0.5 * difference_when_warped(sample, 1.05)


@pytest.mark.data
def test_the_real_truth_carries_one_photo_into_the_other() -> None:
    root = os.environ.get("RESDEPTH_ETH3D")
    if not root:
        pytest.skip("no scenes of ETH3D (set RESDEPTH_ETH3D to their folder)")
    for scene in eth3d_sources(Path(root), Eth3dOptions(num_pairs=1)):
        (load,) = scene.read(OPTIONS)
        sample = load()
        assert max(sample.truth.shape) == PAPER_IMAGE_WIDTH_PX
        assert (sample.truth > 0).mean() > 0.2
        right = difference_when_warped(sample)
        assert right < 0.9 * difference_when_warped(sample, 1.05), scene.name
