"""Strips of scenes to look at: the photo, both depth maps, what changed, what is wrong.

What a user would see of `resdepth-colmap refine`; nothing is written to the scenes.
"""

import shutil
from pathlib import Path

import numpy as np

from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.sample import SampleOptions
from resdepth_colmap.evaluation.datasets.workspaces import (
    TRUTH_FOLDER,
    read_workspace_samples,
)
from resdepth_colmap.evaluation.depth.match_cache import MatchCache
from resdepth_colmap.evaluation.depth.sample_matching import initial_depth
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.pipeline.pictures import FOLDER, draw_workspace
from resdepth_colmap.pipeline.refine.stage import refine_workspace
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap, Scene
from scripts.benchmarks.matching.matched_workspace import (
    MatchedWorkspace,
    linked_maps,
    matched_workspace,
)

CONFIG_NAME = "patch-match.cfg"
MATCHED, SOURCE = "geometric", "photometric"
"""Kinds of the map of a matched view, and of that of the view it was matched with."""


def scenes_at(path: Path) -> list[Path]:
    """The workspaces at a path: itself, or those in it.

    Raises:
        WorkspaceError: If there is none.
    """
    if (path / "sparse").is_dir() or not path.is_dir():
        return [open_workspace(path).path]
    found = [child for child in sorted(path.iterdir()) if (child / "sparse").is_dir()]
    if not found:
        raise WorkspaceError(
            f"{path}: no workspace in it (a folder with images/ and sparse/)."
        )
    return found


def scene_strips(
    scene: Path,
    output: Path,
    cache: MatchCache,
    config: RefineConfig,
    progress: Progress | None = None,
) -> list[Path]:
    """Refine a copy of a workspace, and draw a strip of each of its images.

    The maps that are there are refined; a workspace without any is matched where it has
    a true depth, as `evaluate depth` does, with the same cache.

    Args:
        scene: A dense workspace, with depth maps or with `ground_truth/`.
        output: Gets `<scene>-<image>.png`, of images with truth if any has one; the
            copy stays in `workspaces/` there, so that only what has changed is refined
            the next time.
        cache: Where matched depth is kept.
        config: Weights, passes and device.
        progress: Is told of each image.

    Returns:
        The strips, in the order of the images.

    Raises:
        WorkspaceError: If the workspace is broken, or has neither maps nor truth.
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine has no such device.
    """
    progress = progress or SilentProgress()
    copy = matched_workspace(scene, output / "workspaces" / scene.name)
    _copy_config(scene, copy)
    if not linked_maps(scene, copy) and not _has_maps(copy):
        _match(scene, copy, cache)
    report = refine_workspace(copy.workspace, config, progress=progress)
    draw_workspace(report.output, copy.scene, report, progress)
    with_truth = [
        name for name in report.images if copy.workspace.truth_path(name).is_file()
    ]
    return [
        _copy_strip(report.output.path / FOLDER / f"{name}.png", output, scene, name)
        for name in with_truth or report.images
    ]


def _copy_config(scene: Path, copy: MatchedWorkspace) -> None:
    path = open_workspace(scene).stereo_path / CONFIG_NAME
    if path.is_file():
        shutil.copyfile(path, copy.workspace.stereo_path / CONFIG_NAME)


def _has_maps(copy: MatchedWorkspace) -> bool:
    return any((copy.workspace.stereo_path / "depth_maps").rglob("*.bin"))


def _match(scene: Path, copy: MatchedWorkspace, cache: MatchCache) -> None:
    """Match the views whose truth is known; keep what their sources' maps are, too."""
    if not (scene / TRUTH_FOLDER).is_dir():
        raise WorkspaceError(
            f"{scene}: neither depth maps nor {TRUTH_FOLDER}/; make maps with "
            "`resdepth-colmap stereo --no-filter`."
        )
    stereo = StereoConfig()
    options = SampleOptions(stereo=stereo, num_sources=1)
    for read_sample in read_workspace_samples(scene, options):
        sample = read_sample()
        found = initial_depth(scene.name, sample, StereoBackend.CPU, stereo, cache)
        _write(copy, sample.name, MATCHED, found.depth)
        for source, depth in zip(sample.sources, found.source_depths, strict=False):
            if depth is not None:
                _write(copy, _name_of(source, copy.scene), SOURCE, depth)


def _write(copy: MatchedWorkspace, name: str, kind: str, depth: DepthMap) -> None:
    write_depth_map(copy.workspace.depth_map_path(name, kind), depth)


def _name_of(view: MatchView, scene: Scene) -> str:
    """The image that a view was made of: no two have the same pose."""
    distances = [
        float(np.abs(other.cam_from_world - view.cam_from_world).max())
        for other in scene.views
    ]
    return scene.views[int(np.argmin(distances))].name


def _copy_strip(strip: Path, output: Path, scene: Path, name: str) -> Path:
    path = output / f"{scene.name}-{name.replace('/', '-')}"
    path = path.with_name(f"{path.name}.png")
    shutil.copyfile(strip, path)
    return path
