"""Networks that refine a view one after the other."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.pipeline.refine.view import ViewInputs, refine_view
from resdepth_colmap.scene import DepthMap

REFINING = RefineConfig(inner_iterations=1, update_gating=False)
"""The networks alone."""


class Method(NamedTuple):
    """Networks that are applied one after the other.

    Attributes:
        networks: Each gets the depth of the one before, and warps with it.
    """

    networks: Sequence[ResDepthNet]

    def refined(self, view: ViewInputs) -> DepthMap:
        """Depth after the last network, shape (H, W), in units; 0 = no depth."""
        for network in self.networks:
            depth = refine_view(view, network, REFINING).depth
            view = dataclasses.replace(view, depth=depth)
        return view.depth
