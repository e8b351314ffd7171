"""Depth, differences and errors as colours."""

import dataclasses
import math
from typing import Any, Self

import matplotlib
import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap

HOLE_COLOR = (200, 200, 200)
"""RGB of what has no value; light, because both ends of the depth colours are dark."""

DEPTH_COLORS = "turbo"
DIFFERENCE_COLORS = "RdBu_r"
ERROR_COLORS = "inferno"
ERROR_RANGE = (0.001, 0.1)
"""Relative errors between which the logarithmic colours of errors run."""

_ROBUST_PERCENT = (2.0, 98.0)
_LEAST_SPREAD = 0.01  # of the inverse depth: a fronto-parallel wall has none
_LEAST_DIFFERENCE = 0.001


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthScale:
    """A scale of colours that is linear in inverse depth.

    Attributes:
        least: Inverse depth of the first (far) colour, in 1/unit.
        most: Inverse depth of the last (near) colour, in 1/unit.
    """

    least: float
    most: float

    @classmethod
    def of(cls, *maps: DepthMap) -> Self:
        """The 2-98 % range of the first map that has a depth."""
        for depth in maps:
            inverse = invert_map(depth)
            inverse = inverse[inverse > 0]
            if inverse.size:
                least, most = map(float, np.percentile(inverse, _ROBUST_PERCENT))
                missing = max(0.0, _LEAST_SPREAD * most - (most - least))
                return cls(least=least - missing / 2, most=most + missing / 2)
        return cls(least=0.5, most=1.0)

    def colored(self, depth: DepthMap) -> ColorImage:
        """A depth map in colours, blue far, red near; holes in their own colour."""
        inverse = invert_map(depth)
        unit = (inverse - self.least) / (self.most - self.least)
        return _colored(unit, inverse > 0, DEPTH_COLORS)

    def ticks(self, number: int = 5) -> list[tuple[float, str]]:
        """Round depths on the scale: where in 0..1, and how they are written."""
        inverse = np.linspace(self.least, self.most, number + 2)[1:-1]
        depths = [float(1.0 / value) for value in inverse]
        spread = abs(depths[0] - depths[-1]) / number
        decimals = max(0, 1 - math.floor(math.log10(spread))) if spread > 0 else 0
        found = {}
        for depth in depths:
            text = f"{depth:.{decimals}f}" if decimals < 7 else f"{depth:.3g}"
            unit = (1.0 / float(text) - self.least) / (self.most - self.least)
            if 0 <= unit <= 1:
                found[text] = unit
        return [(unit, text) for text, unit in found.items()]


def relative_difference(before: DepthMap, after: DepthMap) -> FloatMap:
    """(after - before) / before, shape (H, W); NaN where either has no depth."""
    both = (before > 0) & (after > 0)
    safe = np.where(both, before, np.float32(1))
    return np.where(both, (after - safe) / safe, np.float32(np.nan))


def difference_limit(difference: FloatMap) -> float:
    """A round limit that 95 % of the differences stay below; 1, 2 or 5 times 10^n."""
    size = np.abs(difference[np.isfinite(difference)])
    least = float(np.percentile(size, 95)) if size.size else 0.0
    least = min(max(least, _LEAST_DIFFERENCE), 1.0)
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-6))


def colored_difference(difference: FloatMap, limit: float) -> ColorImage:
    """A signed difference in colours: blue nearer, red farther than before."""
    return _colored(
        0.5 + 0.5 * difference / limit, np.isfinite(difference), DIFFERENCE_COLORS
    )


def colored_error(relative_error: FloatMap) -> ColorImage:
    """Relative errors in logarithmic colours, bright = large; NaN = none."""
    low, high = ERROR_RANGE
    size = np.clip(np.abs(relative_error), low, high)
    unit = (np.log(size / low) / math.log(high / low)).astype(np.float32)
    return _colored(unit, np.isfinite(relative_error), ERROR_COLORS)


def color_bar(name: str, width_px: int, height_px: int) -> ColorImage:
    """All colours of a scale from left to right, shape (height_px, width_px, 3)."""
    unit = np.tile(np.linspace(0, 1, width_px, dtype=np.float32), (height_px, 1))
    return _colored(unit, np.ones(unit.shape, np.bool_), name)


def _colored(unit: FloatMap, present: npt.NDArray[np.bool_], name: str) -> ColorImage:
    colors: Any = matplotlib.colormaps[name]
    table = np.rint(255 * colors(np.arange(256))[:, :3]).astype(np.uint8)
    index = np.clip(np.where(present, unit, 0) * 255 + 0.5, 0, 255).astype(np.uint8)
    picture: ColorImage = table[index]
    picture[~present] = HOLE_COLOR
    return picture
