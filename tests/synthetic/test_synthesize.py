"""Laws of the rendered rooms: exact, repeatable, readable by COLMAP's library."""

from pathlib import Path
from unittest import mock

import numpy as np
import pycolmap
import pytest

from resdepth_colmap.config import SynthesisConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.scene import DepthMap, Matrix, View
from resdepth_colmap.synthetic.room import Style
from resdepth_colmap.synthetic.synthesize import (
    RenderedScene,
    render_room,
    synthesize,
    write_scene,
)

CONFIG = SynthesisConfig(num_views=3, width_px=96, height_px=64)


@pytest.fixture(scope="module", params=list(Style))
def scene(request: pytest.FixtureRequest) -> RenderedScene:
    return render_room(CONFIG, 3, request.param)


def _world_points(view: View, depth: DepthMap) -> Matrix:
    camera = view.camera
    row, column = np.indices(depth.shape)
    x = (column + 0.5 - camera.cx) / camera.fx * depth
    y = (row + 0.5 - camera.cy) / camera.fy * depth
    in_camera = np.stack([x, y, depth], axis=2).reshape(-1, 3)
    rotation, shift = view.cam_from_world[:, :3], view.cam_from_world[:, 3]
    return np.asarray((in_camera - shift) @ rotation)


def _project(view: View, xyz: Matrix) -> tuple[Matrix, Matrix]:
    camera = view.camera
    in_camera = xyz @ view.cam_from_world[:, :3].T + view.cam_from_world[:, 3]
    z = in_camera[:, 2]
    focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    return in_camera[:, :2] / z[:, None] * focal + centre, z


def test_a_room_is_closed(scene: RenderedScene) -> None:
    for depth in scene.depths:
        assert np.mean(depth > 0) > 0.99


def test_pictures_have_the_size_asked_for_and_are_exposed(scene: RenderedScene) -> None:
    for image in scene.images:
        assert image.shape == (64, 96, 3)
        assert image.dtype == np.uint8
        assert 20 < image.mean() < 235
        assert image.std() > 8


def test_depth_agrees_between_views(scene: RenderedScene) -> None:
    first, second = scene.views[:2]
    xy, z = _project(second, _world_points(first, scene.depths[0]))
    column, row = np.floor(xy).astype(int).T
    inside = (column >= 0) & (column < 96) & (row >= 0) & (row < 64) & (z > 0)
    there = scene.depths[1][row[inside], column[inside]]
    assert inside.mean() > 0.3
    # in front of what the second view sees, nothing of the first view's can be
    # (but for slanted and thin things, which half a pixel changes)
    assert np.mean(z[inside] < 0.97 * there) < 0.12
    assert np.mean(np.abs(z[inside] / there - 1) < 0.01) > 0.5


def test_sparse_points_lie_where_their_views_see_them(scene: RenderedScene) -> None:
    points = scene.points
    assert len(points.xyz) >= 20
    assert (points.visible.sum(axis=0) >= 2).all()
    for number, view in enumerate(scene.views):
        seen = points.visible[number]
        xy, z = _project(view, points.xyz[seen])
        assert np.abs(xy - points.xy[number, seen]).max() < 2
        column, row = np.floor(xy).astype(int).T
        depth = scene.depths[number][row, column]
        assert np.abs(z / depth - 1).max() < 0.011


def test_the_same_seed_gives_the_same_bytes() -> None:
    first, second = render_room(CONFIG, 5), render_room(CONFIG, 5)
    for one, other in zip(first.images, second.images, strict=True):
        np.testing.assert_array_equal(one, other)
    for here, there in zip(first.depths, second.depths, strict=True):
        np.testing.assert_array_equal(here, there)
    np.testing.assert_array_equal(first.points.xyz, second.points.xyz)
    third = render_room(CONFIG, 6)
    assert not np.array_equal(first.images[0], third.images[0])


def test_colmap_opens_what_is_written(tmp_path: Path, scene: RenderedScene) -> None:
    write_scene(tmp_path, scene)
    model = pycolmap.Reconstruction(tmp_path / "sparse")
    assert model.num_reg_images() == 3
    assert model.num_points3D() == len(scene.points.xyz)
    assert 0 < model.compute_mean_reprojection_error() < 2
    for number, view in enumerate(scene.views):
        image = model.images[view.image_id]
        assert image.name == view.name
        np.testing.assert_allclose(
            image.cam_from_world().matrix(), view.cam_from_world, atol=1e-9
        )
        truth = tmp_path / "ground_truth" / f"{view.name}.bin"
        np.testing.assert_array_equal(read_depth_map(truth), scene.depths[number])
        theirs = pycolmap.DepthMap()
        theirs.read(truth)
        np.testing.assert_array_equal(theirs.to_array(), scene.depths[number])
        picture = read_rgb(tmp_path / "images" / view.name)
        np.testing.assert_array_equal(picture, scene.images[number])
    choices = (tmp_path / "stereo" / "patch-match.cfg").read_text()
    assert choices.startswith("0000.png\n__auto__, 20\n")


def test_finished_rooms_are_kept_and_unfinished_ones_made_anew(tmp_path: Path) -> None:
    config = SynthesisConfig(
        num_scenes=2, num_views=2, width_px=64, height_px=48, seed=4
    )
    finished = tmp_path / "room_000004"
    finished.mkdir()
    leftover = tmp_path / ".room_000005.partial"
    leftover.mkdir()
    (leftover / "half").touch()
    progress = mock.MagicMock()
    paths = synthesize(tmp_path, config, progress)
    assert paths == [finished, tmp_path / "room_000005"]
    progress.stage.assert_called_once_with("Rendering", 2)
    advance = progress.stage.return_value.__enter__.return_value
    assert advance.call_args_list == [mock.call(1.0)] * 2
    assert list(finished.iterdir()) == []
    assert not leftover.exists()
    assert not (paths[1] / "half").exists()
    assert len(list((paths[1] / "images").iterdir())) == 2


def test_a_folder_that_cannot_be_made_is_named(
    tmp_path: Path, scene: RenderedScene
) -> None:
    taken = tmp_path / "taken"
    taken.touch()
    with pytest.raises(WorkspaceError, match="taken"):
        write_scene(taken / "room", scene)


@pytest.mark.slow
def test_many_workers_render_the_same_and_end_quietly(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    config = SynthesisConfig(num_scenes=2, num_views=2, width_px=64, height_px=48)
    alone = synthesize(tmp_path / "alone", config)
    together = synthesize(tmp_path / "together", config, num_workers=2)
    for one, other in zip(alone, together, strict=True):
        for path in (one / "images").iterdir():
            assert path.read_bytes() == (other / "images" / path.name).read_bytes()
    assert capfd.readouterr().err == ""
