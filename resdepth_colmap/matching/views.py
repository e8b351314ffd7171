"""The reference and its sources as the kernels take them. Compiled by numba.

A pixel (x, y) of the reference with inverse depth w lies in a source at the homogeneous
position ``A (x, y, 1) + b w`` with ``A = K_s R K_r^-1`` and ``b = K_s t``: linear in w,
so a plane, whose inverse depth is linear in the pixel, is a homography (COLMAP,
patch_match_cuda.cu, ComposeHomography).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from numba import njit

from resdepth_colmap.scene import DepthMap, FloatMap, GrayImage

NUM_LEVELS = 3  # of blur: 0, 1 and 2 px, with windows of 1, 2 and 4 times the size
ZERO, ONE, SMALL = np.float32(0), np.float32(1), np.float32(1e-3)

FloatArray = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]


class Reference(NamedTuple):
    """The view whose depth is estimated.

    Attributes:
        levels: Grey values in 0..1 at each level of blur, shape (NUM_LEVELS, H, W).
        K: Intrinsics for integer pixel centres, shape (3, 3).
    """

    levels: FloatArray
    K: FloatArray


class Sources(NamedTuple):
    """The source views; their images, of any sizes, lie one after the other.

    Attributes:
        A: Shape (S, 3, 3): a pixel lies at ``A (x, y, 1) + b inverse_depth``.
        b: Shape (S, 3).
        pixels: Grey values in 0..1 of all images at each level of blur, shape
            (NUM_LEVELS, pixels of all images).
        inverse_depths: Inverse depth of all pixels, in 1/unit, 0 = none; or empty.
        starts: Index of the first pixel of each image, shape (S,).
        sizes: Width and height of each image, shape (S, 2).
    """

    A: FloatArray
    b: FloatArray
    pixels: FloatArray
    inverse_depths: FloatArray
    starts: IntArray
    sizes: IntArray


def pack_sources(
    A: FloatMap,
    b: FloatMap,
    images: Sequence[GrayImage],
    depths: Sequence[DepthMap] | None,
) -> Sources:
    """The sources as the kernels take them.

    Args:
        A: Shape (S, 3, 3), see `Sources`.
        b: Shape (S, 3).
        images: Grey values of each source in 0..1.
        depths: Depth map of each, of the size of its image, in units; 0 = none.
    """
    sizes = np.array([image.shape[::-1] for image in images], np.int64)
    ends = np.cumsum(sizes.prod(axis=1))
    pixels = np.concatenate(
        [blur_levels(image).reshape(NUM_LEVELS, -1) for image in images], axis=1
    )
    inverse = np.zeros(0, np.float32)
    if depths is not None:
        depth = np.concatenate([depth.ravel() for depth in depths])
        inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=depth > 0)
    return Sources(
        A=A,
        b=b,
        pixels=pixels,
        inverse_depths=inverse.astype(np.float32),
        starts=ends - sizes.prod(axis=1),
        sizes=sizes,
    )


def blur_levels(gray: GrayImage) -> FloatMap:
    """The image at each level of blur, shape (NUM_LEVELS, H, W)."""
    sigmas = [2.0 ** (level - 1) for level in range(1, NUM_LEVELS)]
    blurred = [cv2.GaussianBlur(gray, (0, 0), sigma) for sigma in sigmas]
    return np.stack([gray, *blurred]).astype(np.float32)


@njit(cache=True, fastmath=True, inline="always")
def project(x, y, w, sources, s, axis):
    """One homogeneous coordinate in source s of a pixel with inverse depth w.

    Args:
        x: The pixel.
        y: Likewise.
        w: Its inverse depth.
        sources: The source views.
        s: Index of the source.
        axis: 0 or 1 for the position times the depth, 2 for the depth, all of it in
            units of the depth in the reference.
    """
    A, b = sources.A, sources.b
    return A[s, axis, 0] * x + A[s, axis, 1] * y + A[s, axis, 2] + b[s, axis] * w


@njit(cache=True, fastmath=True, inline="always")
def inverse_depth_per_px(x, y, w, sources, s):
    """Change of inverse depth that moves the pixel by one pixel in source s."""
    b = sources.b
    u0 = project(x, y, w, sources, s, 0)
    u1 = project(x, y, w, sources, s, 1)
    u2 = max(project(x, y, w, sources, s, 2), SMALL)
    dx = (b[s, 0] - b[s, 2] * u0 / u2) / u2
    dy = (b[s, 1] - b[s, 2] * u1 / u2) / u2
    return ONE / (math.sqrt(dx * dx + dy * dy) + np.float32(1e-12))


@njit(cache=True, fastmath=True)
def finest_inverse_depth_per_px(x, y, w, sources):
    """The least `inverse_depth_per_px` of all sources."""
    finest = np.float32(1e30)
    for s in range(sources.A.shape[0]):
        finest = min(finest, inverse_depth_per_px(x, y, w, sources, s))
    return finest
