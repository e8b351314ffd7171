"""Laws of the depth ranges that small pictures show."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from fake_matcher import installed
from planes import plane_views
from workspaces import plane_folder

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.pipeline.stereo import load_view as stereo_load_view
from resdepth_colmap.pipeline.stereo import view as stereo_view
from resdepth_colmap.pipeline.stereo.depth_range_probe import probed_range
from resdepth_colmap.pipeline.stereo.stage import stereo_workspace

WIDE = (0.3, 300.0)
PLANE = plane_views()
VIEWS = [
    MatchView(
        gray=(view.image.mean(axis=2) / 255).astype(np.float32),
        K=index_K(view.view.camera),
        cam_from_world=view.view.cam_from_world,
    )
    for view in PLANE
]


def test_the_range_is_that_of_the_surface_stretched() -> None:
    near, far = probed_range(VIEWS[0], VIEWS[1:], WIDE, StereoConfig())
    depth = PLANE[0].depth
    assert depth.min() / 2 < near < np.percentile(depth, 5)
    assert np.percentile(depth, 95) < far < depth.max() * 5


def test_where_nothing_is_seen_the_range_stays_wide() -> None:
    grey = [dataclasses.replace(v, gray=np.full_like(v.gray, 0.5)) for v in VIEWS]
    assert probed_range(grey[0], grey[1:], WIDE, StereoConfig()) == WIDE


@pytest.mark.parametrize(
    ("num_points", "options", "is_probed"),
    [
        (0, {}, True),
        (200, {}, False),  # COLMAP's rule
        (0, {"depth_min": 0.3, "depth_max": 300.0}, False),  # the user's word
    ],
)
def test_only_a_guess_is_narrowed_and_but_once(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    num_points: int,
    options: dict[str, float],
    is_probed: bool,
) -> None:
    sizes: list[tuple[int, ...]] = []

    def probe(reference: MatchView, *_: object) -> tuple[float, float]:
        sizes.append(reference.gray.shape)
        return 2.0, 8.0

    monkeypatch.setattr(stereo_view, "probed_range", probe)
    monkeypatch.setattr(stereo_load_view, "PROBE_SIDE_PX", 40)
    fake = installed(monkeypatch)
    folder = plane_folder(tmp_path, kinds=(), num_points=num_points)
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    config = StereoConfig(num_iterations=1, **options)  # type: ignore[arg-type] # floats
    stereo_workspace(workspace, scene, config, StereoBackend.CPU)
    num_views = len(scene.views)
    assert sizes == ([(30, 40)] * num_views if is_probed else [])
    assert len(fake.calls) == 2 * num_views
    if is_probed:
        assert all(call.depth_range == (2.0, 8.0) for call in fake.calls)
