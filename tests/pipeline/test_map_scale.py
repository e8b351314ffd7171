"""Laws of the scale of maps: what is off is refused, or put right."""

from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.refine.stage import RefineReport, refine_workspace


def scaled_folder(path: Path, factor: float, num_maps: int, num_points: int) -> Path:
    folder = plane_folder(path, num_points=num_points)
    for name in NAMES[:num_maps]:
        file = map_path(folder, name)
        write_depth_map(file, np.float32(factor) * read_depth_map(file))
    return folder


def map_path(folder: Path, name: str) -> Path:
    return folder / "stereo" / "depth_maps" / f"{name}.geometric.bin"


def refine(folder: Path, fit_scale: bool = False) -> RefineReport:
    weights = identity_weights(folder.parent)
    config = RefineConfig(
        tile_px=64, overlap_px=16, weights=weights, fit_scale=fit_scale
    )
    return refine_workspace(open_workspace(folder), config)


@pytest.mark.parametrize("num_points", [200, 0])
@pytest.mark.parametrize("factor", [0.1, 1.3, 10.0])
def test_maps_of_another_scale_are_refused_by_name_and_ratio(
    tmp_path: Path, factor: float, num_points: int
) -> None:
    folder = scaled_folder(tmp_path, factor, len(NAMES), num_points)
    with pytest.raises(WorkspaceError, match=r"scale of the model.*--fit-scale") as it:
        refine(folder)
    words = str(it.value).split("which has ")[1].split()
    assert float(words[0]) * factor == pytest.approx(1.0, rel=0.1)
    assert "of 5 maps" in str(it.value)
    refined = folder / "resdepth" / "stereo" / "depth_maps"
    assert not list(refined.rglob("*.bin"))


@pytest.mark.parametrize("num_points", [200, 0])
@pytest.mark.parametrize("factor", [1.0, 1.02])
def test_maps_of_the_right_scale_are_taken(
    tmp_path: Path, factor: float, num_points: int
) -> None:
    folder = scaled_folder(tmp_path, factor, len(NAMES), num_points)
    assert set(refine(folder).refined) == set(NAMES)


def test_only_the_maps_that_are_off_are_put_right(tmp_path: Path) -> None:
    folder = scaled_folder(tmp_path, 0.1, 2, 200)
    report = refine(folder, fit_scale=True)
    for name in NAMES:
        truth = read_depth_map(map_path(folder, name))
        factor = report.images[name]["scale"]
        assert factor == pytest.approx(10.0 if name in NAMES[:2] else 1.0, rel=0.02)
        found = read_depth_map(map_path(folder / "resdepth", name))
        np.testing.assert_allclose(found, factor * truth, rtol=1e-5)
