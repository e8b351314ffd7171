"""Laws of who makes the initial depth."""

import shutil
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import plane_views

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError
from resdepth_colmap.evaluation.datasets.sample import DepthSample, InitialDepth
from resdepth_colmap.evaluation.depth.colmap_pair import match_by_colmap
from resdepth_colmap.evaluation.depth.sample_matching import (
    cache_name,
    initial_depth,
    matching_backend,
)
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.io.colmap.cfg import SourceKind, read_sources
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import baseline

CONFIG = StereoConfig(num_iterations=1, window_radius=2)
DEPTH_RANGE = (2.0, 8.0)


def views() -> tuple[MatchView, ...]:
    return tuple(
        MatchView(
            gray=(it.image[..., 0] / 255).astype(np.float32),
            K=index_K(it.view.camera),
            cam_from_world=it.view.cam_from_world,
        )
        for it in plane_views()[:2]
    )


def sample(initial: InitialDepth | None = None) -> DepthSample:
    reference, source = views()
    return DepthSample(
        name="a/b.png",
        reference=reference,
        sources=(source,),
        depth_range=DEPTH_RANGE,
        truth=np.ones_like(reference.gray),
        initial=initial,
    )


class FakeColmap:
    """Stands in for COLMAP's PatchMatch: keeps the workspace, finds a depth of 3."""

    def __init__(self, kept: Path) -> None:
        self.kept = kept

    def __call__(self, path: str, options: pycolmap.PatchMatchOptions) -> None:
        self.options = options
        write_depth_map(
            Path(path) / "stereo/depth_maps/0.png.photometric.bin",
            np.full((60, 80), 3, np.float32),
        )
        shutil.copytree(path, self.kept)


@pytest.fixture
def colmap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeColmap:
    fake = FakeColmap(tmp_path / "kept")
    monkeypatch.setattr(pycolmap, "patch_match_stereo", fake)
    return fake


def test_colmap_is_given_a_workspace_of_the_pair(colmap: FakeColmap) -> None:
    depth = match_by_colmap(views(), DEPTH_RANGE, CONFIG)
    assert (depth == 3).all()
    workspace = open_workspace(colmap.kept)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    check_images(workspace, scene)
    first, second = scene.views
    expected = [it.view for it in plane_views()[:2]]
    assert np.allclose(first.cam_from_world, expected[0].cam_from_world)
    assert baseline(first, second) == pytest.approx(baseline(*expected))
    assert index_K(first.camera) == pytest.approx(index_K(expected[0].camera))
    gray = read_gray(workspace.image_path(second.name))
    assert np.abs(gray - views()[1].gray).max() < 1 / 255
    (spec,) = read_sources(workspace.stereo_path / "patch-match.cfg").items()
    assert spec[0] == "0.png" and spec[1].names == ("1.png",)
    assert spec[1].kind is SourceKind.EXPLICIT


def test_colmap_is_told_not_to_filter(colmap: FakeColmap) -> None:
    match_by_colmap(views(), DEPTH_RANGE, CONFIG)
    options = colmap.options
    assert not options.filter and not options.geom_consistency
    assert (options.depth_min, options.depth_max) == DEPTH_RANGE
    assert options.window_radius == CONFIG.window_radius
    assert options.check()


def test_who_matched_is_said(colmap: FakeColmap) -> None:
    by_colmap = initial_depth("scene", sample(), StereoBackend.COLMAP, CONFIG)
    assert by_colmap.origin == "COLMAP's PatchMatch (CUDA), unfiltered"
    assert by_colmap.cpu_s is None
    by_us = initial_depth("scene", sample(), StereoBackend.CPU, CONFIG)
    assert by_us.origin == "our PatchMatch (CPU)" and by_us.cpu_s
    there = InitialDepth(depth=by_us.depth, origin="the user's")
    assert initial_depth("s", sample(there), StereoBackend.CPU, CONFIG) is there


def test_colmap_is_chosen_where_it_has_cuda(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pycolmap, "has_cuda", True)
    assert matching_backend(StereoBackend.AUTO) is StereoBackend.COLMAP
    assert matching_backend(StereoBackend.CPU) is StereoBackend.CPU
    monkeypatch.setattr(pycolmap, "has_cuda", False)
    assert matching_backend(StereoBackend.AUTO) is StereoBackend.CPU
    with pytest.raises(BackendUnavailableError, match="--stereo cpu"):
        matching_backend(StereoBackend.COLMAP)


def test_a_failure_of_colmap_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("out of memory")

    monkeypatch.setattr(pycolmap, "patch_match_stereo", fail)
    with pytest.raises(BackendUnavailableError, match="out of memory"):
        match_by_colmap(views(), DEPTH_RANGE, CONFIG)


def test_names_in_the_cache_are_names_of_files() -> None:
    ours, theirs = (
        cache_name("a/größe", "x y.png", backend)
        for backend in (StereoBackend.CPU, StereoBackend.COLMAP)
    )
    assert ours == "a_gr_e-x_y.png-cpu"
    assert theirs != ours


def test_the_geometric_pass_is_run_unless_it_is_switched_off() -> None:
    found = {}
    for passes, geometric in ((1, False), (2, True)):
        config = StereoConfig(num_iterations=2, geom_consistency=geometric)
        found[passes] = initial_depth("scene", sample(), StereoBackend.CPU, config)
    right = {
        passes: np.mean(np.abs(it.depth / found[2].depth - 1) < 1e-6)
        for passes, it in found.items()
    }
    assert right[1] < 0.9
    assert found[2].cpu_s is not None
    assert found[2].cpu_s > 0
