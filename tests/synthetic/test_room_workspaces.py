"""Laws of rooms on disk: read back as rendered, resumed, the same from two workers."""

import dataclasses
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from analytic_scene import turned
from rendered_rooms import CONFIG, OTHER_SEED, SEED, rendered

from resdepth_colmap.config import SynthesisConfig
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.projection import back_project, project, transform
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.scene import Matrix, cam_from_cam
from resdepth_colmap.synthetic import synthesize as module
from resdepth_colmap.synthetic.synthesize import (
    RenderedScene,
    synthesize,
    write_scene,
)

WIDTH_PX, HEIGHT_PX = CONFIG.width_px, CONFIG.height_px


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rooms") / "room"
    write_scene(path, rendered())
    return path


@pytest.fixture
def renders(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The seeds that were rendered: the renderer itself is replaced by a known room."""
    seeds: list[int] = []

    def render(config: SynthesisConfig, seed: int) -> RenderedScene:
        seeds.append(seed)
        return rendered()

    monkeypatch.setattr(module, "render_room", render)
    return seeds


def _files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _depth_ratios(scene: RenderedScene, first: int, second: int) -> Matrix:
    """Depth in the second view, over that of the first view's points there."""
    here, there = scene.views[first], scene.views[second]
    points = back_project(scene.depths[first], index_K(here.camera))
    points = transform(cam_from_cam(there, here), points)
    xy, z = project(points.reshape(-1, 3), index_K(there.camera))
    column, row = np.round(xy).astype(int).T
    inside = (z > 0) & (column >= 0) & (row >= 0)
    inside &= (column < WIDTH_PX) & (row < HEIGHT_PX)
    seen = scene.depths[second][row[inside], column[inside]]
    return np.asarray(seen / z[inside], dtype=np.float64)


@pytest.mark.parametrize("seed", [SEED, OTHER_SEED])
@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_what_both_views_see_has_one_depth(seed: int, first: int, second: int) -> None:
    ratios = _depth_ratios(rendered(seed), first, second)
    assert len(ratios) > 0.2 * WIDTH_PX * HEIGHT_PX
    not_hidden = ratios[ratios > 0.99]
    assert np.median(np.abs(not_hidden - 1)) < 0.005
    assert np.mean(not_hidden < 1.01) > 0.85  # the rest: edges between two pixels


def test_a_camera_turned_by_two_degrees_would_be_noticed() -> None:
    scene = rendered()
    pose = turned(0.0, np.radians(2.0)) @ scene.views[1].cam_from_world
    tilted = dataclasses.replace(scene.views[1], cam_from_world=pose)
    wrong = dataclasses.replace(scene, views=(scene.views[0], tilted))
    right_share, wrong_share = (
        np.mean(np.abs(_depth_ratios(each, 0, 1) - 1) < 0.01) for each in (scene, wrong)
    )
    assert wrong_share < 0.8 * right_share


def test_the_workspace_is_read_back_as_it_was_rendered(workspace: Path) -> None:
    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    check_images(opened, scene)
    expected = rendered()
    assert len(scene.views) == len(expected.views)
    for index, known in enumerate(expected.views):
        view = scene.views[index]
        assert (view.name, view.image_id) == (known.name, known.image_id)
        assert view.camera == known.camera
        np.testing.assert_allclose(view.cam_from_world, known.cam_from_world, atol=1e-9)
        image = read_rgb(opened.image_path(view.name))
        assert np.array_equal(image, expected.images[index])
        depth = read_depth_map(opened.truth_path(view.name))
        assert np.array_equal(depth, expected.depths[index])


def test_the_sparse_points_tell_neighbours_and_depth_ranges(workspace: Path) -> None:
    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    assert scene.num_points == len(rendered().points.xyz)
    assert scene.num_shared_points is not None
    assert scene.num_shared_points[0, 1] == scene.num_points
    assert scene.depth_range is not None
    for (near, far), depth in zip(scene.depth_range, rendered().depths, strict=True):
        assert np.mean((depth > near) & (depth < far)) > 0.9


def test_each_track_meets_its_keypoints(workspace: Path) -> None:
    model = pycolmap.Reconstruction(workspace / "sparse")
    assert len(model.points3D) > 0
    for point in model.points3D.values():
        assert point.track.length() >= 2
        for element in point.track.elements:
            image = model.images[element.image_id]
            keypoint = image.points2D[element.point2D_idx]
            assert keypoint.has_point3D()
            error_px = np.linalg.norm(image.project_point(point.xyz) - keypoint.xy)
            assert error_px < 3  # of noise


def test_an_interrupted_run_goes_on_where_it_stopped(
    tmp_path: Path, renders: list[int]
) -> None:
    finished = tmp_path / "room_000007"
    finished.mkdir()
    (finished / "kept").touch()
    partial = tmp_path / ".room_000008.partial"
    partial.mkdir()
    (partial / "half_written").touch()
    config = dataclasses.replace(CONFIG, num_scenes=3, seed=7)
    paths = synthesize(tmp_path, config)
    assert renders == [8, 9]
    assert list(_files(finished)) == ["kept"]
    assert "half_written" not in _files(paths[1])
    assert sorted(tmp_path.iterdir()) == paths


def test_a_room_that_fails_is_not_taken_for_a_finished_one(
    tmp_path: Path, renders: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("the power went out")

    with monkeypatch.context() as patch:
        patch.setattr(module, "write_depth_map", fail)
        with pytest.raises(RuntimeError, match="power"):
            synthesize(tmp_path, CONFIG)
    assert not (tmp_path / "room_000000").exists()
    (path,) = synthesize(tmp_path, CONFIG)
    assert renders == [0, 0]
    assert open_workspace(path).path == path


@pytest.mark.slow
def test_two_workers_write_the_same_bytes_as_one(tmp_path: Path) -> None:
    config = dataclasses.replace(CONFIG, num_scenes=2, width_px=64, height_px=48)
    alone = synthesize(tmp_path / "alone", config)
    together = synthesize(tmp_path / "together", config, num_workers=2)
    assert [path.name for path in alone] == [path.name for path in together]
    for one, other in zip(alone, together, strict=True):
        assert _files(one) == _files(other)
