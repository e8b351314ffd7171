"""The CPU PatchMatch on scenes: against COLMAP's maps, and against the truth.

The stage `stereo` makes the maps with default options, in separate workspaces.
"""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from resdepth_colmap.config import FuseConfig, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.cloud.reference_cloud import read_reference_cloud
from resdepth_colmap.evaluation.datasets.workspaces import SEEN_SUFFIX, TRUTH_FOLDER
from resdepth_colmap.evaluation.metrics.depth_metrics import depth_metrics
from resdepth_colmap.io.colmap.cfg import SourceKind, SourceSpec
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.pipeline.fuse.colmap import fuse_with_colmap
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.progress import SilentProgress
from resdepth_colmap.scene import DepthMap
from scripts.benchmarks.matching.matched_workspace import (
    MatchedWorkspace,
    copied_maps,
    matched_workspace,
)
from scripts.benchmarks.matching.passes import (
    ALL,
    KINDS,
    LIMITS,
    Folders,
    Result,
    compared,
    depth_of,
    match_both,
)
from scripts.benchmarks.matching.shares import mean_of, shares_within
from scripts.benchmarks.matching.speed import measured_speed

FIRST_IMAGE, SECOND_IMAGE = "im0.png", "im1.png"

# COLMAP's defaults.
FUSION = FuseConfig(min_num_views=5, max_normal_error_deg=10.0)


def measure_plant(folders: Folders) -> Result:
    """Against COLMAP's geometric maps, with our depth range and with that of theirs."""
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
    """Six views against the exact truth: all maps, and the filtered ones."""
    return {
        name: measure_rendered_scene(folders, name)
        for name in ("rendered_rich", "rendered_weak")
    }


def measure_rendered_scene(folders: Folders, name: str) -> Result:
    """Maps of one rendered scene, their filtered versions, and the cloud of these."""
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
    truth = read_reference_cloud(workspace, filtered.scene, ())
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
    "middlebury": measure_middlebury,
    "rendered": measure_rendered,
    "plant": measure_plant,
    "speed": lambda _: measured_speed(),
}
