"""Our matcher and our network on the two-view scenes of the Middlebury benchmark.

The protocol is the paper's: unfiltered depth, a 5 x 5 median of it, and refined depth
against the truth, residuals beyond 10 m discarded. Each scene is a dense workspace of
two views (see data/README.md).
"""

import dataclasses
import datetime
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from resdepth_colmap.config import RefineConfig, StereoConfig
from resdepth_colmap.evaluation.depth_metrics import (
    DepthMetrics,
    depth_metrics,
    median_filtered,
)
from resdepth_colmap.evaluation.match_cache import MatchCache, Matching
from resdepth_colmap.evaluation.stereo_pair import StereoPair, read_pair, scene_folders
from resdepth_colmap.matching.patch_match import MatchView, match_view
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.refine import SourceView, ViewInputs, refine_view
from resdepth_colmap.pipeline.versions import versions

_WARM_UP_PX = 32

_OPTIONS = ("passes", "keep_confirmed", "tile_px", "overlap_px")


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneResult:
    """What was measured on one scene.

    Attributes:
        name: Its folder's name.
        unfiltered: Errors of the matcher's depth, in metres.
        median: Errors of its 5 x 5 median.
        refined: Errors of the refined depth.
        seen: Errors of the matcher's depth where both views see the surface.
        seen_median_relative_error: Median there of error over true depth.
        matching_cpu_s_per_mp: Processor seconds of all threads, a million pixels.
        refining_cpu_s_per_mp: Likewise, of all passes.
    """

    name: str
    unfiltered: DepthMetrics
    median: DepthMetrics
    refined: DepthMetrics
    seen: DepthMetrics
    seen_median_relative_error: float
    matching_cpu_s_per_mp: float
    refining_cpu_s_per_mp: float

    @property
    def mae_ratio(self) -> float:
        """Mean absolute error, refined over unfiltered; NaN if that is 0."""
        return _ratio(self.refined.mae, self.unfiltered.mae)

    @property
    def medae_ratio(self) -> float:
        """Median absolute error, refined over unfiltered; NaN if that is 0."""
        return _ratio(self.refined.medae, self.unfiltered.medae)

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        seen_error = _plain(self.seen_median_relative_error)
        return {
            "unfiltered": _plain_metrics(self.unfiltered),
            "median": _plain_metrics(self.median),
            "refined": _plain_metrics(self.refined),
            "unfiltered_seen_by_both": {
                **_plain_metrics(self.seen),
                "median_relative_error": seen_error,
            },
            "matching_cpu_s_per_mp": round(self.matching_cpu_s_per_mp, 2),
            "refining_cpu_s_per_mp": round(self.refining_cpu_s_per_mp, 2),
            "mae_ratio": _plain(self.mae_ratio),
            "medae_ratio": _plain(self.medae_ratio),
        }


@dataclasses.dataclass(frozen=True, kw_only=True)
class MiddleburyReport:
    """The benchmark's result, and what it was measured with.

    Attributes:
        date: Day of the measurement.
        weights_sha256: Hash of the weights file.
        refine: Options of the refinement.
        stereo: Options of the matcher.
        versions: Of Python and the packages that matter.
        scenes: One result a scene, by name.
    """

    date: datetime.date
    weights_sha256: str
    refine: RefineConfig
    stereo: StereoConfig
    versions: dict[str, str]
    scenes: tuple[SceneResult, ...]

    def to_mapping(self) -> dict[str, Any]:
        """Plain values, ready for JSON; no path of this machine among them."""
        refine = self.refine.to_mapping()
        return {
            "date": self.date.isoformat(),
            "weights_sha256": self.weights_sha256,
            "options": {
                "refine": {name: refine[name] for name in _OPTIONS},
                "stereo": self.stereo.to_mapping(),
            },
            "versions": self.versions,
            "scenes": {scene.name: scene.to_mapping() for scene in self.scenes},
            "mean": {
                "mae_ratio": _plain(_mean([s.mae_ratio for s in self.scenes])),
                "medae_ratio": _plain(_mean([s.medae_ratio for s in self.scenes])),
            },
        }


def measure_middlebury(
    folder: Path,
    refine: RefineConfig | None = None,
    stereo: StereoConfig | None = None,
    *,
    cache: MatchCache | None = None,
    on_scene: Callable[[SceneResult], None] | None = None,
) -> MiddleburyReport:
    """Match and refine every scene of the benchmark, on the CPU.

    Args:
        folder: Holds one folder a scene.
        refine: Weights, passes and tiles; None = the defaults. Its device is not used.
        stereo: Options of the matcher; None = the defaults.
        cache: Where matched depth is kept from one measurement to the next.
        on_scene: Told of each scene as it is done.

    Raises:
        WorkspaceError: If there is no scene, or one is broken.
        WeightsError: If the weights cannot be read.
    """
    refine, stereo = refine or RefineConfig(), stereo or StereoConfig()
    network = load_weights(refine.weights)
    paths = scene_folders(folder)
    _warm_up(network, refine)
    results = []
    for path in paths:
        pair = read_pair(path)
        matching = match_pair(pair, stereo, cache)
        results.append(measure_pair(pair, matching, network, refine))
        if on_scene:
            on_scene(results[-1])
    return MiddleburyReport(
        date=datetime.datetime.now(datetime.UTC).date(),
        weights_sha256=weights_hash(refine.weights),
        refine=refine,
        stereo=stereo,
        versions=versions(),
        scenes=tuple(results),
    )


def match_pair(
    pair: StereoPair, config: StereoConfig, cache: MatchCache | None = None
) -> Matching:
    """Depth of the reference by our PatchMatch, and the processor time it took."""
    views = (pair.reference, pair.source)
    kept = cache.find(pair.name, views, pair.depth_range, config) if cache else None
    if kept is not None:
        return kept
    start = time.process_time()
    result = match_view(pair.reference, [pair.source], pair.depth_range, config)
    matching = Matching(depth=result.depth, cpu_s=time.process_time() - start)
    if cache:
        cache.add(pair.name, views, pair.depth_range, config, matching)
    return matching


def measure_pair(
    pair: StereoPair, matching: Matching, network: ResDepthNet, config: RefineConfig
) -> SceneResult:
    """Refine matched depth, and compare what there is with the truth."""
    depth, truth = matching.depth, pair.truth
    view = ViewInputs(
        depth=depth,
        gray=pair.reference.gray,
        K=pair.reference.K,
        sources=(
            SourceView(
                gray=pair.source.gray,
                K=pair.source.K,
                source_from_reference=pair.source_from_reference,
            ),
        ),
    )
    start = time.process_time()
    refined = refine_view(view, network, config).depth
    refining_cpu_s = time.process_time() - start
    seen = pair.seen & (truth > 0)
    relative_error = np.abs(depth[seen] - truth[seen]) / truth[seen]
    return SceneResult(
        name=pair.name,
        unfiltered=depth_metrics(depth, truth),
        median=depth_metrics(median_filtered(depth), truth),
        refined=depth_metrics(refined, truth),
        seen=depth_metrics(depth, truth, region=pair.seen),
        seen_median_relative_error=_median(relative_error),
        matching_cpu_s_per_mp=matching.cpu_s / pair.megapixels,
        refining_cpu_s_per_mp=refining_cpu_s / pair.megapixels,
    )


def _warm_up(network: ResDepthNet, config: RefineConfig) -> None:
    """Match and refine a tiny pair: compiling and first calls are not measured."""
    size = _WARM_UP_PX
    gray = np.random.default_rng(0).random((size, size), dtype=np.float32)
    K = np.array([[size, 0, size / 2], [0, size, size / 2], [0, 0, 1.0]])
    left, right = np.eye(3, 4), np.eye(3, 4)
    right[0, 3] = -0.1
    views = [MatchView(gray=gray, K=K, cam_from_world=pose) for pose in (left, right)]
    pair = StereoPair(
        name="warm-up",
        reference=views[0],
        source=views[1],
        source_from_reference=right,
        depth_range=(1.0, 2.0),
        truth=np.ones_like(gray),
        seen=np.ones(gray.shape, np.bool_),
    )
    matching = match_pair(pair, StereoConfig(num_iterations=1))
    measure_pair(pair, matching, network, config)


def _ratio(value: float, reference: float) -> float:
    return value / reference if reference else float("nan")


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _median(values: npt.NDArray[np.float32]) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else round(value, 6)


def _plain_metrics(metrics: DepthMetrics) -> dict[str, float | int | None]:
    values = metrics.to_mapping()
    return {k: v if v is None else round(v, 6) for k, v in values.items()}
