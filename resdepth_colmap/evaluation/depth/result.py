"""The result of an evaluation of depth maps, scene by scene and overall."""

import dataclasses
import datetime
import math
from collections.abc import Mapping, Sequence
from typing import Any

from resdepth_colmap.config import RefineConfig, StereoConfig
from resdepth_colmap.evaluation.depth.methods import METHODS, REGIONS, SampleResult
from resdepth_colmap.evaluation.metrics.depth_metrics import DepthMetrics
from resdepth_colmap.evaluation.metrics.pooled_metrics import PooledErrors, pooled

Errors = Mapping[str, Mapping[str, PooledErrors]]
"""By region, then by method."""

_REFINE_OPTIONS = (
    "inner_iterations",
    "outer_iterations",
    "update_gating",
    "tile_px",
    "overlap_px",
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneResult:
    """The errors of one scene.

    Attributes:
        name: Name of the scene.
        samples: The results of its samples.
    """

    name: str
    samples: tuple[SampleResult, ...]

    @property
    def errors(self) -> Errors:
        """Over the pixels of all views."""
        return pooled_errors([sample.errors for sample in self.samples])

    @property
    def mae_ratio(self) -> float:
        """Mean absolute error, refined over unfiltered; NaN if that is 0."""
        return self._ratio("mae")

    @property
    def medae_ratio(self) -> float:
        """Median absolute error, refined over unfiltered; NaN if that is 0."""
        return self._ratio("medae")

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        mapping: dict[str, Any] = {
            "initial": sorted({sample.origin for sample in self.samples}),
            "num_views": len(self.samples),
            "view_names": [sample.name for sample in self.samples],
            **plain_errors(self.errors),
        }
        if all(sample.seen is not None for sample in self.samples):
            mapping["unfiltered_seen_by_both"] = self._seen()
        mapping |= {
            "matching_cpu_s_per_mp": self._per_megapixel("matching_cpu_s"),
            "refining_cpu_s_per_mp": self._per_megapixel("refining_cpu_s"),
            "mae_ratio": plain(self.mae_ratio),
            "medae_ratio": plain(self.medae_ratio),
        }
        if len(self.samples) > 1:
            mapping["views"] = {
                sample.name: {"initial": sample.origin, **plain_errors(sample.errors)}
                for sample in self.samples
            }
        return mapping

    def _ratio(self, error: str) -> float:
        methods = self.errors["all"]
        refined, unfiltered = (
            float(getattr(methods[method].metrics, error))
            for method in ("refined", "unfiltered")
        )
        return refined / unfiltered if unfiltered else math.nan

    def _seen(self) -> dict[str, float | int | None]:
        samples = [sample.seen for sample in self.samples if sample.seen is not None]
        medians = [sample.seen_median_relative_error for sample in self.samples]
        finite = [m for m in medians if m is not None and math.isfinite(m)]
        return {
            **plain_metrics(pooled(samples).metrics),
            "median_relative_error": plain(_mean(finite)),
        }

    def _per_megapixel(self, name: str) -> float | None:
        timed = [it for it in self.samples if getattr(it, name) is not None]
        megapixels = sum(sample.megapixels for sample in timed)
        if not megapixels:
            return None
        seconds = sum(float(getattr(sample, name)) for sample in timed)
        return round(seconds / megapixels, 2)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthReport:
    """The result of an evaluation, and its options.

    Attributes:
        date: Day of the measurement.
        weights_sha256: Hash of the weights file.
        refine: Options of the refinement.
        stereo: Options of the matcher.
        max_residual: Larger errors were discarded, in units; None = no limit.
        versions: Of Python and the main packages.
        scenes: The results of the scenes.
        failed: The reasons for scenes without a result, by name.
    """

    date: datetime.date
    weights_sha256: str
    refine: RefineConfig
    stereo: StereoConfig
    max_residual: float | None
    versions: Mapping[str, str]
    scenes: tuple[SceneResult, ...]
    failed: Mapping[str, str]

    @property
    def errors(self) -> Errors | None:
        """Over the pixels of all scenes; None without any."""
        if not self.scenes:
            return None
        return pooled_errors([scene.errors for scene in self.scenes])

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON; without absolute paths."""
        refine = self.refine.to_mapping()
        errors = self.errors
        return {
            "date": self.date.isoformat(),
            "weights_sha256": self.weights_sha256,
            "options": {
                "refine": {name: refine[name] for name in _REFINE_OPTIONS},
                "stereo": self.stereo.to_mapping(),
                "max_residual": self.max_residual,
            },
            "versions": dict(self.versions),
            "scenes": {scene.name: scene.to_mapping() for scene in self.scenes},
            "overall": None if errors is None else plain_errors(errors),
            "mean": {
                "mae_ratio": plain(_mean([s.mae_ratio for s in self.scenes])),
                "medae_ratio": plain(_mean([s.medae_ratio for s in self.scenes])),
            },
            "failed": dict(self.failed),
        }


def pooled_errors(errors: Sequence[Errors]) -> Errors:
    """The errors over all pixels of several results, by region and method."""
    return {
        region: {
            method: pooled([it[region][method] for it in errors]) for method in METHODS
        }
        for region in REGIONS
    }


def plain_errors(errors: Errors) -> dict[str, Any]:
    """For JSON: the methods over the full map, and those of each region."""
    by_region = {
        region: {method: plain_metrics(methods[method].metrics) for method in METHODS}
        for region, methods in errors.items()
    }
    return {**by_region["all"], **{r: by_region[r] for r in REGIONS if r != "all"}}


def plain_metrics(metrics: DepthMetrics) -> dict[str, float | int | None]:
    """For JSON: six digits, None for NaN."""
    values = metrics.to_mapping()
    return {k: v if v is None else round(v, 6) for k, v in values.items()}


def plain(value: float) -> float | None:
    """For JSON: six digits, None for NaN."""
    return None if math.isnan(value) else round(value, 6)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else float("nan")
