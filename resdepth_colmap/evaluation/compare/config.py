"""Options of the comparison of filtered, unfiltered and refined maps."""

import dataclasses
from typing import Any

from resdepth_colmap.config import Config, FuseConfig, MaskConfig
from resdepth_colmap.evaluation.cloud.config import is_increasing

FUSE_OPTIONS = (
    "min_num_views",
    "max_depth_error",
    "max_reproj_error",
    "max_normal_error_deg",
    "min_confidence",
)
"""The options of FuseConfig that the fusion of all methods shares."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CompareConfig(Config):
    """How the methods are chosen, fused and scored.

    Attributes:
        unfiltered: The kind of map to compare as "unfiltered"; "" = the one without
            holes, the geometric of two.
        filtered: The kind of map to compare as "filtered"; "" = the one with holes, the
            geometric of two.
        tolerances: Largest distances of a correct point, in workspace units,
            increasing; () = 1 % and 2 % of the mean true depth.
        fuse: Thresholds of both fusions; `fuser`, `voxel_size` and `remove_outliers`
            are ignored. Depth below its `min_confidence` counts as none.
        masks: Which pixels are left out of all methods.
    """

    unfiltered: str = ""
    filtered: str = ""
    tolerances: tuple[float, ...] = ()
    fuse: FuseConfig = dataclasses.field(default_factory=FuseConfig)
    masks: MaskConfig = dataclasses.field(default_factory=MaskConfig)

    def __post_init__(self) -> None:
        """Check the values."""
        self._check(
            is_increasing(self.tolerances), "increasing distances above 0", "tolerances"
        )
        self._check(
            not self.filtered or self.filtered != self.unfiltered,
            "two kinds of map",
            "unfiltered",
            "filtered",
        )

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        fuse = {name: getattr(self.fuse, name) for name in FUSE_OPTIONS}
        return {
            **vars(self),
            "tolerances": list(self.tolerances),
            "fuse": fuse,
            "masks": self.masks.to_mapping(),
        }
