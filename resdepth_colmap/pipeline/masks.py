"""Which masks a command uses: those asked for, of the run before, or beside the images.

The folder of a run stands in its record, and so does that of `stereo` in the manifest
of its maps: what was masked once stays so in the commands that follow.
"""

import dataclasses
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from resdepth_colmap.config import MaskConfig
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.masks import (
    FOLDER_NAME,
    Masks,
    check_masks,
    find_mask_folder,
)
from resdepth_colmap.io.colmap.output import (
    BACKDROP_FOLDER,
    OutputWorkspace,
    read_record,
)
from resdepth_colmap.io.colmap.workspace import OUTPUT_FOLDER, Workspace
from resdepth_colmap.pipeline.manifest import Manifest
from resdepth_colmap.scene import DepthMap, Scene, Wanted

logger = logging.getLogger(__name__)

MOST_NAMES_SHOWN = 3
_STEREO = "stereo"  # the stage, whose results lie in a folder of the same name


def with_masks(
    workspace: Workspace,
    scene: Scene,
    config: MaskConfig,
    *,
    after_run: bool = False,
    log: bool = True,
) -> Workspace:
    """The workspace with its masks, which are checked.

    Args:
        workspace: The workspace.
        scene: Its views.
        config: The masks asked for.
        after_run: The command uses what a run has made: masks that this left out are
            left out, too.
        log: Log what is used, and which images have no mask.

    Raises:
        WorkspaceError: If there are no such masks, or one does not fit its image.
    """
    masks = find_masks(workspace, config, after_run=after_run)
    without = unmasked_images(masks, scene)
    if masks.are_used and log:
        num_views = len(scene.views)
        num_masked = num_views - len(without)
        words = "Masks: %s (%d of %d images)."
        logger.info(words, said_masks(masks), num_masked, num_views)
    if without and log:
        logger.warning("%s.", said_unmasked(without))
    return dataclasses.replace(workspace, masks=masks)


def find_masks(
    workspace: Workspace, config: MaskConfig, *, after_run: bool = False
) -> Masks:
    """The masks of a command; unchecked. Arguments as of `with_masks`.

    Raises:
        WorkspaceError: If the record of the last run cannot be read.
    """
    if config == MaskConfig():
        config = _recorded(workspace, after_run) or config
    if not config.use_masks:
        return Masks()
    return Masks(
        folder=config.mask_path or find_mask_folder(workspace.path),
        alpha_folder=workspace.images_path if config.alpha_masks else None,
    )


def unmasked_images(masks: Masks, scene: Scene) -> tuple[str, ...]:
    """Check the masks; the images without one, if there are masks at all.

    Raises:
        WorkspaceError: If there are no such masks, or one does not fit its image.
    """
    return check_masks(masks, {view.name: view.camera for view in scene.views})


def said_masks(masks: Masks) -> str:
    """Where the masks are, in words."""
    words = [] if masks.folder is None else [str(masks.folder)]
    if masks.alpha_folder is not None:
        words.append(f"alpha of {masks.alpha_folder}")
    return " and ".join(words)


def said_unmasked(names: tuple[str, ...]) -> str:
    """That these images have no mask."""
    more = len(names) - MOST_NAMES_SHOWN
    shown = ", ".join(names[:MOST_NAMES_SHOWN])
    shown += f" and {more} more" if more > 0 else ""
    number = "1 image has" if len(names) == 1 else f"{len(names)} images have"
    return f"{number} no mask, and all of its pixels count: {shown}"


def wanted_pixels(masks: Masks, name: str, size_px: tuple[int, int]) -> Wanted | None:
    """The mask of an image at the size of a map: each pixel as the mask's nearest.

    Args:
        masks: Those of the workspace.
        name: Name of the image.
        size_px: Width and height of the map.

    Returns:
        Which pixels are wanted, shape (H, W); None = all: the image has no mask.

    Raises:
        WorkspaceError: If a mask is no image, or of another shape than the map.
    """
    found = [nearest_resized(mask, size_px) for mask in masks.read(name, size_px)]
    return np.logical_and.reduce(found) if found else None


def masked_depth(masks: Masks, name: str, depth: DepthMap) -> DepthMap:
    """A depth map of an image, shape (H, W), with 0 where its mask is 0.

    Raises:
        WorkspaceError: As `wanted_pixels`.
    """
    wanted = wanted_pixels(masks, name, (depth.shape[1], depth.shape[0]))
    return depth if wanted is None else np.where(wanted, depth, np.float32(0))


def mask_facts(workspace: Workspace) -> dict[str, Any]:
    """Which masks a result was made with, fit for JSON; a folder in it is relative."""
    folder = workspace.masks.folder
    if folder is not None:
        folder, root = folder.resolve(), workspace.path.resolve()
        folder = folder.relative_to(root) if folder.is_relative_to(root) else folder
    return {
        "folder": None if folder is None else folder.as_posix(),
        "alpha": workspace.masks.alpha_folder is not None,
    }


def _recorded(workspace: Workspace, after_run: bool) -> MaskConfig | None:
    """What the run before used, or left out."""
    record = read_record(OutputWorkspace(source=workspace).record_path)
    options = _mapping(_mapping(record, "options"), "masks")
    if after_run and options.get("use_masks") is False:
        return MaskConfig(use_masks=False)
    for facts in _noted(workspace, record):
        folder, alpha = facts.get("folder"), facts.get("alpha") is True
        path = workspace.path / folder if isinstance(folder, str) else None
        if path is not None and _is_gone(workspace, path):
            continue
        if path is not None or alpha:
            return MaskConfig(mask_path=path, alpha_masks=alpha)
    return None


def _is_gone(workspace: Workspace, folder: Path) -> bool:
    """Whether masks that nobody has named are not there any more.

    Those of a backdrop are made again; `masks/` beside the images is found or not.
    """
    is_found = folder in (
        workspace.path / FOLDER_NAME,
        workspace.path / OUTPUT_FOLDER / BACKDROP_FOLDER,
    )
    return is_found and not (folder.is_dir() and any(folder.iterdir()))


def _noted(
    workspace: Workspace, record: Mapping[str, Any]
) -> Iterator[Mapping[str, Any]]:
    yield _mapping(record, "masks")
    for facts in Manifest(workspace.stereo_path).facts_of(_STEREO)[-1:]:
        yield _mapping(facts, "masks")


def _mapping(facts: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = facts.get(key)
    return value if isinstance(value, Mapping) else {}
