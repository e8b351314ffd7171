"""Laws of looking at a workspace: what is there is said, broken or not."""

import json
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig, StereoBackend
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.info import Inspection, inspect_workspace
from resdepth_colmap.pipeline.refine.stage import refine_workspace


def inspect(folder: Path, config: RefineConfig | None = None) -> Inspection:
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    return inspect_workspace(workspace, scene, config)


def test_a_good_workspace_is_described_without_warnings(tmp_path: Path) -> None:
    found = inspect(plane_folder(tmp_path))
    assert (found.num_views, found.num_cameras, found.num_points) == (5, 1, 200)
    assert found.image_sizes == ((80, 60, 5),)
    assert found.maps["geometric"].num_maps == 5
    assert found.maps["geometric"].filled == 1.0
    assert found.stereo_backend is StereoBackend.EXISTING
    assert found.num_refined == 5
    assert found.estimate.stereo_s == 0
    assert found.cfg_files == ("patch-match.cfg", "fusion.cfg")
    assert found.warnings == ()


def test_holes_are_counted(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for name in NAMES:
        path = folder / "stereo/depth_maps" / f"{name}.geometric.bin"
        depth = read_depth_map(path)
        depth[:15] = 0
        write_depth_map(path, depth)
    assert inspect(folder).maps["geometric"].filled == pytest.approx(0.75)


def test_without_maps_patch_match_would_run(tmp_path: Path) -> None:
    found = inspect(plane_folder(tmp_path, kinds=()))
    assert found.stereo_backend in (StereoBackend.CPU, StereoBackend.COLMAP)
    assert found.num_refined == 5
    assert found.maps == {}


def test_what_may_surprise_is_a_warning(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, num_points=0)
    (folder / "images" / NAMES[3]).unlink()
    (folder / "stereo/depth_maps" / f"{NAMES[3]}.geometric.bin").unlink()
    (folder / "stereo/normal_maps" / f"{NAMES[4]}.geometric.bin").unlink()
    (folder / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin").write_bytes(b"80&60&1")
    text = "\n".join(inspect(folder).warnings)
    assert f"without a file: {NAMES[3]}" in text
    assert "no sparse points" in text
    assert "1 images have no depth map, or one that was made from" in text
    assert "have no normal map" in text
    assert "0.png.geometric.bin: not a COLMAP map" in text


def test_what_is_up_to_date_costs_nothing(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    options = RefineConfig(weights=identity_weights(tmp_path))
    assert inspect(folder, options).num_refined == len(NAMES)
    refine_workspace(open_workspace(folder), options)
    found = inspect(folder, options)
    assert (found.num_refined, found.num_fresh) == (0, len(NAMES))
    assert found.estimate.refine_s == 0
    path = folder / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin"
    write_depth_map(path, np.float32(1.01) * read_depth_map(path))
    found = inspect(folder, options)
    assert (found.num_refined, found.num_fresh) == (1, len(NAMES) - 1)


def test_passes_cost_in_proportion(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    one, two = (
        inspect(folder, RefineConfig(inner_iterations=n)).estimate for n in (1, 2)
    )
    assert two.refine_s == pytest.approx(2 * one.refine_s)


def test_the_mapping_is_plain_json(tmp_path: Path) -> None:
    found = inspect(plane_folder(tmp_path))
    again = json.loads(json.dumps(found.to_mapping()))
    assert again["maps"]["geometric"]["num_maps"] == 5
    assert again["stereo_backend"] == "existing"
    assert np.isfinite(again["estimate"]["memory_mb"])
