"""Laws of the stage "stereo" on bad input: sane maps or a clear line, never NaN."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from click.testing import CliRunner
from PIL import Image
from planes import NAMES
from workspaces import plane_folder

from resdepth_colmap.cli.main import main
from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.io.colmap.maps import read_planes
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.pipeline.stereo.stage import StereoReport, stereo_workspace

SIZE_PX = (48, 36)
NEAR, FAR = 2.0, 8.0
Change = Callable[[Path], None]


def paint(value: int, *names: str) -> Change:
    """Images of one grey value."""

    def change(folder: Path) -> None:
        for name in names:
            gray = np.full(SIZE_PX[::-1], value, np.uint8)
            Image.fromarray(gray).save(folder / "images" / name)

    return change


def saturate(folder: Path) -> None:
    """Most of each image is as white as can be."""
    for name in NAMES:
        path = folder / "images" / name
        values = np.asarray(Image.open(path)).astype(np.int64) + 110
        Image.fromarray(np.minimum(values, 255).astype(np.uint8)).save(path)


def pose(folder: Path, target: int, rotation_turned: bool) -> None:
    """Put an image where the first one stands, looking the same way or back."""
    model = pycolmap.Reconstruction(folder / "sparse")
    first = model.images[1].cam_from_world().matrix()
    if rotation_turned:
        first[[0, 2]] *= -1
        first[2, 3] -= 1.0
    frame = model.frame(model.images[target].frame_id)
    frame.rig_from_world = pycolmap.Rigid3d(first)
    model.write(folder / "sparse")


def same_place(folder: Path) -> None:
    pose(folder, 2, rotation_turned=False)


def behind(folder: Path) -> None:
    pose(folder, 2, rotation_turned=True)


def other_size(folder: Path) -> None:
    """One image of half the size, with a camera of its own."""
    model = pycolmap.Reconstruction(folder / "sparse")
    camera = model.cameras[1]
    small = pycolmap.Camera(
        camera_id=2,
        model="PINHOLE",
        width=camera.width // 2,
        height=camera.height // 2,
        params=camera.params / 2,
    )
    model.add_camera_with_trivial_rig(small)
    image = model.images[2]
    moved = pycolmap.Image(name=image.name, camera_id=2, image_id=9)
    cam_from_world = image.cam_from_world()
    model.deregister_frame(image.frame_id)
    model.add_image_with_trivial_frame(moved, cam_from_world)
    model.write(folder / "sparse")
    path = folder / "images" / NAMES[1]
    Image.open(path).resize((small.width, small.height)).save(path)


def match(folder: Path, **options: object) -> StereoReport:
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    check_images(workspace, scene)
    given = {"num_iterations": 2, "depth_min": NEAR, "depth_max": FAR, **options}
    config = StereoConfig(**given)  # type: ignore[arg-type] # passed on
    return stereo_workspace(workspace, scene, config, StereoBackend.CPU)


@pytest.mark.parametrize(
    ("change", "num_points"),
    [
        (other_size, 0),
        (same_place, 200),
        (behind, 200),
        (paint(128, *NAMES), 200),
        (paint(255, *NAMES), 200),
        (paint(0, NAMES[0]), 200),
        (saturate, 200),
    ],
    ids=["sizes", "same place", "behind", "grey", "white", "one black", "saturated"],
)
def test_the_maps_of_odd_images_are_whole_and_finite(
    tmp_path: Path, change: Change, num_points: int
) -> None:
    folder = plane_folder(tmp_path, kinds=(), size_px=SIZE_PX, num_points=num_points)
    cfg = f"{NAMES[0]}\n{NAMES[1]}, {NAMES[2]}\n{NAMES[1]}\n{NAMES[0]}\n"
    (folder / "stereo/patch-match.cfg").write_text(cfg, encoding="utf-8")
    change(folder)
    assert set(match(folder).matched) == set(NAMES[:2])
    for name in NAMES[:2]:
        for kind in ("photometric", "geometric"):
            # Not read_depth_map, which would make NaN to 0.
            path = folder / f"stereo/depth_maps/{name}.{kind}.bin"
            depth = read_planes(path, num_channels=1)[0]
            normals = read_planes(folder / f"stereo/normal_maps/{name}.{kind}.bin", 3)
            has_depth = depth > 0
            assert has_depth.all() or kind == "geometric"
            assert np.isfinite(depth).all()
            assert (depth[has_depth] >= NEAR * 0.999).all()
            assert (depth[has_depth] <= FAR * 1.001).all()
            length = np.linalg.norm(normals, axis=0)
            assert np.allclose(length, has_depth, atol=1e-3)


def test_nothing_agrees_with_a_source_that_shows_nothing(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=(), size_px=SIZE_PX)
    (folder / "stereo/patch-match.cfg").write_text(
        f"{NAMES[0]}\n{NAMES[1]}\n{NAMES[1]}\n{NAMES[0]}\n", encoding="utf-8"
    )
    paint(128, NAMES[1])(folder)
    match(folder)
    path = folder / f"stereo/depth_maps/{NAMES[0]}.geometric.bin"
    assert not read_planes(path, num_channels=1).any()


def one_line(folder: Path, *words: str) -> str:
    """The one line of a command that has to fail well."""
    result = CliRunner().invoke(main, ["stereo", str(folder), *words])
    assert result.exit_code == 1, result.output
    lines = [line for line in result.stderr.splitlines() if line.startswith("Error: ")]
    assert isinstance(result.exception, SystemExit)  # no traceback
    (line,) = lines
    return line


@pytest.mark.parametrize(
    ("near", "far"), [("5", "2"), ("0", "2"), ("0", "0"), ("-1", "2"), ("2", "nan")]
)
def test_an_empty_depth_range_is_one_line(tmp_path: Path, near: str, far: str) -> None:
    folder = plane_folder(tmp_path, kinds=())
    line = one_line(folder, "--depth-min", near, "--depth-max", far)
    assert f"depth_min={float(near)}, depth_max={float(far)}" in line
    assert "0 < depth_min < depth_max" in line


def test_a_cfg_that_names_nothing_of_the_model_is_one_line(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    cfg = folder / "stereo/patch-match.cfg"
    cfg.write_text("ghost.png\n__all__\n", encoding="utf-8")
    assert "ghost.png: patch-match.cfg names it, but the model does not" in one_line(
        folder
    )


def test_masks_that_do_not_fit_are_one_line(tmp_path: Path) -> None:
    folder, masks = plane_folder(tmp_path, kinds=()), tmp_path / "masks"
    assert "no such folder of masks" in one_line(folder, "--mask-path", str(masks))
    (masks / NAMES[0]).parent.mkdir(parents=True)
    Image.fromarray(np.zeros((40, 40), np.uint8)).save(masks / f"{NAMES[0]}.png")
    assert "40 x 40 pixels, but its image 80 x 60" in one_line(
        folder, "--mask-path", str(masks)
    )
