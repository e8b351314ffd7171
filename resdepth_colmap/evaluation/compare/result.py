"""The result of a comparison, as plain values for JSON and tables."""

import dataclasses
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from resdepth_colmap.evaluation.cloud.scores import CloudScores
from resdepth_colmap.evaluation.compare.method_clouds import MethodCloud
from resdepth_colmap.evaluation.compare.methods import REFINED, FoundMethods
from resdepth_colmap.evaluation.compare.view_metrics import MeasuredView
from resdepth_colmap.evaluation.metrics.paired_difference import paired_difference
from resdepth_colmap.evaluation.metrics.view_maps import MEASURES, TileSums
from resdepth_colmap.evaluation.plain import finite_mean, plain
from resdepth_colmap.progress import Progress


class GroundTruth(Protocol):
    """What clouds are scored against."""

    def score(self, points: npt.NDArray[np.float32], progress: Progress) -> CloudScores:
        """Score the points of a cloud, shape (N, 3)."""

    def to_mapping(self) -> dict[str, Any]:
        """Kind and size of the ground truth, ready for JSON."""


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """The compared methods of a workspace.

    Attributes:
        found: The methods.
        clouds: By fuser, then by method.
        scores: Likewise; empty without ground truth.
        settings: The options of each fuser.
        truth: What the clouds were scored against.
        views: The measures of each view.
        notes: What is missing, and what looks wrong.
        seconds: Wall time of the comparison.
    """

    found: FoundMethods
    clouds: dict[str, dict[str, MethodCloud]]
    scores: dict[str, dict[str, CloudScores]]
    settings: dict[str, dict[str, Any]]
    truth: GroundTruth | None
    views: tuple[MeasuredView, ...]
    notes: tuple[str, ...]
    seconds: float

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON; without absolute paths."""
        methods = self.found.methods
        names = [method.name for method in methods]
        return {
            "views": [view.name for view in self.found.views],
            "methods": {method.name: method.to_mapping() for method in methods},
            "notes": list(self.notes),
            "fusion": self.settings,
            "truth": None if self.truth is None else self.truth.to_mapping(),
            "clouds": {
                fuser: {
                    method: {
                        **cloud.to_mapping(),
                        "scores": self._scores(fuser, method),
                    }
                    for method, cloud in clouds.items()
                }
                for fuser, clouds in self.clouds.items()
            },
            "measures": {
                name: {
                    it: plain(finite_mean(_means(self._sums(name, it))))
                    for it in MEASURES
                }
                for name in names
            },
            "paired": {
                f"{REFINED} - {name}": {it: self._paired(name, it) for it in MEASURES}
                for name in names
                if name != REFINED
            },
            "per_view": {
                view.name: {
                    method: {name: plain(it.mean) for name, it in sums.items()}
                    for method, sums in view.sums.items()
                }
                for view in self.views
            },
            "seconds": round(self.seconds, 2),
        }

    def _scores(self, fuser: str, method: str) -> dict[str, Any] | None:
        scores = self.scores.get(fuser, {}).get(method)
        return None if scores is None else scores.to_mapping()

    def _sums(self, method: str, measure: str) -> list[TileSums]:
        """Of the views that have the measure; the same views for every method."""
        sums = (view.sums[method] for view in self.views)
        return [it[measure] for it in sums if measure in it]

    def _paired(self, method: str, measure: str) -> dict[str, Any]:
        """Differences of the views, and of their tiles."""
        pair = [self._sums(name, measure) for name in (REFINED, method)]
        views = (_means(sums) for sums in pair)
        tiles = ([mean for it in sums for mean in it.means] for sums in pair)
        return {
            "views": paired_difference(*views).to_mapping(),
            "tiles": paired_difference(*tiles, resample=False).to_mapping(),
        }


def _means(sums: Sequence[TileSums]) -> list[float]:
    return [it.mean for it in sums]
