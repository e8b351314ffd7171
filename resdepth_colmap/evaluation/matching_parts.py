"""The CPU PatchMatch on scenes: against COLMAP's maps, and against the truth.

Maps are made by the stage `stereo`, with default options, in workspaces of their own.
"""

import dataclasses
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import FuseConfig, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.depth_metrics import depth_metrics
from resdepth_colmap.evaluation.map_agreement import (
    ViewMap,
    mean_of,
    num_confirming,
    shares_within,
)
from resdepth_colmap.evaluation.matched_workspace import (
    MatchedWorkspace,
    copied_maps,
    matched_workspace,
)
from resdepth_colmap.evaluation.matching_speed import measured_speed
from resdepth_colmap.evaluation.true_cloud import read_depth_truth
from resdepth_colmap.evaluation.workspace_cases import SEEN_SUFFIX, TRUTH_FOLDER
from resdepth_colmap.io.depth_map import read_depth_map
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.io.patch_match_cfg import SourceKind, SourceSpec
from resdepth_colmap.io.workspace import Workspace, open_workspace
from resdepth_colmap.pipeline.fuse_colmap import fuse_with_colmap
from resdepth_colmap.pipeline.fuse_view import MapFiles
from resdepth_colmap.pipeline.progress import SilentProgress
from resdepth_colmap.scene import DepthMap

logger = logging.getLogger(__name__)

KINDS = ("photometric", "geometric")
FIRST = StereoConfig(geom_consistency=False, filter=False)
BOTH = StereoConfig(filter=False)
AUTO = SourceSpec(kind=SourceKind.AUTO, num_auto=20)
ALL = SourceSpec(kind=SourceKind.ALL)
LIMITS = (0.01, 0.02, 0.05)
CONFIRMED_WITHIN = 0.01
FIRST_IMAGE, SECOND_IMAGE = "im0.png", "im1.png"

# COLMAP's defaults.
FUSION = FuseConfig(min_num_views=5, max_normal_error_deg=10.0)

Result = dict[str, Any]
Specs = Mapping[str, SourceSpec]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Folders:
    """Where scenes are read from, and where maps are kept."""

    data: Path
    cache: Path


def match_both(
    matched: MatchedWorkspace,
    sources: Specs,
    second: Specs | None = None,
    ranged: Mapping[str, Any] | None = None,
) -> Result:
    """Unfiltered maps of both passes; processor seconds a map of each.

    Args:
        matched: Where they go.
        sources: The images of the first pass, and their sources.
        second: Those of the second one, if they are fewer.
        ranged: Options for the depth range.
    """
    seconds = {}
    for kind, config, specs in (
        ("photometric", FIRST, sources),
        ("geometric", BOTH, second or sources),
    ):
        config = dataclasses.replace(config, **(ranged or {}))
        seconds[kind] = rounded(matched.match(kind, specs, config))
        logger.info("%s: %s %s s a map.", matched.path.name, kind, seconds[kind])
    return seconds


def rounded(value: Any) -> Any:
    """The same with six digits behind the point, in all its parts."""
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    return round(value, 6) if isinstance(value, float) else value


def depth_of(workspace: Workspace, name: str, kind: str) -> DepthMap:
    """A depth map."""
    return read_depth_map(workspace.depth_map_path(name, kind))


def measure_meeting_room(folders: Folders) -> Result:
    """Where a neighbour's map confirms COLMAP's: how often ours says the same."""
    colmap = open_workspace(folders.data / "meeting_room")
    matched = matched_workspace(colmap.path, folders.cache / "meeting_room")
    views = [v for v in matched.scene.views if colmap.map_kinds(v.name)]
    seconds = match_both(matched, {view.name: AUTO for view in views})
    theirs = {
        view.name: ViewMap(view=view, depth=depth_of(colmap, view.name, KINDS[0]))
        for view in views
    }
    maps: Result = {}
    for name, oracle in theirs.items():
        others = [other for other in theirs.values() if other is not oracle]
        counts = num_confirming(oracle, others, CONFIRMED_WITHIN)
        maps[name] = {
            "pixels": float((counts > 0).mean()),
            "chance": _confirmed_by_chance(oracle, others),
        }
        # A view of whose sources none was matched has no geometric map.
        for kind in matched.workspace.map_kinds(name):
            depth = depth_of(matched.workspace, name, kind)
            maps[name][kind] = shares_within(depth, oracle.depth, counts > 0, LIMITS)
            maps[name][f"{kind}_twice"] = shares_within(
                depth, oracle.depth, counts > 1, LIMITS
            )
    result = compared(maps, seconds)
    confirmed = sum(entry["pixels"] for entry in maps.values())
    result["chance"] = sum(entry["chance"] for entry in maps.values()) / confirmed
    result["mean_twice"] = {kind: _mean(maps, f"{kind}_twice") for kind in KINDS}
    return result


def _confirmed_by_chance(oracle: ViewMap, others: list[ViewMap]) -> float:
    """Share of the pixels that others confirm when all depths are wrong by 5 %."""
    counts = [
        num_confirming(
            ViewMap(view=oracle.view, depth=oracle.depth * np.float32(factor)),
            *(others, CONFIRMED_WITHIN),
        )
        for factor in (0.95, 1.05)
    ]
    return float((np.stack(counts) > 0).mean())


def _mean(maps: Result, key: str) -> Result:
    """Over the maps of which this was measured."""
    return mean_of([entry[key] for entry in maps.values() if key in entry])


def compared(maps: Result, seconds: Result) -> Result:
    """Of each map what was measured, and the means."""
    means = {
        kind: _mean(maps, kind)
        for kind in KINDS
        if any(kind in entry for entry in maps.values())
    }
    return {"maps": maps, "mean": means, "cpu_s_per_map": seconds}


def measure_plant(folders: Folders) -> Result:
    """Against COLMAP's geometric maps, between our depths and between theirs."""
    colmap = open_workspace(folders.data / "plant")
    result = {}
    for label in ("own_range", "range_of_maps"):
        matched = matched_workspace(colmap.path, folders.cache / f"plant_{label}")
        names = [view.name for view in matched.scene.views]
        theirs = {name: depth_of(colmap, name, KINDS[1]) for name in names}
        ranged = stretched_range(theirs) if label == "range_of_maps" else {}
        seconds = match_both(matched, dict.fromkeys(names, ALL), ranged=ranged)
        maps: Result = {}
        for name, oracle in theirs.items():
            maps[name] = {"pixels": float((oracle > 0).mean())}
            for kind in KINDS:
                depth = depth_of(matched.workspace, name, kind)
                maps[name][kind] = shares_within(depth, oracle, oracle > 0, LIMITS)
        result[label] = {**compared(maps, seconds), "options": ranged}
    return result


def stretched_range(maps: Mapping[str, DepthMap]) -> dict[str, float]:
    """COLMAP's rule for sparse points, applied to the pixels of maps."""
    depths = np.concatenate([depth[depth > 0] for depth in maps.values()])
    near, far = np.percentile(depths, (1, 99))
    return {"depth_min": float(near * 0.75), "depth_max": float(far * 1.25)}


def measure_middlebury(folders: Folders) -> Result:
    """Two views against the truth, where both see the surface."""
    maps: Result = {}
    seconds: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for path in sorted((folders.data / "middlebury").iterdir()):
        if not path.is_dir():
            continue
        matched = matched_workspace(path, folders.cache / f"middlebury_{path.name}")
        first, second = (
            SourceSpec(kind=SourceKind.EXPLICIT, names=(name,))
            for name in (SECOND_IMAGE, FIRST_IMAGE)
        )
        pair = {FIRST_IMAGE: first, SECOND_IMAGE: second}
        costs = match_both(matched, pair, {FIRST_IMAGE: first})
        truth = read_depth_map(matched.workspace.truth_path(FIRST_IMAGE))
        seen_path = path / TRUTH_FOLDER / f"{FIRST_IMAGE}{SEEN_SUFFIX}"
        where = (read_gray(seen_path) == 1) & (truth > 0)
        maps[path.name] = {"pixels": float(where.mean())}
        for kind in KINDS:
            depth = depth_of(matched.workspace, FIRST_IMAGE, kind)
            errors = depth_metrics(depth, truth, where, max_residual=None)
            maps[path.name][kind] = {
                **shares_within(depth, truth, where, LIMITS),
                "mae": errors.mae,
            }
            if costs[kind] is not None:
                seconds[kind].append(costs[kind])
    means = {kind: float(np.mean(s)) if s else None for kind, s in seconds.items()}
    return compared(maps, means)


def measure_rendered(folders: Folders) -> Result:
    """Six views against the exact truth: all maps, and what the filter leaves."""
    return {
        name: measure_rendered_scene(folders, name)
        for name in ("rendered_rich", "rendered_weak")
    }


def measure_rendered_scene(folders: Folders, name: str) -> Result:
    """One of the scenes."""
    matched = matched_workspace(folders.data / name, folders.cache / name)
    sources = {view.name: ALL for view in matched.scene.views}
    seconds = match_both(matched, sources)
    truths = {n: read_depth_map(matched.workspace.truth_path(n)) for n in sources}
    maps: Result = {
        n: {
            kind: shares_within(
                depth_of(matched.workspace, n, kind), truth, truth > 0, LIMITS
            )
            for kind in KINDS
        }
        for n, truth in truths.items()
    }
    filtered = copied_maps(matched, folders.cache / f"{name}_filtered")
    filtered.match("filtered", sources, StereoConfig())
    for n, truth in truths.items():
        depth = depth_of(filtered.workspace, n, KINDS[1])
        kept = (depth > 0) & (truth > 0)
        maps[n]["filtered"] = {
            "accuracy": shares_within(depth, truth, kept, (0.01,))["0.01"],
            "completeness": shares_within(depth, truth, truth > 0, (0.01,))["0.01"],
            "kept": float(kept.sum() / (truth > 0).sum()),
        }
    result = compared(maps, seconds)
    result["mean"]["filtered"] = mean_of([m["filtered"] for m in maps.values()])
    return {**result, "cloud": fused_scores(filtered)}


def fused_scores(filtered: MatchedWorkspace) -> Result:
    """COLMAP's fusion of the filtered maps against the cloud of the true ones."""
    workspace = filtered.workspace
    files = [
        MapFiles(
            view=view,
            image_path=workspace.image_path(view.name),
            depth_path=workspace.depth_map_path(view.name, KINDS[1]),
            normal_path=workspace.normal_map_path(view.name, KINDS[1]),
            confidence_path=None,
        )
        for view in filtered.scene.views
    ]
    truth = read_depth_truth(workspace, filtered.scene, ())
    if truth is None:
        raise WorkspaceError(f"{workspace.path}: no {TRUTH_FOLDER}/ in it.")
    result: Result = {"true_points": len(truth.points)}
    for min_num_pixels in (FUSION.min_num_views, 3):
        config = dataclasses.replace(FUSION, min_num_views=min_num_pixels)
        fused = fuse_with_colmap(workspace, filtered.scene, files, config)
        scores = truth.score(fused.cloud.points, SilentProgress())
        result[f"min_num_pixels={min_num_pixels}"] = {
            "points": len(fused.cloud),
            "tolerance": scores.tolerances[0],
            "accuracy": scores.accuracy[0],
            "completeness": scores.completeness[0],
            "f1": scores.f1[0],
        }
    return result


PARTS: dict[str, Callable[[Folders], Result]] = {
    "meeting_room": measure_meeting_room,
    "middlebury": measure_middlebury,
    "rendered": measure_rendered,
    "plant": measure_plant,
    "speed": lambda _: measured_speed(),
}
