"""What surrounds a pixel: like depths, steps in depth, texture."""

import warnings

import cv2
import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.map_agreement import Pixels
from resdepth_colmap.scene import DepthMap, FloatMap, GrayImage

ALIKE_WITHIN = 0.02
"""Relative difference of depths that are alike."""

ALIKE_RADIUS_PX = 2
STEP = 0.03
"""Relative difference of neighbouring depths that is a step."""

STEP_REACH_PX = 5
TEXTURE_RADIUS_PX = 4


def likeness(depth: DepthMap) -> npt.NDArray[np.float64]:
    """Share of the depths in a pixel's 5 x 5 window that are like its own, (H, W)."""
    window = _windows(depth)
    alike = np.abs(window - depth) <= ALIKE_WITHIN * depth
    number = np.isfinite(window).sum(axis=0)
    return np.asarray(alike.sum(axis=0) / np.maximum(number, 1))


def is_like_median(depth: DepthMap) -> Pixels:
    """Where a depth is like the median of the depths in its window, (H, W)."""
    with warnings.catch_warnings():
        # Windows without any depth have no median, and no pixel in them a depth.
        warnings.simplefilter("ignore", RuntimeWarning)
        median = np.nanmedian(_windows(depth), axis=0)
    return np.asarray((depth > 0) & (np.abs(median - depth) <= ALIKE_WITHIN * depth))


def _windows(depth: DepthMap) -> FloatMap:
    """The depths of each pixel's window, shape (25, H, W); NaN = none."""
    radius, (height_px, width_px) = ALIKE_RADIUS_PX, depth.shape
    known = np.where(depth > 0, depth, np.float32(np.nan))
    padded = np.pad(known, radius, constant_values=np.nan)
    steps = range(2 * radius + 1)
    rows = [padded[i : i + height_px, j : j + width_px] for i in steps for j in steps]
    return np.stack(rows)


def near_steps(depth: DepthMap) -> Pixels:
    """Where a step in depth is a few pixels off at most, shape (H, W)."""
    near = np.where(depth > 0, depth, np.float32(np.inf))
    around = np.ones((3, 3), np.uint8)
    is_step = cv2.dilate(depth, around) > (1 + STEP) * cv2.erode(near, around)
    reach = np.ones((2 * STEP_REACH_PX + 1,) * 2, np.uint8)
    return np.asarray(cv2.dilate(is_step.astype(np.uint8), reach) > 0)


def textures(gray: GrayImage) -> npt.NDArray[np.float64]:
    """Standard deviation of the grey values of a 9 x 9 window, in 0..255, (H, W)."""
    size = (2 * TEXTURE_RADIUS_PX + 1,) * 2
    values = gray.astype(np.float64)
    mean, square = (cv2.boxFilter(it, -1, size) for it in (values, values**2))
    return np.asarray(255 * np.sqrt(np.maximum(square - mean**2, 0)))
