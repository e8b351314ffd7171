"""What depth maps can be exported as."""

import enum

REFINED = "refined"
"""The maps that `refine` made, as opposed to a kind in the workspace's `stereo/`."""


class MapFormat(enum.StrEnum):
    """A file format for depth maps."""

    NPY = "npy"
    PFM = "pfm"
    PNG16 = "png16"
