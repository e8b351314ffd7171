"""Laws of what is kept in memory of images and maps."""

from pathlib import Path

import numpy as np
from planes import NAMES, write_plane_workspace

from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.images import write_png
from resdepth_colmap.pipeline.view_images import ViewImages


def test_images_and_maps_come_at_the_size_that_is_asked_for(tmp_path: Path) -> None:
    (first, *_) = write_plane_workspace(tmp_path, kinds=("photometric",))
    images = ViewImages(open_workspace(tmp_path), 1 << 20)
    half = first.view.camera.resized(40, 30)
    assert images.gray(first.view, half).shape == (30, 40)
    depth = images.depth(first.view, half, "photometric")
    assert depth.shape == (30, 40)
    assert np.isin(depth, first.depth).all()  # nothing is mixed across an edge
    whole = images.depth(first.view, first.view.camera, "photometric")
    assert np.array_equal(whole, first.depth)


def test_a_view_without_a_map_has_no_depth_anywhere(tmp_path: Path) -> None:
    (first, *_) = write_plane_workspace(tmp_path, kinds=())
    images = ViewImages(open_workspace(tmp_path), 1 << 20)
    assert NAMES[0] == first.view.name
    depth = images.depth(first.view, first.view.camera, "photometric")
    assert depth.shape == first.depth.shape
    assert not depth.any()


def test_colours_are_those_of_the_photo_at_the_size_that_is_asked_for(
    tmp_path: Path,
) -> None:
    (first, *_) = write_plane_workspace(tmp_path, kinds=())
    workspace = open_workspace(tmp_path)
    photo = np.random.default_rng(0).integers(0, 256, (*first.depth.shape, 3))
    write_png(workspace.image_path(first.view.name), photo.astype(np.uint8))
    images = ViewImages(workspace, 1 << 20)
    whole = images.colors(first.view, first.view.camera)
    np.testing.assert_allclose(whole, photo / 255, atol=1e-6)
    half = first.view.camera.resized(whole.shape[1] // 2, whole.shape[0] // 2)
    means = whole.reshape(half.height_px, 2, half.width_px, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(images.colors(first.view, half), means, atol=1e-5)
