"""Depth, differences and errors as colours."""

import dataclasses
import math
from typing import NamedTuple, Self

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.scene import ColorImage, DepthMap, FloatMap

HOLE_COLOR = "#c8c8c8"
"""Of what has no value: light, because both ends of the depth colours are dark."""

DEPTH_COLORS = "turbo"
DIFFERENCE_COLORS = "RdBu_r"
ERROR_COLORS = "inferno"
ERROR_RANGE = (0.001, 0.1)
"""Relative errors between which the logarithmic colours of errors run."""

_LEAST_SPREAD = 0.01  # of the inverse depth: a fronto-parallel wall has none


class ColorScale(NamedTuple):
    """The colours that values are shown in, and the text of their bar.

    Attributes:
        norm: From the values to 0..1.
        colors: Name of the colours.
        ticks: Position on the bar, in 0..1, and text of each tick.
        label: What the values are, with their unit.
        hole: What a pixel without a value is.
    """

    norm: Normalize
    colors: str
    ticks: list[tuple[float, str]]
    label: str
    hole: str

    @property
    def mappable(self) -> ScalarMappable:
        """The same for matplotlib."""
        colors = matplotlib.colormaps[self.colors].with_extremes(bad=HOLE_COLOR)
        return ScalarMappable(self.norm, colors)

    def colored(self, values: FloatMap) -> ColorImage:
        """Values as RGB, shape (H, W, 3), uint8; NaN has the colour of holes."""
        return np.asarray(self.mappable.to_rgba(values, bytes=True))[..., :3]


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
                least, most = map(float, np.percentile(inverse, (2, 98)))
                missing = max(0.0, _LEAST_SPREAD * most - (most - least))
                return cls(least=least - missing / 2, most=most + missing / 2)
        return cls(least=0.5, most=1.0)

    @property
    def colors(self) -> ColorScale:
        """The colours of inverse depth, blue far, red near; the bar is in depths."""
        norm, label = Normalize(self.least, self.most), "depth in workspace units"
        return ColorScale(norm, DEPTH_COLORS, self.ticks(), label, "no depth")

    def colored(self, depth: DepthMap) -> ColorImage:
        """A depth map in these colours."""
        inverse = invert_map(depth)
        return self.colors.colored(np.where(inverse > 0, inverse, np.float32(np.nan)))

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
    least = min(max(least, 0.001), 1.0)
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-6))


def difference_scale(difference: FloatMap) -> ColorScale:
    """The colours of signed differences: blue nearer, red farther than before."""
    limit = difference_limit(difference)
    ticks = [(0.0, f"-{100 * limit:g} %"), (0.5, "0"), (1.0, f"+{100 * limit:g} %")]
    norm = Normalize(-limit, limit)
    return ColorScale(norm, DIFFERENCE_COLORS, ticks, "nearer | farther", "was a hole")


def error_scale() -> ColorScale:
    """The colours of relative errors: logarithmic, bright = large."""
    norm, ticks = (
        LogNorm(*ERROR_RANGE, clip=True),
        [(0, "0.1 %"), (0.5, "1 %"), (1, "10 %")],
    )
    label, hole = "error, in percent of the depth", "no depth or no truth"
    return ColorScale(norm, ERROR_COLORS, ticks, label, hole)


def color_table(name: str) -> ColorImage:
    """All colours of a scale from first to last, shape (256, 3), uint8."""
    colors = np.asarray(matplotlib.colormaps[name](np.arange(256)), np.float64)
    return np.rint(255 * colors[:, :3]).astype(np.uint8)
