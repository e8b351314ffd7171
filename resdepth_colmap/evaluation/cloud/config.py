"""Options of the cloud scores; defaults of ETH3D's evaluation program."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

from resdepth_colmap.config import Config

DEFAULT_TOLERANCES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


@dataclasses.dataclass(frozen=True, kw_only=True)
class CloudConfig(Config):
    """How a cloud is scored against laser scans; names and defaults are ETH3D's.

    Attributes:
        tolerances: Largest distances of a correct point, in metres, increasing.
        voxel_size: Side of the voxels that scores are averaged over, in metres.
        beam_start_radius_meters: Radius of the laser beam at the scanner.
        beam_divergence_halfangle_deg: Half the opening angle of the beam, in degrees.
    """

    tolerances: tuple[float, ...] = DEFAULT_TOLERANCES
    voxel_size: float = 0.01
    beam_start_radius_meters: float = 0.5 * 0.00225
    beam_divergence_halfangle_deg: float = 0.011

    def __post_init__(self) -> None:
        """Check the ranges."""
        self._check(
            bool(self.tolerances) and is_increasing(self.tolerances),
            "one or more distances above 0, increasing, in metres",
            "tolerances",
        )
        self._check(0 < self.voxel_size < math.inf, "a length above 0", "voxel_size")
        self._check(
            0 <= self.beam_start_radius_meters < math.inf,
            "a length, 0 or more",
            "beam_start_radius_meters",
        )
        self._check(
            0 <= self.beam_divergence_halfangle_deg < 45,
            "an angle of 0 to 45 degrees",
            "beam_divergence_halfangle_deg",
        )


def is_increasing(tolerances: Sequence[float]) -> bool:
    """Whether distances are finite, above 0 and increasing."""
    return all(a < b for a, b in itertools.pairwise((0.0, *tolerances, math.inf)))
