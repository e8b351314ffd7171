"""Laws of the errors of an image before and after the refinement."""

from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.refine.stage import refine_workspace
from resdepth_colmap.report.image_maps import image_errors

KINDS = dict.fromkeys(NAMES, "geometric")


def refined(tmp_path: Path) -> OutputWorkspace:
    workspace = open_workspace(plane_folder(tmp_path))
    config = RefineConfig(weights=identity_weights(tmp_path))
    return refine_workspace(workspace, config).output


def test_an_error_is_seen_before_and_after(tmp_path: Path) -> None:
    output = refined(tmp_path)
    for name in NAMES[:2]:
        truth = read_depth_map(output.source.depth_map_path(name, "geometric"))
        write_depth_map(output.source.truth_path(name), truth)
        write_depth_map(output.depth_map_path(name), truth + np.float32(0.5))
    first, second = image_errors(output, KINDS)
    assert (first.name, second.name) == NAMES[:2]
    assert first.before.mae == 0
    assert first.after.mae == pytest.approx(0.5, rel=1e-4)


def test_images_without_ground_truth_have_no_errors(tmp_path: Path) -> None:
    assert image_errors(refined(tmp_path), KINDS) == []
