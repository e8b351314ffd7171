"""The options of a whole run, stage by stage."""

import dataclasses
import enum
from typing import Any

from resdepth_colmap.config import (
    FuseConfig,
    MaskConfig,
    RefineConfig,
    StereoBackend,
    StereoConfig,
)

UNFILTERED = StereoConfig(filter=False)
"""What `refine` matches with, where there are no maps."""


class CloudFormat(enum.StrEnum):
    """The file of the fused cloud."""

    PLY = "ply"
    PCD = "pcd"
    XYZ = "xyz"


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunConfig:
    """What `run_refine` does.

    Attributes:
        backend: Where initial depth comes from.
        stereo: Options of the PatchMatch; not filtered, as the refinement has more use
            for a doubtful depth than for a hole.
        refine: Options of the refinement.
        fuse: Options of the fusion.
        masks: Which pixels of the images are ignored.
        no_fuse: Leave out the cloud.
        no_pictures: Leave out the pictures.
        cloud_format: File format of the cloud.
        in_place: Put the refined maps into the workspace's own `stereo/`, where they
            replace the geometric ones; the originals are kept beside them.
        overwrite: Do again what is finished and unchanged.
    """

    backend: StereoBackend = StereoBackend.AUTO
    stereo: StereoConfig = UNFILTERED
    refine: RefineConfig = dataclasses.field(default_factory=RefineConfig)
    fuse: FuseConfig = dataclasses.field(default_factory=FuseConfig)
    masks: MaskConfig = dataclasses.field(default_factory=MaskConfig)
    no_fuse: bool = False
    no_pictures: bool = False
    cloud_format: CloudFormat = CloudFormat.PLY
    in_place: bool = False
    overwrite: bool = False

    def to_mapping(self) -> dict[str, Any]:
        """Plain values only, ready for JSON."""
        names = ("stereo", "refine", "fuse", "masks")
        stages = {name: getattr(self, name) for name in names}
        plain = {name: config.to_mapping() for name, config in stages.items()}
        return {
            **vars(self),
            **plain,
            "backend": str(self.backend),
            "cloud_format": str(self.cloud_format),
        }
