"""Maps and images at other sizes; every size is (width, height), in pixels."""

from typing import Any, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

Value = TypeVar("Value", np.float32, np.uint8, np.bool_)


def nearest_resized(
    values: npt.NDArray[Value], size_px: tuple[int, int]
) -> npt.NDArray[Value]:
    """A map at another size: each pixel takes the value of the nearest one.

    Depths are never averaged: a mean of two surfaces lies on neither.

    Args:
        values: Shape (H, W) or (H, W, C).
        size_px: Width and height of the result.

    Returns:
        Same type; the array itself if it has that size already.
    """
    return _resized(values, size_px, cv2.INTER_NEAREST_EXACT)


def area_resized(
    values: npt.NDArray[Value], size_px: tuple[int, int]
) -> npt.NDArray[Value]:
    """An image at another size: each pixel is the mean of the area that it covers.

    So a smaller image shows no aliasing.

    Args:
        values: Grey values or colours, shape (H, W) or (H, W, C).
        size_px: Width and height of the result.

    Returns:
        Same type; the array itself if it has that size already.
    """
    return _resized(values, size_px, cv2.INTER_AREA)


def _resized(
    values: npt.NDArray[Any], size_px: tuple[int, int], interpolation: int
) -> npt.NDArray[Any]:
    if values.shape[:2] == size_px[::-1]:
        return values
    is_flag = values.dtype == np.bool_  # a type that OpenCV does not take
    pixels = values.view(np.uint8) if is_flag else values
    resized = cv2.resize(pixels, size_px, interpolation=interpolation)
    shaped = np.asarray(resized).reshape(*size_px[::-1], *values.shape[2:])
    return shaped.view(values.dtype)
