"""Depth that a network must not change: what was right (docs/adr/0006, 0016, 0018)."""

from typing import NamedTuple

import torch
from torch import Tensor

from resdepth_colmap.pipeline.refine.network_inputs import ViewTensors, seen_by_sources

GATED_ERROR = 0.15
"""Photo-consistency (NCC of 0.7) up to which the photographs confirm a depth."""

CONTRADICTING_CONSISTENCY = 0.05
"""The photographs contradict a change that makes them so much less consistent."""

GATED_CHANGE = 0.03
"""Relative change that is no correction of an outlier."""

CONTRADICTED_ERRORS = (0.1, 0.5, 4.0)
OTHER_ERRORS = (0.1, 0.3, 1.0)
"""A depth stays unless it is changed by so many times the error that the network
expects of its result, if the photographs contradict the change and if not: where no map
of another view confirms it, where one does, and where several do: two maps that were
made from the same two photographs often share a mistake."""


class UpdateGate(NamedTuple):
    """What tells whether a change of the initial depth is taken.

    Attributes:
        view: The view with its initial depth.
        num_sources: How many of its sources are looked at.
        consistency: How well they agree with it there, shape (B, 1, H, W).
    """

    view: ViewTensors
    num_sources: int
    consistency: Tensor

    def is_kept(self, refined: Tensor, error: Tensor | None) -> Tensor:
        """Where the initial depth is put back.

        Small changes are not taken where the photographs contradict them and the depth
        was confirmed, by the map of another view or by the photographs, or where a
        filter has left it; nor are changes that are small beside the expected error. A
        larger change is the correction of an outlier.

        Args:
            refined: Inverse depth, shape (B, 1, H, W), in 1/unit.
            error: Its expected error, likewise; None from a network without any.

        Returns:
            Shape (B, 1, H, W), bool.
        """
        view = self.view
        changed = view._replace(inverse_depth=refined)
        after = seen_by_sources(changed, self.num_sources).consistency
        is_contradicted = after - self.consistency > CONTRADICTING_CONSISTENCY
        num_consistent = torch.zeros_like(view.valid, dtype=torch.uint8)
        if view.num_consistent is not None:
            num_consistent = view.num_consistent
        is_consistent = num_consistent > 0
        if view.is_filtered:
            is_contradicted = is_contradicted | view.valid
            is_supported = view.valid | is_consistent
        else:
            by_photographs = view.valid & (self.consistency < GATED_ERROR)
            is_supported = by_photographs | is_consistent
        relative = torch.where(is_supported & is_contradicted, GATED_CHANGE, 0.0)
        limit = relative * view.inverse_depth
        if error is not None:
            rows = error.new_tensor([OTHER_ERRORS, CONTRADICTED_ERRORS])
            columns = num_consistent.long().clamp(max=len(OTHER_ERRORS) - 1)
            limit = torch.maximum(limit, rows[is_contradicted.long(), columns] * error)
        return (refined - view.inverse_depth).abs() < limit
