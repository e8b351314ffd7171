"""What a workspace holds, what `refine` would do with it, and what that would cost."""

import collections
import dataclasses
import os
from typing import Any

import numpy as np

from resdepth_colmap.config import (
    MaskConfig,
    RefineConfig,
    StereoBackend,
    StereoConfig,
)
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map, read_map_size
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace, missing_images
from resdepth_colmap.pipeline.initial_map import (
    candidate_kinds,
    check_map_size,
    map_path,
)
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.pipeline.masks import (
    find_masks,
    said_masks,
    said_unmasked,
    unmasked_images,
)
from resdepth_colmap.pipeline.refine.plan import STAGE as REFINE_STAGE
from resdepth_colmap.pipeline.refine.plan import plan_refine
from resdepth_colmap.pipeline.run_config import UNFILTERED
from resdepth_colmap.pipeline.stereo.passes import passes_of
from resdepth_colmap.pipeline.stereo.stage import choose_backend
from resdepth_colmap.pipeline.stereo.work import plan_auto
from resdepth_colmap.scene import Scene, View

MOST_MAPS_READ = 8  # of each kind, spread over the views: info is to be quick
CFG_NAMES = ("patch-match.cfg", "fusion.cfg")

# Measured on two cores with the default options; a guide, no promise.
MEASURED_CORES = 2
STEREO_S_PER_MEGAPIXEL_AND_PASS = 16.0  # six sources
REFINE_S_PER_MEGAPIXEL_AND_PASS = 1.8
REFINE_BASE_MB = 700.0  # libraries, weights, one tile in the network
REFINE_MB_PER_MEGAPIXEL = 150.0  # images, warped views and maps of one view


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapSummary:
    """The maps of one kind.

    Attributes:
        num_maps: Images that have such a depth map.
        num_normal_maps: Images that have such a normal map.
        filled: Mean share of pixels with a depth, in 0..1, over `num_read` maps.
        num_read: How many maps were read for it.
    """

    num_maps: int
    num_normal_maps: int
    filled: float
    num_read: int


@dataclasses.dataclass(frozen=True, kw_only=True)
class Estimate:
    """What a run would cost on this machine, roughly and on its CPU.

    Attributes:
        megapixels: Sum over the views that would be refined.
        stereo_s: Seconds of PatchMatch; 0 if maps are there.
        refine_s: Seconds of refinement.
        memory_mb: Peak memory in MiB, fusion not counted.
    """

    megapixels: float
    stereo_s: float
    refine_s: float
    memory_mb: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Inspection:
    """What was found; see the attributes' names.

    Attributes:
        path: The workspace.
        num_views: Images with a pose.
        num_cameras: Different cameras.
        image_sizes: Width, height in pixels and number of each size.
        num_points: Sparse points.
        maps: The maps there are, by kind.
        missing_images: Images of the model without a file.
        cfg_files: COLMAP's cfg files that are there.
        masks: Where the masks are; "" = there are none.
        num_masked: Images that have a mask.
        stereo_backend: Where initial depth would come from.
        num_matched: Images that PatchMatch would match first.
        num_refined: Images that `refine` would refine.
        num_fresh: Images whose refined maps are there and would be kept.
        estimate: Time and memory to expect.
        warnings: What may surprise.
    """

    path: str
    num_views: int
    num_cameras: int
    image_sizes: tuple[tuple[int, int, int], ...]
    num_points: int
    maps: dict[str, MapSummary]
    missing_images: tuple[str, ...]
    cfg_files: tuple[str, ...]
    masks: str
    num_masked: int
    stereo_backend: StereoBackend
    num_matched: int
    num_refined: int
    num_fresh: int
    estimate: Estimate
    warnings: tuple[str, ...]

    def to_mapping(self) -> dict[str, Any]:
        """Plain values only, ready for JSON."""
        return {**dataclasses.asdict(self), "stereo_backend": str(self.stereo_backend)}


def inspect_workspace(
    workspace: Workspace,
    scene: Scene,
    refine: RefineConfig | None = None,
    stereo: StereoConfig | None = None,
    masks: MaskConfig | None = None,
) -> Inspection:
    """Look at a workspace; nothing is changed, and a broken map is but a warning.

    Args:
        workspace: Where its files lie.
        scene: Its model.
        refine: Options of the run to foresee; None = the defaults.
        stereo: Options of its PatchMatch; None = the defaults.
        masks: Which pixels it would ignore; None = the defaults.
    """
    refine, stereo = refine or RefineConfig(), stereo or UNFILTERED
    found_masks = find_masks(workspace, masks or MaskConfig())
    unmasked, wrong_masks = _unmasked(found_masks, scene)
    if not wrong_masks:
        workspace = dataclasses.replace(workspace, masks=found_masks)
    maps, broken = _summaries(workspace, scene)
    backend = choose_backend(StereoBackend.AUTO, workspace, scene)
    missing = missing_images(workspace, scene)
    matched = _matched_views(workspace, scene, backend)
    fresh = () if matched or broken else _fresh_names(workspace, scene, refine)
    usable = _usable_views(workspace, scene, matched, refine.input)
    refined = [view for view in usable if view.name not in fresh]
    sizes = collections.Counter(
        (view.camera.width_px, view.camera.height_px) for view in scene.views
    )
    found = Inspection(
        path=str(workspace.path),
        num_views=len(scene.views),
        num_cameras=len({view.camera for view in scene.views}),
        image_sizes=tuple((*size, number) for size, number in sorted(sizes.items())),
        num_points=scene.num_points,
        maps=maps,
        missing_images=missing,
        cfg_files=tuple(n for n in CFG_NAMES if (workspace.stereo_path / n).is_file()),
        masks=said_masks(found_masks),
        num_masked=len(scene.views) - len(unmasked) if found_masks.are_used else 0,
        stereo_backend=backend,
        num_matched=len(matched),
        num_refined=len(refined),
        num_fresh=len(fresh),
        estimate=_estimate(workspace, (matched, refined), backend, refine, stereo),
        warnings=broken,
    )
    notes = wrong_masks or ([said_unmasked(unmasked)] if unmasked else [])
    return dataclasses.replace(found, warnings=(*broken, *notes, *_warnings(found)))


def _unmasked(masks: Masks, scene: Scene) -> tuple[tuple[str, ...], list[str]]:
    """Images without a mask, and what is wrong with the masks."""
    try:
        return unmasked_images(masks, scene), []
    except WorkspaceError as error:
        return tuple(view.name for view in scene.views), [str(error)]


def _matched_views(
    workspace: Workspace, scene: Scene, backend: StereoBackend
) -> list[View]:
    """The views that PatchMatch would match."""
    if backend is StereoBackend.EXISTING:
        return []
    if backend is StereoBackend.COLMAP:
        return list(scene.views)
    pending = plan_auto(workspace, scene, UNFILTERED).pending
    indices = sorted({task.plan.index for task in pending})
    return [scene.views[index] for index in indices]


def _usable_views(
    workspace: Workspace, scene: Scene, matched: list[View], requested: str
) -> list[View]:
    """The views that would have a map to start from."""
    names = {view.name for view in matched}
    return [
        view
        for view in scene.views
        if view.name in names or candidate_kinds(workspace, view.name, requested)
    ]


def _fresh_names(
    workspace: Workspace, scene: Scene, config: RefineConfig
) -> tuple[str, ...]:
    """The images whose refined maps would be kept, by the plan of the stage itself."""
    output = OutputWorkspace(source=workspace)
    manifest = Manifest(output.path)
    if not manifest.has_any(REFINE_STAGE):
        return ()
    from resdepth_colmap.network.weights import read_config, weights_hash  # torch

    network = read_config(config.weights), weights_hash(config.weights)
    plan = plan_refine(output, scene, config, network, manifest)
    *_, results = plan.iterations
    return tuple(task.name for task in results if manifest.is_fresh(task))


def _summaries(
    workspace: Workspace, scene: Scene
) -> tuple[dict[str, MapSummary], tuple[str, ...]]:
    views_of: dict[str, list[View]] = collections.defaultdict(list)
    for view in scene.views:
        for kind in workspace.original_kinds(view.name):
            views_of[kind].append(view)
    summaries: dict[str, MapSummary] = {}
    broken: list[str] = []
    for kind, views in sorted(views_of.items()):
        shares, errors = _filled_shares(workspace, kind, views)
        broken += errors
        normals = (workspace.normal_map_path(view.name, kind) for view in views)
        summaries[kind] = MapSummary(
            num_maps=len(views),
            num_normal_maps=sum(path.is_file() for path in normals),
            filled=float(np.mean(shares)) if shares else 0.0,
            num_read=len(shares),
        )
    return summaries, tuple(broken)


def _filled_shares(
    workspace: Workspace, kind: str, views: list[View]
) -> tuple[list[float], list[str]]:
    step = max(1, -(-len(views) // MOST_MAPS_READ))
    shares, errors = [], []
    for view in views[::step]:
        path = map_path(workspace, view.name, kind)
        try:
            check_map_size(path, view.camera)
            depth = read_depth_map(path)
            shares.append(float(np.count_nonzero(depth) / depth.size))
        except WorkspaceError as error:
            errors.append(str(error))
    return shares, errors


def _estimate(
    workspace: Workspace,
    views: tuple[list[View], list[View]],
    backend: StereoBackend,
    refine: RefineConfig,
    stereo: StereoConfig,
) -> Estimate:
    to_match, to_refine = (
        [_megapixels(workspace, view, stereo.max_image_size) for view in some]
        for some in views
    )
    total, largest = sum(to_refine), max(to_refine, default=0.0)
    slowness = MEASURED_CORES / max(1, os.cpu_count() or 1)
    matched = backend is StereoBackend.CPU
    pass_s = STEREO_S_PER_MEGAPIXEL_AND_PASS * sum(to_match) * slowness
    stereo_s = pass_s * len(passes_of(stereo)) if matched else 0.0
    num_passes = refine.inner_iterations * refine.outer_iterations
    return Estimate(
        megapixels=total,
        stereo_s=stereo_s,
        refine_s=REFINE_S_PER_MEGAPIXEL_AND_PASS * num_passes * total * slowness,
        memory_mb=REFINE_BASE_MB + REFINE_MB_PER_MEGAPIXEL * largest,
    )


def _megapixels(workspace: Workspace, view: View, max_image_size: int) -> float:
    """Size of the map that is there, else of the one that PatchMatch would make."""
    for kind in workspace.original_kinds(view.name):
        try:
            width_px, height_px = read_map_size(map_path(workspace, view.name, kind))
        except WorkspaceError:
            continue
        return width_px * height_px / 1e6
    width_px, height_px = view.camera.width_px, view.camera.height_px
    scale = 1.0
    if max_image_size > 0:
        scale = min(1.0, max_image_size / max(width_px, height_px))
    return width_px * height_px * scale**2 / 1e6


def _warnings(found: Inspection) -> list[str]:
    warnings = []
    if found.missing_images:
        shown = ", ".join(found.missing_images[:3])
        warnings.append(
            f"{len(found.missing_images)} images of the model have no file ({shown}...)"
            if len(found.missing_images) > 3
            else f"images of the model without a file: {shown}"
        )
    if found.num_views < 2:
        warnings.append("one image only: no second view to compare with")
    if found.num_points == 0:
        warnings.append(
            "no sparse points: views are paired and depth ranges are guessed by pose, "
            "and COLMAP's own fusion gives no point (--fuser open3d does)"
        )
    if found.maps and found.num_matched:
        warnings.append(
            f"{found.num_matched} images have no depth map, or one that was made from "
            "other poses, images or sources: PatchMatch would make them"
        )
    without = found.num_views - found.num_refined - found.num_fresh
    if found.maps and without > 0:
        warnings.append(f"{without} images have no depth map and would be skipped")
    for kind, summary in found.maps.items():
        if summary.num_normal_maps < summary.num_maps:
            without = summary.num_maps - summary.num_normal_maps
            warnings.append(
                f"{without} {kind} maps have no normal map: COLMAP's fusion of the "
                "originals would fail (refined maps get their own)"
            )
    return warnings
