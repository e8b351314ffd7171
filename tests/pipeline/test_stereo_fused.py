"""Our PatchMatch as others see it: COLMAP's fusion, and the truth of rendered rooms."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycolmap
import pytest
from planes import NORMAL, OFFSET
from workspaces import plane_folder

from resdepth_colmap.config import StereoBackend, StereoConfig, SynthesisConfig
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.io.point_cloud import read_cloud
from resdepth_colmap.pipeline.stereo.stage import stereo_workspace
from resdepth_colmap.scene import Scene
from resdepth_colmap.synthetic.synthesize import synthesize


def matched(folder: Path, **options: object) -> tuple[Workspace, Scene]:
    """A workspace, matched with these options."""
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    config = StereoConfig(**options)  # type: ignore[arg-type] # passed on
    stereo_workspace(workspace, scene, config, StereoBackend.CPU)
    return workspace, scene


@pytest.mark.parametrize("kind", ["photometric", "geometric"])
def test_colmaps_fusion_finds_the_plane_in_our_maps(tmp_path: Path, kind: str) -> None:
    workspace, _ = matched(plane_folder(tmp_path, kinds=()))
    options = pycolmap.StereoFusionOptions()
    options.num_threads = 1
    path = tmp_path / "fused.ply"
    pycolmap.stereo_fusion(
        path, workspace.path, input_type=kind, options=options, output_type="PLY"
    )
    points = read_cloud(path).points
    assert len(points) > 500
    distance = np.abs(points @ NORMAL - OFFSET) / abs(OFFSET)
    assert np.median(distance) < 0.01  # COLMAP's half pixel is half of it
    assert np.mean(distance < 0.02) > 0.98


def is_right(workspace: Workspace, scene: Scene) -> list[npt.NDArray[np.bool_]]:
    """Whether the geometric depth of each pixel is within 1 % of the truth."""
    right = []
    for view in scene.views:
        depth = read_depth_map(workspace.depth_map_path(view.name, "geometric"))
        truth = read_depth_map(workspace.truth_path(view.name))
        right.append(np.abs(depth - truth) <= 0.01 * truth)
    return right


@pytest.mark.slow
def test_the_filter_keeps_what_is_right(tmp_path: Path) -> None:
    config = SynthesisConfig(num_views=4, width_px=240, height_px=180, seed=0)
    (folder,) = synthesize(tmp_path, config)
    right = is_right(*matched(folder, filter=False))
    workspace, scene = matched(folder)
    kept = [
        read_depth_map(workspace.depth_map_path(view.name, "geometric")) > 0
        for view in scene.views
    ]
    of_kept = np.concatenate([r[k] for r, k in zip(right, kept, strict=True)])
    of_dropped = np.concatenate([r[~k] for r, k in zip(right, kept, strict=True)])
    assert of_kept.size > 0.2 * (of_kept.size + of_dropped.size)
    assert of_kept.mean() > of_dropped.mean() + 0.2
    for before, after in zip(right, is_right(workspace, scene), strict=True):
        assert not (after & ~before).any()  # it drops, and changes nothing else
