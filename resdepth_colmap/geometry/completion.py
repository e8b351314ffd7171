"""Completion of occluded pixels: the background continues behind a depth edge.

The background interpolation of semi-global matching (Hirschmueller, PAMI 2008, section
2.6): a pixel that the source does not see lies beside a nearer surface, on the surface
that the nearer one occludes in the source.
"""

import cv2
import numpy as np
import numpy.typing as npt

from resdepth_colmap.scene import FloatMap

SMOOTHED_PX = 5
"""Window of the median filter over completed pixels, as rows are completed alone."""


def complete_from_background(
    inverse_depth: FloatMap, known: npt.NDArray[np.bool_], along_rows: bool
) -> FloatMap:
    """Give each unknown pixel the farther of the nearest known depths on both sides.

    Args:
        inverse_depth: Shape (H, W), float32, in 1/unit.
        known: Which pixels have a reliable depth, shape (H, W).
        along_rows: Search to the left and right, else above and below; the direction
            of the epipolar lines is the right one.

    Returns:
        Inverse depth, shape (H, W), float32, unchanged where known; the median of all
        known pixels in a line without any, and the input if no pixel is known.
    """
    if known.all() or not known.any():
        return inverse_depth
    if not along_rows:
        transposed = complete_from_background(inverse_depth.T, known.T, along_rows=True)
        return np.ascontiguousarray(transposed.T)
    before = _nearest_known(inverse_depth, known)
    after = _nearest_known(inverse_depth[:, ::-1], known[:, ::-1])[:, ::-1]
    background = np.fmin(before, after)
    background[np.isnan(background)] = np.median(inverse_depth[known])
    filled_in = np.where(known, inverse_depth, background).astype(np.float32)
    smooth = cv2.medianBlur(filled_in, SMOOTHED_PX)
    return np.where(known, inverse_depth, smooth).astype(np.float32)


def _nearest_known(values: FloatMap, known: npt.NDArray[np.bool_]) -> FloatMap:
    """Of each pixel the last known value before it in its row; NaN if there is none."""
    columns = np.where(known, np.arange(values.shape[1]), -1)
    columns = np.maximum.accumulate(columns, axis=1)
    found = np.take_along_axis(values, np.maximum(columns, 0), axis=1)
    return np.where(columns >= 0, found, np.nan).astype(np.float32)
