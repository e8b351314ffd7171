"""Depth that a network must not change: what was right stays (docs/adr/0006, 0016)."""

from typing import NamedTuple

import torch
from torch import Tensor

from resdepth_colmap.pipeline.inputs import ViewTensors, seen_by_sources

KEPT_CONSISTENCY = 0.15
"""Photo-consistency (NCC of 0.7) up to which the photographs confirm a depth."""

CONTRADICTING_CONSISTENCY = 0.05
"""The photographs contradict a change that makes them so much less consistent."""

KEPT_CHANGE = 0.03
"""Relative change that is no correction of an outlier."""

CONTRADICTED_ERRORS, CONFIRMED_ERRORS, OTHER_ERRORS = 2.0, 1.0, 0.5
"""A depth stays unless it is changed by so many times the error that the network
expects of its result: what another view's map confirms, if the photographs contradict
the change and if not; and anything else."""


class KeptDepth(NamedTuple):
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
        is_confirmed = torch.zeros_like(view.valid)
        if view.confirmed is not None:
            is_confirmed = view.confirmed
        if view.is_filtered:
            is_contradicted = is_contradicted | view.valid
            is_supported = view.valid | is_confirmed
        else:
            by_photographs = view.valid & (self.consistency < KEPT_CONSISTENCY)
            is_supported = by_photographs | is_confirmed
        relative = torch.where(is_supported & is_contradicted, KEPT_CHANGE, 0.0)
        limit = relative * view.inverse_depth
        if error is not None:
            confirmed_errors = torch.where(
                is_contradicted, CONTRADICTED_ERRORS, CONFIRMED_ERRORS
            )
            num_errors = torch.where(is_confirmed, confirmed_errors, OTHER_ERRORS)
            limit = torch.maximum(limit, num_errors * error)
        return (refined - view.inverse_depth).abs() < limit
