"""The result of an evaluation of depth maps, scene by scene and overall."""

import dataclasses
import math
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from resdepth_colmap.evaluation.depth.methods import METHODS, REGIONS, SampleResult
from resdepth_colmap.evaluation.metrics.pooled_metrics import PooledErrors, pooled
from resdepth_colmap.evaluation.plain import finite_mean, plain

Errors = Mapping[str, Mapping[str, PooledErrors]]
"""By region, then by method."""


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
        return _pooled_errors([sample.errors for sample in self.samples])

    def ratio(self, error: str) -> float:
        """An error, "mae" or "medae", refined over unfiltered; NaN if that is 0."""
        methods = self.errors["all"]
        refined, unfiltered = (
            float(getattr(methods[method].metrics, error))
            for method in ("refined", "unfiltered")
        )
        return refined / unfiltered if unfiltered else math.nan

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        mapping = {
            "initial": sorted({sample.origin for sample in self.samples}),
            "num_views": len(self.samples),
            "view_names": [sample.name for sample in self.samples],
            **_by_name(self.errors),
            **self._seen(),
            "matching_cpu_s_per_mp": self._per_megapixel("matching_cpu_s"),
            "refining_cpu_s_per_mp": self._per_megapixel("refining_cpu_s"),
            "mae_ratio": self.ratio("mae"),
            "medae_ratio": self.ratio("medae"),
        }
        if len(self.samples) > 1:
            mapping["views"] = {
                sample.name: {"initial": sample.origin, **_by_name(sample.errors)}
                for sample in self.samples
            }
        return dict(plain(mapping))

    def _seen(self) -> dict[str, Any]:
        seen = [sample.seen for sample in self.samples if sample.seen is not None]
        if len(seen) < len(self.samples):
            return {}
        medians = [sample.seen_median_relative_error for sample in self.samples]
        median = finite_mean(it for it in medians if it is not None)
        errors = {**pooled(seen).metrics.to_mapping(), "median_relative_error": median}
        return {"unfiltered_seen_by_both": errors}

    def _per_megapixel(self, name: str) -> float | None:
        timed = [it for it in self.samples if getattr(it, name) is not None]
        megapixels = sum(sample.megapixels for sample in timed)
        if not megapixels:
            return None
        seconds = sum(float(getattr(sample, name)) for sample in timed)
        return round(seconds / megapixels, 2)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DepthReport:
    """The result of an evaluation.

    Attributes:
        about: Date, weights, options, hardware and versions, ready for JSON.
        scenes: The results of the scenes.
        failed: The reasons for scenes without a result, by name.
    """

    about: Mapping[str, Any]
    scenes: tuple[SceneResult, ...]
    failed: Mapping[str, str]

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON; without absolute paths."""
        errors = [scene.errors for scene in self.scenes]
        ratios = {
            f"{error}_ratio": [scene.ratio(error) for scene in self.scenes]
            for error in ("mae", "medae")
        }
        return {
            **self.about,
            "scenes": {scene.name: scene.to_mapping() for scene in self.scenes},
            "overall": plain(_by_name(_pooled_errors(errors))) if errors else None,
            "mean": {
                name: plain(statistics.fmean(values)) if values else None
                for name, values in ratios.items()
            },
            "failed": dict(self.failed),
        }


def _pooled_errors(errors: Sequence[Errors]) -> Errors:
    """The errors over all pixels of several results, by region and method."""
    return {
        region: {
            method: pooled([it[region][method] for it in errors]) for method in METHODS
        }
        for region in REGIONS
    }


def _by_name(errors: Errors) -> dict[str, Any]:
    """The errors over all pixels by method, and beside them those of each region."""
    named = {
        region: {method: it.metrics.to_mapping() for method, it in methods.items()}
        for region, methods in errors.items()
    }
    return {**named.pop("all"), **named}
