from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import NAMES, plane_views, write_model, write_plane_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.scene import Scene


def _read(path: Path) -> Scene:
    return read_scene(path / "sparse", path / "images", path)


@pytest.mark.parametrize("with_rigs", [True, False])
@pytest.mark.parametrize("binary", [True, False])
def test_what_is_in_the_model_is_in_the_scene(
    tmp_path: Path, binary: bool, with_rigs: bool
) -> None:
    plane = write_plane_workspace(tmp_path, kinds=(), binary=binary)
    if not with_rigs:  # as COLMAP wrote it before 3.12
        for part in ("rigs", "frames"):
            (tmp_path / f"sparse/{part}{'.bin' if binary else '.txt'}").unlink()
    scene = _read(tmp_path)
    assert [view.name for view in scene.views] == list(NAMES)
    assert [view.image_id for view in scene.views] == [1, 2, 3, 4, 5]
    assert scene.num_points == 200
    for view, true in zip(scene.views, plane, strict=True):
        assert view.camera == true.view.camera
        np.testing.assert_allclose(
            view.cam_from_world, true.view.cam_from_world, atol=1e-9
        )


def test_the_statistics_are_those_of_the_tracks(tmp_path: Path) -> None:
    plane = write_plane_workspace(tmp_path, kinds=())
    scene = _read(tmp_path)
    assert scene.num_shared_points is not None
    assert scene.triangulation_angle_deg is not None
    assert scene.depth_range is not None
    off_diagonal = ~np.eye(5, dtype=bool)
    assert (scene.num_shared_points[off_diagonal] == 200).all()
    assert (scene.num_shared_points[~off_diagonal] == 0).all()
    angles = scene.triangulation_angle_deg
    np.testing.assert_array_equal(angles, angles.T)
    # 0.5 to 1.1 units apart at a distance of about 4
    assert (angles[off_diagonal] > 4).all()
    assert (angles[off_diagonal] < 16).all()
    near, far = scene.depth_range.T
    for index, true in enumerate(plane):
        assert near[index] < np.median(true.depth) < far[index]


def test_the_statistics_belong_to_their_views_in_any_order(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    plane = plane_views()
    # Image 5 sees no point: its row, and no other one, has to be empty.
    model = pycolmap.Reconstruction(tmp_path / "sparse")
    for point_id in list(model.points3D):
        for element in list(model.points3D[point_id].track.elements):
            if element.image_id == 2:
                model.delete_observation(element.image_id, element.point2D_idx)
    model.write_text(tmp_path / "sparse")
    for file in (tmp_path / "sparse").glob("*.bin"):
        file.unlink()
    lines = (tmp_path / "sparse/frames.txt").read_text().splitlines()
    reverse = "\n".join(reversed(lines)) + "\n"
    (tmp_path / "sparse/frames.txt").write_text(reverse)
    scene = _read(tmp_path)
    assert scene.num_shared_points is not None
    assert scene.depth_range is not None
    assert [view.name for view in scene.views] == [view.view.name for view in plane]
    sums = scene.num_shared_points.sum(axis=1)
    assert list(sums) == [600, 0, 600, 600, 600]
    np.testing.assert_array_equal(scene.depth_range[1], [0, 0])
    assert (scene.depth_range[[0, 2, 3, 4]] > 0).all()


def test_without_points_there_are_no_statistics(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=(), num_points=0)
    scene = _read(tmp_path)
    assert scene.num_points == 0
    assert scene.num_shared_points is None
    assert scene.triangulation_angle_deg is None
    assert scene.depth_range is None


def test_points_without_tracks_give_no_statistics(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=(), num_points=0, binary=False)
    (tmp_path / "sparse/points3D.txt").write_text("1 0 0 4 9 9 9 0.5\n")
    scene = _read(tmp_path)
    assert scene.num_points == 1
    assert scene.depth_range is None


def test_the_model_may_lie_in_sparse_0_and_the_images_elsewhere(tmp_path: Path) -> None:
    write_model(tmp_path / "sparse/0", plane_views(), num_points=50)
    scene = read_scene(tmp_path / "sparse/0", tmp_path / "photos", tmp_path)
    assert scene.num_points == 50
    assert scene.depth_range is not None


def test_an_image_without_a_pose_is_left_out(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=())
    model = pycolmap.Reconstruction(tmp_path / "sparse")
    model.deregister_frame(model.images[3].frame_id)
    model.write(tmp_path / "sparse")
    scene = _read(tmp_path)
    assert [view.image_id for view in scene.views] == [1, 2, 4, 5]
    assert scene.num_shared_points is not None
    assert scene.num_shared_points.shape == (4, 4)


def test_simple_pinhole_is_a_pinhole(tmp_path: Path) -> None:
    path = _text_model(tmp_path, cameras="1 SIMPLE_PINHOLE 80 60 90 40 30\n")
    camera = _read(path).views[0].camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (90, 90, 40, 30)


def _text_model(
    path: Path,
    cameras: str = "1 PINHOLE 80 60 90 90 40 30\n",
    images: str = "1 1 0 0 0 0 0 0 1 a.png\n\n",
    points: str = "",
) -> Path:
    (path / "sparse").mkdir()
    (path / "sparse/cameras.txt").write_text(cameras)
    (path / "sparse/images.txt").write_text(images)
    (path / "sparse/points3D.txt").write_text(points)
    return path


def test_names_with_blanks_in_a_text_model_are_kept_apart(tmp_path: Path) -> None:
    lines = [f"{index} 1 0 0 0 0 0 0 1 IMG {index}.png\n\n" for index in (1, 2)]
    scene = _read(_text_model(tmp_path, images="# comment\n" + "".join(lines)))
    assert [view.name for view in scene.views] == ["IMG 1.png", "IMG 2.png"]


def test_a_distorted_camera_is_refused_with_the_command(tmp_path: Path) -> None:
    path = _text_model(tmp_path, cameras="1 SIMPLE_RADIAL 80 60 90 40 30 0.1\n")
    match = r"camera 1 .*SIMPLE_RADIAL.*colmap image_undistorter --image_path .*images"
    with pytest.raises(WorkspaceError, match=match):
        _read(path)


def test_an_empty_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="empty"):
        _read(_text_model(tmp_path, images="", cameras=""))


@pytest.mark.parametrize("name", ["../../evil.png", "/etc/passwd", "a/../../b.png"])
def test_an_image_name_that_leads_out_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(WorkspaceError, match=r"sparse.*image name"):
        _read(_text_model(tmp_path, images=f"1 1 0 0 0 0 0 0 1 {name}\n\n"))


@pytest.mark.parametrize(
    "broken",
    [
        {"images": "hello world\nfoo\n"},
        {"images": "1 1 0 0 0 0 0 0 9 a.png\n\n"},  # a camera that is not there
        {"images": "1 1 0 0 0 nan 0 0 1 a.png\n\n"},
        {"images": "1 1 0 0 0 0 0 0 1 a\n\n2 1 0 0 0 0 0 0 1 a\n\n"},  # twice the same
        {"cameras": "1 NO_SUCH_MODEL 80 60 90\n"},
        {"cameras": "1 PINHOLE 80 60 0 0 40 30\n"},
        {"cameras": "1 PINHOLE 80 60 90\n"},
        {"points": "1 0 0 4 9 9 9 0.5 7 0 8 0\n"},  # seen by images that are not there
    ],
)
def test_a_broken_text_model_is_named(tmp_path: Path, broken: dict[str, str]) -> None:
    with pytest.raises(WorkspaceError, match="sparse"):
        _read(_text_model(tmp_path, **broken))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
@pytest.mark.parametrize("part", ["cameras", "images", "points3D"])
def test_a_truncated_binary_model_is_named(
    tmp_path: Path, part: str, share: float
) -> None:
    # pycolmap itself would never return from a truncated points3D.bin
    write_model(tmp_path / "sparse", plane_views(), num_points=20)
    path = tmp_path / f"sparse/{part}.bin"
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(WorkspaceError, match=rf"{part}\.bin"):
        _read(tmp_path)


def test_a_missing_file_of_the_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="no COLMAP model"):
        _read(tmp_path)
    write_model(tmp_path / "sparse", plane_views(), num_points=2)
    (tmp_path / "sparse/images.bin").unlink()
    with pytest.raises(WorkspaceError, match=r"images\.bin"):
        _read(tmp_path)


def test_reading_is_quiet(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_plane_workspace(tmp_path, kinds=())
    _read(tmp_path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "num_views", "num_points"),
    [
        ("meeting_room", 29, 1544),
        ("plant", 4, 0),
        ("walnut", 12, 0),
        ("middlebury/Pipes", 2, 684),
        ("rendered_rich", 6, 600),
    ],
)
def test_real_models_are_read(
    shared_data: Callable[[str], Path], name: str, num_views: int, num_points: int
) -> None:
    scene = _read(shared_data(name))
    assert len(scene.views) == num_views
    assert scene.num_points == num_points
    assert (scene.depth_range is None) == (num_points == 0)
    if scene.depth_range is not None:
        near, far = scene.depth_range.T
        assert (near > 0).all()
        assert (far > near).all()
