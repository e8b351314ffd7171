"""Samples of an evaluation: views with ground truth."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap, UnitColors


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class InitialDepth:
    """Unfiltered depth and its origin.

    Attributes:
        depth: Shape (H, W), in workspace units; 0 = no depth.
        origin: The matcher or the kind of map, as text.
        cpu_s: Processor seconds of all threads; None for existing depth.
        source_depths: The maps of the first sources, each of the size of its view;
            None for a source without. Sources beyond the end have none.
    """

    depth: DepthMap
    origin: str
    cpu_s: float | None = None
    source_depths: tuple[DepthMap | None, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class DepthSample:
    """A reference view with its inputs and ground truth.

    Attributes:
        name: Name of its image, or of the pair.
        reference: The view.
        sources: Its source views, best first; at least one.
        depth_range: Nearest and farthest depth to match, in units.
        truth: True depth, shape (H, W), in units; 0 = unknown.
        seen: Which pixels the first source sees, too, shape (H, W), bool; None =
            unknown.
        initial: Existing depth; None = to be matched.
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
    """Options of the matcher, and number of source views of the network."""

    stereo: StereoConfig
    num_sources: int


LazySample = Callable[[], DepthSample]
"""Reads a sample; WorkspaceError if it is broken."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneSource:
    """A scene that has not been read yet.

    Attributes:
        name: Unique name of the scene in the result.
        read: Finds its samples, at least one; WorkspaceError if the scene is broken.
    """

    name: str
    read: Callable[[SampleOptions], Sequence[LazySample]]
