"""Depth whose edges follow the photo's: a median weighted by likeness of colour.

Ma et al., "Constant time weighted median filtering for stereo matching and beyond",
ICCV 2013: beside an edge of depth the pixels of the same colour belong to the same
surface. Compiled by numba: neither torch nor OpenCV (without its contributed modules)
has a weighted median.
"""

import cv2
import numpy as np
from numba import njit, prange

from resdepth_colmap.geometry.threading_layer import prefer_openmp
from resdepth_colmap.scene import FloatMap, UnitColors

prefer_openmp()

STEP_PX, NUM_STEPS = 3, 3
RADIUS_PX = STEP_PX * NUM_STEPS
"""The median is over every third pixel of a window of 19 x 19."""

EDGE_RATIO = 1.05
"""Where all of a window lies within this ratio there is no edge: nothing changes."""

COLOR_SPREAD = 0.05
"""Standard deviation of the difference, per channel, of colours of one surface."""

NUM_HALVINGS = 12
"""Of the range of a window: the median is found to 1/4096 of it."""

_NUM_SAMPLES = (2 * NUM_STEPS + 1) ** 2


def guided_median(
    inverse_depth: FloatMap, colors: UnitColors, weights: FloatMap
) -> FloatMap:
    """Median of what surrounds each pixel near an edge and looks like it.

    Args:
        inverse_depth: Shape (H, W), float32, > 0, in 1/unit.
        colors: The photo, shape (H, W, C), in 0..1.
        weights: How much each pixel is to be trusted, shape (H, W), > 0.

    Returns:
        Inverse depth, shape (H, W), float32; each value is one of the input's.
    """
    window = np.ones((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1), np.uint8)
    values = np.ascontiguousarray(inverse_depth, np.float32)
    is_edge = cv2.dilate(values, window) > EDGE_RATIO * cv2.erode(values, window)
    result = values.copy()
    spread = COLOR_SPREAD * np.sqrt(2.0 * colors.shape[2])
    photo = np.ascontiguousarray(colors / spread, np.float32)
    _medians(values, photo, weights.astype(np.float32), is_edge, result)
    return result


# mypy: disable-error-code="no-untyped-def"


@njit(cache=True, fastmath=True, parallel=True)
def _medians(values, colors, weights, is_edge, result):
    height, width = values.shape
    for row in prange(height):
        window = np.empty((2, _NUM_SAMPLES), np.float32)  # values; their weights
        for column in range(width):
            if is_edge[row, column]:
                count = _gather(values, colors, weights, row, column, window)
                result[row, column] = _median(window[0, :count], window[1, :count])


@njit(cache=True, fastmath=True)
def _gather(values, colors, weights, row, column, window):
    height, width = values.shape
    count = 0
    for y in range(row - RADIUS_PX, row + RADIUS_PX + 1, STEP_PX):
        for x in range(column - RADIUS_PX, column + RADIUS_PX + 1, STEP_PX):
            if 0 <= y < height and 0 <= x < width:
                distance = np.float32(0.0)
                for channel in range(colors.shape[2]):
                    step = colors[y, x, channel] - colors[row, column, channel]
                    distance += step * step
                window[0, count] = values[y, x]
                window[1, count] = np.exp(-distance) * weights[y, x]
                count += 1
    return count


@njit(cache=True, fastmath=True)
def _median(found, shares):
    # Halving the range takes 0.6 of the time of sorting: it runs on vectors.
    half = np.float32(0.5) * shares.sum()
    low, high = found.min(), found.max()
    median = high
    if _share_up_to(low, found, shares) >= half:
        return low
    for _ in range(NUM_HALVINGS):
        middle = np.float32(0.5) * (low + high)
        if _share_up_to(middle, found, shares) >= half:
            high = middle
        else:
            low = middle
    for index in range(found.size):
        if low < found[index] < median:
            median = found[index]
    return median


@njit(cache=True, fastmath=True)
def _share_up_to(limit, found, shares):
    total = np.float32(0.0)
    for index in range(found.size):
        total += shares[index] if found[index] <= limit else np.float32(0.0)
    return total
