"""Update gating: which updates are not taken (docs/adr/0006, 0016, 0018)."""

from typing import NamedTuple

import torch
from torch import Tensor

from resdepth_colmap.pipeline.refine.network_inputs import ViewTensors, seen_by_sources

SUPPORTED_ERROR = 0.15
"""Photometric error (an NCC of 0.7) up to which the photographs support a depth."""

CONTRADICTING_ERROR = 0.05
"""The photographs contradict an update that raises the photometric error so much."""

GATED_CHANGE = 0.03
"""Relative change that is no correction of an outlier."""

CONTRADICTED_ERRORS = (0.1, 0.5, 4.0)
OTHER_ERRORS = (0.1, 0.3, 1.0)
"""An update is rejected if it is smaller than so many times the error that the network
expects of its result, where the photographs contradict it and where they do not: by the
number of other maps that are consistent with the initial depth (0, 1, more). Two maps
that were made from the same two photographs often share a mistake."""


class UpdateGate(NamedTuple):
    """What tells whether an update of the initial depth is taken.

    Attributes:
        view: The view with its initial depth.
        num_sources: Number of sources that are compared with it.
        error: Their photometric error at the initial depth, shape (B, 1, H, W), 0 =
            the same pattern.
    """

    view: ViewTensors
    num_sources: int
    error: Tensor

    def rejects(self, refined: Tensor, expected_error: Tensor | None) -> Tensor:
        """Where the initial depth stays.

        A small update is rejected where the photographs contradict it and the initial
        depth is supported: by a consistent map of another view, by the photographs, or
        because a filter has kept it. An update that is small beside its expected error
        is rejected, too. A larger one is the correction of an outlier.

        Args:
            refined: Inverse depth, shape (B, 1, H, W), in 1/unit.
            expected_error: Of it, likewise; None from a network without any.

        Returns:
            Shape (B, 1, H, W), bool.
        """
        view = self.view
        changed = view._replace(inverse_depth=refined)
        after = seen_by_sources(changed, self.num_sources).error
        is_contradicted = after - self.error > CONTRADICTING_ERROR
        num_consistent = torch.zeros_like(view.valid, dtype=torch.uint8)
        if view.num_consistent is not None:
            num_consistent = view.num_consistent
        is_consistent = num_consistent > 0
        if view.is_filtered:
            is_contradicted = is_contradicted | view.valid
            is_supported = view.valid | is_consistent
        else:
            by_photographs = view.valid & (self.error < SUPPORTED_ERROR)
            is_supported = by_photographs | is_consistent
        relative = torch.where(is_supported & is_contradicted, GATED_CHANGE, 0.0)
        limit = relative * view.inverse_depth
        if expected_error is not None:
            rows = expected_error.new_tensor([OTHER_ERRORS, CONTRADICTED_ERRORS])
            column = num_consistent.long().clamp(max=len(OTHER_ERRORS) - 1)
            factor = rows[is_contradicted.long(), column]
            limit = torch.maximum(limit, factor * expected_error)
        return (refined - view.inverse_depth).abs() < limit
