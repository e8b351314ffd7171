"""What the comparison of depth maps is made on: views whose depth is known."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap, UnitColors


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class InitialDepth:
    """Unfiltered depth, and whose it is.

    Attributes:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        origin: Who made it, for people.
        cpu_s: Processor seconds of all threads; None if it was there already.
        source_depths: The sources' own maps, in their order, each of the size of its
            view; None for one without, and for those beyond the end.
    """

    depth: DepthMap
    origin: str
    cpu_s: float | None = None
    source_depths: tuple[DepthMap | None, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DepthSample:
    """One view whose depth is known.

    Attributes:
        name: Name of its image, or of the pair.
        reference: The view.
        sources: The views to compare it with, best first; at least one.
        depth_range: Near and far depth to match between, in units.
        truth: True depth, shape (H, W), in units; 0 = not known.
        seen: Which pixels the first source sees too, shape (H, W), bool; None = not
            known.
        initial: Depth that is there already; None = it has to be matched.
        colors: The reference in colour, RGB, shape (H, W, 3), in 0..1; None = grey.
        source_colors: The first sources likewise; those beyond the end are grey.
    """

    name: str
    reference: MatchView
    sources: tuple[MatchView, ...]
    depth_range: tuple[float, float]
    truth: DepthMap
    seen: npt.NDArray[np.bool_] | None = None
    initial: InitialDepth | None = None
    colors: UnitColors | None = None
    source_colors: tuple[UnitColors | None, ...] = ()

    @property
    def megapixels(self) -> float:
        """Size of the view, in millions of pixels."""
        return self.truth.size / 1e6


@dataclasses.dataclass(frozen=True, kw_only=True)
class SampleOptions:
    """What decides how much of a scene has to be read.

    Attributes:
        stereo: Options of the matcher; it takes up to `max_num_sources`.
        num_sources: Second views that the network takes.
    """

    stereo: StereoConfig
    num_sources: int


LazySample = Callable[[], DepthSample]
"""Reads a case; WorkspaceError if it is broken."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneSource:
    """A scene that has not been read yet.

    Attributes:
        name: What it is called in the result; no other scene is called so.
        read: Finds its cases, at least one; WorkspaceError if the scene is broken.
    """

    name: str
    read: Callable[[SampleOptions], Sequence[LazySample]]
