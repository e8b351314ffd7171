"""Stage "refine": plan, then load, refine and store view by view."""

import collections
import dataclasses
import logging
from typing import Any, NoReturn

from resdepth_colmap.config import MaskConfig, RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace, read_record, write_record
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.network.device import resolve_device
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.in_place import adopt_new_maps
from resdepth_colmap.pipeline.initial_map import check_maps_exist
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.pipeline.masks import with_masks
from resdepth_colmap.pipeline.refine.loop import RefineLoop
from resdepth_colmap.pipeline.refine.plan import Skipped, plan_refine
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)

MOST_NAMES_SHOWN = 3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """What a run refines with; loaded once.

    Attributes:
        network: Ready for use, on its device.
        weights_sha256: Tells its weights from others.
        facts: Weights, network and device, for the record.
    """

    network: ResDepthNet
    weights_sha256: str
    facts: dict[str, Any]


def load_network(config: RefineConfig) -> Network:
    """Load the weights of a configuration onto its device.

    Raises:
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine has no such device.
    """
    device = resolve_device(config.device)
    network = for_inference(load_weights(config.weights, device))
    digest = weights_hash(config.weights)
    facts = {
        "weights_sha256": digest,
        "network": network.config.to_mapping(),
        "device": str(device),
    }
    return Network(network=network, weights_sha256=digest, facts=facts)


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
    in_place: bool = False,
    overwrite: bool = False,
    masks: MaskConfig | None = None,
    progress: Progress | None = None,
) -> RefineReport:
    """Refine the depth maps of a workspace and write them where COLMAP finds them.

    Each result enters the manifest as soon as its maps are written: after an
    interruption the next call goes on. What is fresh is left alone.

    Args:
        workspace: The workspace, with depth maps.
        config: Options; None = the defaults.
        in_place: Replace the geometric maps of the workspace (originals are kept)
            instead of writing to `resdepth/`.
        overwrite: Refine again what is fresh.
        masks: Which pixels of the images are ignored; None = the defaults.
        progress: Is told of each image.

    Raises:
        WorkspaceError: If no image has a map to start from, a file is broken, or the
            result cannot be written.
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If this machine has no such device.
    """
    config = config or RefineConfig()
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    check_maps_exist(workspace, scene, config.input)
    workspace = with_masks(workspace, scene, masks or MaskConfig())
    network = load_network(config)
    output = OutputWorkspace(source=workspace, in_place=in_place)
    adopt_new_maps(output, scene)
    output.prepare([view.name for view in scene.views])
    return refine_views(
        output, scene, config, network, overwrite, progress or SilentProgress()
    )


def refine_views(
    output: OutputWorkspace,
    scene: Scene,
    config: RefineConfig,
    network: Network,
    overwrite: bool,
    progress: Progress,
) -> RefineReport:
    """As `refine_workspace`, of a workspace that is read and prepared already.

    Raises:
        WorkspaceError: As there.
    """
    workspace = output.source
    check_maps_exist(workspace, scene, config.input)
    _check_num_views(workspace, scene, network.network.config)
    manifest = Manifest(output.path)
    weights = network.network.config, network.weights_sha256
    plan = plan_refine(output, scene, config, weights, manifest)
    _say_skipped(plan.skipped)
    *_, results = plan.iterations
    if not results:
        _fail(workspace, plan.skipped)
    loop = RefineLoop(scene, config, network.network, output, manifest)
    try:
        done = loop.run(plan, overwrite, progress)
    finally:
        manifest.save()
        images = {t.name: manifest.facts(t) for t in results if manifest.is_fresh(t)}
        _record(output, images)
    output.write_cfgs([task.name for task in results])
    refined = tuple(task.name for task in done)
    return RefineReport(
        output=output,
        refined=refined,
        kept=tuple(task.name for task in results if task.name not in refined),
        skipped=plan.skipped,
        images=images,
        facts=network.facts,
    )


def _record(output: OutputWorkspace, images: dict[str, dict[str, Any]]) -> None:
    """What is known of each image goes to run.json, also after an interruption."""
    record = read_record(output.record_path)
    if record.get("images") != images:
        write_record(output.record_path, {**record, "images": images})


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


def _fail(workspace: Workspace, skipped: Skipped) -> NoReturn:
    reasons = "; ".join(f"{name}: {reason}" for name, reason in skipped[:3])
    raise WorkspaceError(f"{workspace.path}: no image could be refined: {reasons}.")
