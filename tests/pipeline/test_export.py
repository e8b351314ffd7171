"""Laws of exporting: each format, read by another program's reader, says the same."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.export import export_maps
from resdepth_colmap.pipeline.export_config import MapFormat
from resdepth_colmap.pipeline.refine.stage import refine_workspace


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A workspace; one of its maps has holes."""
    made = plane_folder(tmp_path)
    path = made / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin"
    depth = read_depth_map(path)
    depth[:10] = 0
    write_depth_map(path, depth)
    return made


def initial(
    folder: Path, name: str
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return read_depth_map(folder / "stereo/depth_maps" / f"{name}.geometric.bin")


def test_npy_holds_the_same_numbers(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    export_maps(open_workspace(folder), output, MapFormat.NPY, "geometric")
    for name in NAMES:
        np.testing.assert_array_equal(
            np.load(output / f"{name}.npy"), initial(folder, name)
        )


def test_pfm_is_read_by_opencv(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    export_maps(open_workspace(folder), output, MapFormat.PFM, "geometric")
    read = cv2.imread(str(output / "3.png.pfm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read, initial(folder, "3.png"))


def test_png_times_its_unit_is_the_depth(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "out"
    paths = export_maps(open_workspace(folder), output, MapFormat.PNG16, "geometric")
    assert paths[0] == output / "depth_scale.json"
    unit = json.loads(paths[0].read_text(encoding="utf-8"))["unit"]
    values = np.asarray(Image.open(output / f"{NAMES[0]}.png")).astype(np.float64)
    depth = initial(folder, NAMES[0])
    assert (values[depth == 0] == 0).all()
    np.testing.assert_allclose(values * unit, depth, atol=0.51 * unit)


def test_an_outlier_does_not_take_the_resolution_of_a_png(
    folder: Path, tmp_path: Path
) -> None:
    path = folder / "stereo/depth_maps" / f"{NAMES[1]}.geometric.bin"
    depth = read_depth_map(path)
    farthest = max(float(initial(folder, name).max()) for name in NAMES)
    depth[0, :3] = 1e5
    write_depth_map(path, depth)
    output = tmp_path / "out"
    export_maps(open_workspace(folder), output, MapFormat.PNG16, "geometric")
    scale = json.loads((output / "depth_scale.json").read_text(encoding="utf-8"))
    assert scale["unit"] < 2.1 * farthest / 65535
    num_depths = sum(np.count_nonzero(initial(folder, name)) for name in NAMES)
    assert scale["clipped"] == pytest.approx(3 / num_depths)
    values = np.asarray(Image.open(output / f"{NAMES[1]}.png")).astype(np.float64)
    assert (values[0, :3] == 65535).all()
    shown = (depth > 0) & (depth < 1e5)
    np.testing.assert_allclose(
        (values * scale["unit"])[shown], depth[shown], atol=0.51 * scale["unit"]
    )


def test_refined_maps_are_exported_once_there_are_any(
    folder: Path, tmp_path: Path
) -> None:
    workspace, output = open_workspace(folder), tmp_path / "out"
    with pytest.raises(WorkspaceError, match=r"refine .* first"):
        export_maps(workspace, output, MapFormat.NPY)
    refine_workspace(workspace, RefineConfig(weights=identity_weights(tmp_path)))
    assert len(export_maps(workspace, output, MapFormat.NPY)) == len(NAMES)
    assert np.load(output / f"{NAMES[0]}.npy").min() > 0


def test_a_kind_that_is_not_there_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"no photometric.*there are: geometric"):
        export_maps(open_workspace(folder), tmp_path, MapFormat.NPY, "photometric")
