"""Workspaces that only benchmarks write to, and the cost of matching.

They share images, model and truth with a workspace that stays unchanged, and are kept,
so that finished maps are not made again.
"""

import dataclasses
import json
import shutil
import time
from collections.abc import Mapping
from pathlib import Path

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.io.colmap.cfg import (
    SourceSpec,
    write_fusion_cfg,
    write_patch_match_cfg,
)
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import Workspace, open_workspace
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.pipeline.stereo.stage import stereo_workspace
from resdepth_colmap.pipeline.stereo.warm_up import warm_up
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

SHARED = ("images", "sparse", "ground_truth")
COSTS_NAME = "cpu_seconds.json"


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchedWorkspace:
    """A workspace that a benchmark matches.

    Attributes:
        path: Its folder.
        workspace: The same, opened.
        scene: Its views.
    """

    path: Path
    workspace: Workspace
    scene: Scene

    def match(
        self,
        label: str,
        sources: Mapping[str, SourceSpec],
        config: StereoConfig,
        progress: Progress | None = None,
    ) -> float | None:
        """Make the maps that do not exist yet.

        Compiling is not counted. A run that resumes an interrupted one counts the
        seconds of the images that were left.

        Args:
            label: Key of the seconds in the file that keeps them.
            sources: The images to match, and their sources.
            config: Options of the matcher.
            progress: Shows how far the matching is.

        Returns:
            Processor seconds of all threads per matched image; None if not known.

        Raises:
            WorkspaceError: If an image cannot be matched.
        """
        write_patch_match_cfg(self.workspace.stereo_path / "patch-match.cfg", sources)
        warm_up(config)
        start = time.process_time()
        report = stereo_workspace(
            self.workspace,
            self.scene,
            config,
            StereoBackend.CPU,
            progress=progress or SilentProgress(),
        )
        cpu_s = time.process_time() - start
        path = self.path / COSTS_NAME
        costs = json.loads(path.read_text("utf-8")) if path.is_file() else {}
        if report.matched:
            costs[label] = cpu_s / len(report.matched)
            write_whole(path, json.dumps(costs, indent=2).encode())
        seconds: float | None = costs.get(label)
        return seconds


def matched_workspace(original: Path, path: Path) -> MatchedWorkspace:
    """A workspace that shares all but maps with another one.

    Args:
        original: A dense workspace; nothing is written to it.
        path: Folder of the new one; made if it does not exist.

    Raises:
        WorkspaceError: If there is no workspace.
    """
    found = open_workspace(original).path
    path.mkdir(parents=True, exist_ok=True)
    for name in SHARED:
        if (found / name).exists() and not (path / name).exists():
            (path / name).symlink_to((found / name).resolve())
    (path / "stereo").mkdir(exist_ok=True)
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    write_fusion_cfg(
        workspace.stereo_path / "fusion.cfg", [view.name for view in scene.views]
    )
    return MatchedWorkspace(path=path, workspace=workspace, scene=scene)


def linked_maps(original: Path, copy: MatchedWorkspace) -> bool:
    """Link the depth maps of a workspace in a `MatchedWorkspace`.

    Args:
        original: A dense workspace; nothing is written to it.
        copy: The result of `matched_workspace`.

    Returns:
        Whether there are any.
    """
    there = (open_workspace(original).stereo_path / "depth_maps").resolve()
    maps = sorted(there.rglob("*.bin"))
    for path in maps:
        link = copy.workspace.stereo_path / "depth_maps" / path.relative_to(there)
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.exists():
            link.symlink_to(path)
    return bool(maps)


def copied_maps(source: MatchedWorkspace, path: Path) -> MatchedWorkspace:
    """Another workspace of the same images that starts with a copy of the maps."""
    if not (path / "stereo").is_dir():
        partial = path / "partial"
        shutil.rmtree(partial, ignore_errors=True)
        shutil.copytree(source.workspace.stereo_path, partial)
        partial.rename(path / "stereo")
    return matched_workspace(source.path, path)
