"""Warping: a source image, sampled by the depth of the reference.

Paper, section "Image Rectification": occlusions are not handled. A surface that the
source does not see gets the texture of its occluder a second time; such displaced
copies carry more evidence for the network than empty pixels.
"""

import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from resdepth_colmap.geometry.pixels import inside_image, to_grid

LEAST_DEPTH_RATIO = 1e-6
"""Source depth over reference depth below which a point counts as behind the source."""


def warp_to_reference(
    source_image: Tensor,
    inverse_depth: Tensor,
    reference_K: Tensor,
    source_K: Tensor,
    source_from_reference: Tensor,
) -> tuple[Tensor, Tensor]:
    """Sample the source where the surface of the reference projects into it.

    Differentiable with respect to the image and the inverse depth.

    Args:
        source_image: Channels of the source, shape (B, C, Hs, Ws), float.
        inverse_depth: Of the reference, shape (B, 1, H, W), in 1/unit; 0 = no depth.
        reference_K: K for index coordinates, shape (B, 3, 3), in pixels.
        source_K: K of the source, likewise.
        source_from_reference: Pose, shape (B, 3, 4), translation in units.

    Returns:
        The warped image, shape (B, C, H, W), bilinear, 0 where not inside; and where
        it is inside: the pixel has a depth, and that point lies in front of the source
        and within its image, shape (B, 1, H, W), bool.
    """
    height_px, width_px = source_image.shape[-2:]
    homogeneous = project_homogeneous(
        inverse_depth, reference_K, source_K, source_from_reference
    )
    in_front = homogeneous[:, 2] > LEAST_DEPTH_RATIO
    z = torch.where(in_front, homogeneous[:, 2], 1.0)
    xy = homogeneous[:, :2].movedim(1, -1) / z[..., None]
    inside = in_front & (inverse_depth[:, 0] > 0)
    inside &= inside_image(xy, width_px, height_px)
    xy = torch.where(inside[..., None], xy, 0.0)  # grid_sample fails for 1e30
    warped = grid_sample(
        source_image,
        to_grid(xy, width_px, height_px),
        mode="bilinear",
        padding_mode="border",
        align_corners=True,
    )
    return torch.where(inside[:, None], warped, 0.0), inside[:, None]


def project_homogeneous(
    inverse_depth: Tensor,
    reference_K: Tensor,
    source_K: Tensor,
    source_from_reference: Tensor,
) -> Tensor:
    """Homogeneous source pixels, shape (B, 3, H, W), without dividing by depth.

    K_s (R z K_r^-1 x + t) is, up to the scale z, (K_s R K_r^-1) x + (K_s t) / z:
    linear in the inverse depth, and well behaved as the depth goes to infinity. The
    arguments are those of `warp_to_reference`; the third coordinate is the depth in the
    source over that in the reference.
    """
    dtype, device = inverse_depth.dtype, inverse_depth.device
    # The small matrices in double precision: 1e-7 of 5000 px is a visible error. On the
    # CPU, because Apple GPUs have no doubles.
    K_s = source_K.to("cpu", torch.float64)
    pose = source_from_reference.to("cpu", torch.float64)
    inverse_K_r = torch.linalg.inv(reference_K.to("cpu", torch.float64))
    at_infinity = (K_s @ pose[..., :3] @ inverse_K_r).to(dtype).to(device)
    towards_epipole = (K_s @ pose[..., 3:]).to(dtype).to(device)
    height_px, width_px = inverse_depth.shape[-2:]
    x = torch.arange(width_px, dtype=dtype, device=device)
    y = torch.arange(height_px, dtype=dtype, device=device)[:, None]
    column_x, column_y, column_1 = at_infinity[..., None, None].unbind(2)
    epipole = towards_epipole[..., None]
    rays: Tensor = column_x * x + (column_y * y + column_1)
    return rays + epipole * inverse_depth
