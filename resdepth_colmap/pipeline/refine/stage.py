"""Stage "refine": a loop over the views of a workspace round `refine_view`."""

import collections
import dataclasses
import logging
from typing import Any

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.network.device import resolve_device
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.initial_map import check_maps_exist
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS
from resdepth_colmap.pipeline.refine.loop import RefineLoop
from resdepth_colmap.pipeline.refine.plan import Skipped, plan_views, with_rounds
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)

MOST_NAMES_SHOWN = 3


@dataclasses.dataclass(frozen=True, kw_only=True)
class RefineReport:
    """What the stage did.

    Attributes:
        output: Where the maps are.
        refined: Names of the images refined now.
        kept: Names of the images that were finished and unchanged.
        skipped: Name and reason of each image that was not refined.
        images: What is known of each refined or kept image, by name.
        facts: Weights, network and device.
    """

    output: OutputWorkspace
    refined: tuple[str, ...]
    kept: tuple[str, ...]
    skipped: Skipped
    images: dict[str, dict[str, Any]]
    facts: dict[str, Any]


def refine_workspace(
    workspace: Workspace,
    config: RefineConfig | None = None,
    *,
    scene: Scene | None = None,
    in_place: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> RefineReport:
    """Refine the depth maps of a workspace and write them where COLMAP finds them.

    The record of each image is written as soon as its maps are: after an interruption
    the next call goes on, and it leaves alone what is finished and unchanged.

    Args:
        workspace: The workspace, with depth maps.
        config: Options; None = the defaults.
        scene: Its model, if it is read already.
        in_place: Replace the geometric maps of the workspace (originals are kept)
            instead of writing to `resdepth/`.
        overwrite: Refine again what is finished and unchanged.
        progress: Is told of each image.

    Raises:
        WorkspaceError: If no image has a map to start from, a file is broken, or the
            result cannot be written.
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine has no such device.
    """
    config, progress = config or RefineConfig(), progress or SilentProgress()
    scene = scene or read_scene(
        workspace.sparse_path, workspace.images_path, workspace.path
    )
    check_maps_exist(workspace, scene, config.input)
    device = resolve_device(config.device)
    network = for_inference(load_weights(config.weights, device))
    _check_num_views(workspace, scene, network.config)
    facts = {
        "weights_sha256": weights_hash(config.weights),
        "network": network.config.to_mapping(),
        "device": str(device),
    }
    options = {
        "inner_iterations": config.inner_iterations,
        "update_gating": config.update_gating,
        "tile_px": config.tile_px,
        "overlap_px": config.overlap_px,
        "weights": facts["weights_sha256"],
        "in_place": in_place,
    }
    num_sources = network.config.num_sources if network.config.uses_sources else 0
    num_maps = NUM_SOURCE_MAPS if network.config.source_depth else 0
    plans, skipped = plan_views(
        workspace, scene, config.input, (num_sources, num_maps), options
    )
    plans = with_rounds(plans, config.outer_iterations if num_maps else 1)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    output.prepare([view.name for view in scene.views])
    loop = RefineLoop(workspace, scene, config, network, output)
    refined, kept, empty = loop.run(plans, overwrite, progress)
    _say_skipped((*skipped, *empty))
    _check_any(workspace, refined + kept, (*skipped, *empty))
    return RefineReport(
        output=output,
        refined=tuple(refined),
        kept=tuple(kept),
        skipped=(*skipped, *empty),
        images=loop.images,
        facts=facts,
    )


def _check_num_views(workspace: Workspace, scene: Scene, config: NetworkConfig) -> None:
    if config.uses_sources and len(scene.views) < 2:
        raise WorkspaceError(
            f"{workspace.sparse_path}: the model has a single image, but refinement "
            "compares each image with a second one; add images of the same scene."
        )


def _say_skipped(skipped: Skipped) -> None:
    names_by_reason = collections.defaultdict(list)
    for name, reason in skipped:
        names_by_reason[reason].append(name)
    for reason, names in names_by_reason.items():
        shown = ", ".join(names[:MOST_NAMES_SHOWN])
        more = len(names) - MOST_NAMES_SHOWN
        logger.warning(
            "%d skipped, %s: %s%s (run.json has them all).",
            len(names),
            reason,
            shown,
            f" and {more} more" if more > 0 else "",
        )


def _check_any(workspace: Workspace, done: list[str], skipped: Skipped) -> None:
    if not done:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in skipped[:3])
        raise WorkspaceError(f"{workspace.path}: no image could be refined: {reasons}.")
