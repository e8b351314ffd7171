"""Uniform backdrops: what stands before black, white or plain paper, and what does not.

Nothing can be matched on a backdrop, and what a network says of it is a guess that all
views share. Where nearly all photographs have one and the same colour around their
border, it is left out as by a mask.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from resdepth_colmap.io.colmap.output import BACKDROP_FOLDER, OutputWorkspace
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import read_rgb, write_png
from resdepth_colmap.pipeline.manifest import Manifest, Task, key_of
from resdepth_colmap.scene import ColorImage, Scene, Wanted

logger = logging.getLogger(__name__)

STAGE = "backdrop"

TOLERANCE = 8.0
"""Of a channel, in 0..255: how far a pixel of the backdrop may be from its colour."""

BORDER_SHARE = 0.6
"""Of the pixels of an image's border that a backdrop fills, in most images."""

IMAGE_SHARE = 0.8
"""Of the images that have to have the backdrop around them."""

NUM_ASKED = 12
"""Images that are looked at to find one."""

LEAST_HOLE_SHARE = 1e-3
"""Of the image: a smaller patch of that colour inside of the object belongs to it."""

MARGIN_PX = 1
"""Kept around the object: an edge that is blurred must not be cut off."""

_SIDE_PX = 320
_BORDER_PX = 4
_BLUR_PX = 3

Color = npt.NDArray[np.float64]


def backdrop_masks(output: OutputWorkspace, scene: Scene) -> Path | None:
    """Masks that leave out a uniform backdrop.

    Args:
        output: Where the masks go; they are not made again for the same images.
        scene: The views.

    Returns:
        Their folder; None if there is no backdrop.

    Raises:
        WorkspaceError: If an image cannot be read, or a mask not be written.
    """
    manifest = Manifest(output.path)
    paths = {view.name: output.source.image_path(view.name) for view in scene.views}
    digests = [[name, manifest.fingerprints.of(path)] for name, path in paths.items()]
    folder = output.path / BACKDROP_FOLDER
    masks = {name: folder / f"{safe_name(name)}.png" for name in paths}
    decision = Task(stage=STAGE, name="found", key=key_of(digests), writes=())
    if not manifest.is_fresh(decision):
        step = max(1, len(paths) // NUM_ASKED)
        asked = [read_rgb(path) for path in list(paths.values())[::step]]
        color = backdrop_color(asked)
        facts = {"color": None if color is None else color.tolist()}
        manifest.finish(decision, facts)
    color = manifest.facts(decision)["color"]
    if color is None:
        return None
    files = tuple(masks.values())
    task = Task(stage=STAGE, name="masks", key=decision.key, writes=files)
    if not manifest.is_fresh(task):
        manifest.start(task)
        for name, path in paths.items():
            wanted = ~is_backdrop(read_rgb(path), np.array(color))
            gray = np.where(wanted, np.uint8(255), np.uint8(0))
            write_png(masks[name], np.repeat(gray[..., np.newaxis], 3, axis=2))
        manifest.finish(task)
    logger.info(
        "A uniform backdrop of colour (%s) is left out; --no-masks keeps it.",
        ", ".join(f"{value:.0f}" for value in color),
    )
    return folder


def backdrop_color(images: Sequence[ColorImage]) -> Color | None:
    """The colour of the backdrop that nearly all images have, shape (3,), 0..255.

    None: they have none, or not the same one.
    """
    borders = [_border(image) for image in images]
    medians = np.array([np.median(border, axis=0) for border in borders])
    color = np.median(medians, axis=0)
    shares = [_is_like(border, color).mean() for border in borders]
    is_there = np.array(shares) >= BORDER_SHARE
    return color if is_there.mean() >= IMAGE_SHARE else None


def is_backdrop(image: ColorImage, color: Color) -> Wanted:
    """Which pixels show the backdrop, shape (H, W): its colour, from the border on.

    A patch inside of the object counts if it is large: one looks through there.
    """
    smooth = cv2.blur(image, (_BLUR_PX, _BLUR_PX))
    alike = _is_like(smooth, color).astype(np.uint8)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(alike, connectivity=4)
    edges = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    counts = statistics[:, cv2.CC_STAT_AREA] >= LEAST_HOLE_SHARE * alike.size
    counts[np.unique(edges)] = True
    counts[0] = False  # what has another colour
    side_px = 2 * MARGIN_PX + 1
    kernel = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.erode(counts[labels].astype(np.uint8), kernel) > 0)


def _border(image: ColorImage) -> Color:
    """The pixels around a small copy of an image, shape (N, 3)."""
    height_px, width_px = image.shape[:2]
    scale = min(1.0, _SIDE_PX / max(height_px, width_px))
    size = max(1, round(width_px * scale)), max(1, round(height_px * scale))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    inner = np.zeros(small.shape[:2], np.bool_)
    inner[_BORDER_PX:-_BORDER_PX, _BORDER_PX:-_BORDER_PX] = True
    return np.asarray(small[~inner], dtype=np.float64)


def _is_like(values: npt.NDArray[Any], color: Color) -> Wanted:
    return np.asarray(
        (np.abs(values.astype(np.float64) - color) <= TOLERANCE).all(axis=-1)
    )
