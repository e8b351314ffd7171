"""The options of the comparison of unfiltered, filtered and refined maps."""

import dataclasses
import itertools
import math
from typing import Any

from resdepth_colmap.config import Config, FuseConfig

RELATIVE_TOLERANCES = (0.01, 0.02)
"""Of the mean true depth, where no tolerances are given."""

FUSE_OPTIONS = (
    "min_num_views",
    "max_depth_error",
    "max_reproj_error",
    "max_normal_error_deg",
    "min_confidence",
)
"""Those of FuseConfig that all arms are fused with."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CompareConfig(Config):
    """How the arms are chosen, fused and scored.

    Attributes:
        unfiltered: The kind of map that is the unfiltered arm; "" = the one without
            holes, the geometric if there are two.
        filtered: The kind of map that is the filtered arm; "" = the one with holes, the
            geometric if there are two.
        tolerances: Distances up to which a point is right, in workspace units,
            increasing; () = 1 % and 2 % of the mean true depth.
        fuse: Thresholds of both fusions; `fuser`, `voxel_size` and `remove_outliers`
            are not used. Depth of less than its `min_confidence` counts as none.
    """

    unfiltered: str = ""
    filtered: str = ""
    tolerances: tuple[float, ...] = ()
    fuse: FuseConfig = dataclasses.field(default_factory=FuseConfig)

    def __post_init__(self) -> None:
        """Check the values once, so that no later code has to."""
        positive = all(0 < tolerance < math.inf for tolerance in self.tolerances)
        increasing = all(a < b for a, b in itertools.pairwise(self.tolerances))
        self._check(
            positive and increasing,
            "increasing distances above 0",
            tolerances=self.tolerances,
        )
        self._check(
            not self.filtered or self.filtered != self.unfiltered,
            "two kinds of map",
            unfiltered=self.unfiltered,
            filtered=self.filtered,
        )

    def to_mapping(self) -> dict[str, Any]:
        """Plain values only, ready for JSON."""
        fuse = {name: getattr(self.fuse, name) for name in FUSE_OPTIONS}
        return {
            "unfiltered": self.unfiltered,
            "filtered": self.filtered,
            "tolerances": list(self.tolerances),
            "fuse": fuse,
        }
