"""Depth that a network must not change: what was right stays (docs/adr/0006, 0012)."""

import torch
from torch import Tensor

from resdepth_colmap.pipeline.inputs import ViewTensors, photo_consistency, warp_sources

KEPT_CONSISTENCY = 0.15
"""Photo-consistency (NCC of 0.7) up to which the photographs confirm a depth."""

FILTERED_SHARE = 0.95
"""A map with less of its pixels filled has been filtered."""

KEPT_CHANGE, KEPT_CONFIRMED_CHANGE = 0.05, 0.2
"""Relative changes that are no correction of an outlier: a depth stays that a filter or
the photographs confirm, and one that a map of another view does."""


def undone_change(tensors: ViewTensors) -> Tensor:
    """The relative change below which the initial depth is put back.

    A larger change is the correction of an outlier. `KEPT_CONFIRMED_CHANGE` where the
    depth map of another view says the same: views that were matched by themselves agree
    by chance only rarely. `KEPT_CHANGE` where a filter has left the depth, which it has
    seen in several views, or where the photographs confirm it. 0 for what was not
    measured.

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
    change = torch.where(is_kept, KEPT_CHANGE, 0.0)
    if tensors.confirmed is not None:
        change = torch.where(tensors.confirmed, KEPT_CONFIRMED_CHANGE, change)
    return change


def is_filtered(valid: Tensor) -> bool:
    """Whether a map has so many holes that it must have been filtered."""
    return float(valid.float().mean()) < FILTERED_SHARE
