"""Depth that a network must not change: what was right stays (docs/adr/0006, 0012)."""

import torch
from torch import Tensor

from resdepth_colmap.pipeline.inputs import ViewTensors, photo_consistency, warp_sources

KEPT_CONSISTENCY = 0.15
"""Photo-consistency (NCC of 0.7) up to which the photographs confirm a depth."""

FILTERED_SHARE = 0.95
"""A map with less of its pixels filled has been filtered."""

KEPT_CHANGE = 0.03
"""Relative change that is no correction of an outlier: a confirmed depth stays."""

CONFIRMED_ERRORS, OTHER_ERRORS = 1.5, 0.5
"""What another view's map confirms stays unless it is changed by so many times the
error that the network expects of its result; and so does anything else."""


def kept_change(tensors: ViewTensors) -> Tensor:
    """The relative change below which the initial depth is put back.

    A larger change is the correction of an outlier. `KEPT_CHANGE` where the depth map
    of another view says the same, where a filter has left the depth, or where the
    photographs confirm it; 0 elsewhere, and for what was not measured.

    Args:
        tensors: A view with its initial depth.

    Returns:
        Shape (B, 1, H, W), float.
    """
    valid = tensors.valid
    if is_filtered(valid):
        is_kept = valid
    elif tensors.sources:
        warped = warp_sources(tensors, 1)
        is_kept = photo_consistency(tensors.gray, warped) < KEPT_CONSISTENCY
        is_kept &= valid
    else:
        is_kept = torch.zeros_like(valid)
    if tensors.confirmed is not None:
        is_kept = is_kept | tensors.confirmed
    return torch.where(is_kept, KEPT_CHANGE, 0.0)


def kept_errors(tensors: ViewTensors) -> Tensor:
    """The expected errors below which a change is none, shape (B, 1, H, W) or ()."""
    if tensors.confirmed is None:
        return torch.tensor(OTHER_ERRORS, device=tensors.valid.device)
    return torch.where(tensors.confirmed, CONFIRMED_ERRORS, OTHER_ERRORS)


def is_filtered(valid: Tensor) -> bool:
    """Whether a map has so many holes that it must have been filtered."""
    return float(valid.float().mean()) < FILTERED_SHARE
