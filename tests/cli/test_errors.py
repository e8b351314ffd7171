"""Each mistake of a user: one line that names the file and the way out, exit code 1."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from click.testing import CliRunner
from planes import NAMES
from safetensors.numpy import save_file
from workspaces import identity_weights, plane_folder

from resdepth_colmap.cli.main import main

MAP = f"stereo/depth_maps/{NAMES[0]}.geometric.bin"


def error_line(*arguments: object) -> str:
    """Run a command that has to fail well; its one line."""
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == 1, result.output
    assert isinstance(result.exception, SystemExit)  # no traceback
    (line,) = [line for line in result.stderr.splitlines() if line.strip()]
    assert line.startswith("Error: ")
    return line


def refine_error(folder: Path, *arguments: object) -> str:
    if "--weights" not in arguments:
        arguments = (*arguments, "--weights", identity_weights(folder.parent))
    return error_line("refine", folder, *arguments)


def break_nothing_there(folder: Path) -> None:
    shutil.rmtree(folder)


def break_not_a_workspace(folder: Path) -> None:
    shutil.rmtree(folder / "sparse")


def break_empty_model(folder: Path) -> None:
    pycolmap.Reconstruction().write(folder / "sparse")


def break_missing_image(folder: Path) -> None:
    (folder / "images" / NAMES[1]).unlink()


def break_truncated_map(folder: Path) -> None:
    content = (folder / MAP).read_bytes()
    (folder / MAP).write_bytes(content[: len(content) // 2])


def break_lying_header(folder: Path) -> None:
    content = (folder / MAP).read_bytes().partition(b"&1&")[2]
    (folder / MAP).write_bytes(b"79&60&1&" + content)


def break_nan_map(folder: Path) -> None:
    values = np.full((60, 80), np.nan, "<f4").tobytes()
    (folder / MAP).write_bytes(b"80&60&1&" + values)


def break_evil_name(folder: Path) -> None:
    model = pycolmap.Reconstruction(folder / "sparse")
    model.images[1].name = "../../evil.png"
    model.write(folder / "sparse")


def break_distorted_camera(folder: Path) -> None:
    model = pycolmap.Reconstruction(folder / "sparse")
    camera = model.cameras[1]
    fx, _, cx, cy = camera.params
    camera.model = pycolmap.CameraModelId.SIMPLE_RADIAL
    camera.params = [fx, cx, cy, 0.1]
    model.write(folder / "sparse")


def break_single_image(folder: Path) -> None:
    model = pycolmap.Reconstruction(folder / "sparse")
    for index in sorted(model.reg_image_ids())[1:]:
        model.deregister_frame(model.images[index].frame_id)
    model.write(folder / "sparse")


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (break_nothing_there, ("scene: no such folder", "point at the folder")),
        (break_not_a_workspace, ("no model in sparse/", "point at the folder")),
        (break_empty_model, ("the model is empty",)),
        (break_missing_image, ("1 of 5 images", NAMES[1], "copy them")),
        (break_truncated_map, ("0.png.geometric.bin", "truncated")),
        (break_lying_header, ("0.png.geometric.bin", "header says 79 x 60")),
        (break_nan_map, ("0.png.geometric.bin", "NaN", "delete the file")),
        (break_evil_name, ("'../../evil.png'", "leads out")),
        (break_distorted_camera, ("SIMPLE_RADIAL", "colmap image_undistorter")),
        (break_single_image, ("a single image", "add images")),
    ],
)
def test_a_broken_workspace_is_one_line(
    tmp_path: Path, break_it: Callable[[Path], None], words: tuple[str, ...]
) -> None:
    folder = plane_folder(tmp_path)
    break_it(folder)
    line = refine_error(folder)
    for word in words:
        assert word in line
    assert not list(tmp_path.parent.rglob("evil*"))


def test_corrupt_weights_are_one_line(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    path = tmp_path / "corrupt.safetensors"
    path.write_bytes(identity_weights(tmp_path).read_bytes()[:-100])
    line = refine_error(folder, "--weights", path)
    assert "corrupt.safetensors" in line
    assert "--weights" in line
    assert not list((folder / "resdepth").rglob("*.geometric.bin"))


def test_foreign_weights_are_one_line(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    path = tmp_path / "foreign.safetensors"
    save_file({"weight": np.zeros(3, np.float32)}, path)
    assert "foreign.safetensors: not weights of" in refine_error(
        folder, "--weights", path
    )
    assert "no such weights file" in refine_error(
        folder, "--weights", tmp_path / "none.safetensors"
    )


def test_a_device_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    line = refine_error(folder, "--device", "mps")
    assert "no device 'mps'" in line
    assert "available: " in line


def test_an_unknown_device_is_wrong_usage(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["refine", str(tmp_path), "--device", "abacus"])
    assert result.exit_code == 2
    assert "'auto', 'cpu', 'cuda', 'mps'" in result.stderr


def test_no_permission_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path)
    mkdir = Path.mkdir

    def refuse(path: Path, *arguments: object, **options: object) -> None:
        if "resdepth" in path.parts:
            raise PermissionError(13, os.strerror(13), str(path))
        mkdir(path, *arguments, **options)  # type: ignore[arg-type] # passed on

    weights = identity_weights(tmp_path)
    monkeypatch.setattr(Path, "mkdir", refuse)  # root may write everywhere
    line = refine_error(folder, "--weights", weights)
    assert str(folder / "resdepth") in line
    assert "Permission denied" in line


def test_a_full_disk_is_one_line_and_leaves_no_half_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path)

    def fail(_: int) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(os, "fsync", fail)
    line = refine_error(folder, "--weights", weights)
    assert "No space left on device" in line
    assert not list(folder.rglob(".partial-*"))


def test_an_empty_fusion_is_one_line_and_the_maps_stay(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    line = refine_error(
        folder, "--no-pictures", "--max-depth-error", 1e-9, "--max-reproj-error", 1e-9
    )
    assert "no point survived" in line
    assert (folder / "resdepth" / MAP).is_file()
    record = json.loads((folder / "resdepth/run.json").read_text(encoding="utf-8"))
    assert "no point survived" in record["fuse"]["error"]
    assert len(record["images"]) == len(NAMES)


def test_a_missing_kind_is_one_line(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    line = refine_error(folder, "--input", "photometric")
    assert "there are: geometric" in line


def test_colmap_without_cuda_is_one_line(tmp_path: Path) -> None:
    if pycolmap.has_cuda:
        pytest.skip("this pycolmap has CUDA")
    line = error_line("stereo", plane_folder(tmp_path, kinds=()), "--stereo", "colmap")
    assert "--stereo cpu" in line
