"""Depth maps against ground truth, scene by scene; a broken scene stops no other."""

import dataclasses
import datetime
import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.errors import ResDepthError, WorkspaceError
from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL
from resdepth_colmap.evaluation.datasets.sample import (
    SampleOptions,
    SceneSource,
)
from resdepth_colmap.evaluation.depth.match_cache import MatchCache
from resdepth_colmap.evaluation.depth.methods import measure_sample
from resdepth_colmap.evaluation.depth.result import DepthReport, SceneResult
from resdepth_colmap.evaluation.depth.sample_matching import (
    initial_depth,
    matching_backend,
)
from resdepth_colmap.network.device import resolve_device
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs, refine_view
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.versions import hardware, versions

_WARM_UP_PX = 32
_REFINE_OPTIONS = (
    *("inner_iterations", "outer_iterations", "update_gating"),
    *("tile_px", "overlap_px"),
)

logger = logging.getLogger(__name__)


@dataclasses.dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """How depth maps are matched, refined and compared.

    Attributes:
        refine: Options of the refinement.
        stereo: Options of the matcher, for samples without depth.
        backend: The matcher: auto, COLMAP (CUDA) or the CPU.
        cache: Keeps matched depth from run to run; None = no cache.
        max_residual: Larger errors, in units, are discarded; None = no limit.
    """

    refine: RefineConfig = dataclasses.field(default_factory=RefineConfig)
    stereo: StereoConfig = dataclasses.field(default_factory=StereoConfig)
    backend: StereoBackend = StereoBackend.CPU
    cache: MatchCache | None = None
    max_residual: float | None = PAPER_MAX_RESIDUAL


def evaluate_scenes(
    sources: Sequence[SceneSource],
    options: EvaluationOptions,
    on_failure: Callable[[str, str], None] | None = None,
    progress: Progress | None = None,
) -> DepthReport:
    """Evaluate every scene that can be read.

    Args:
        sources: The scenes.
        options: How depth maps are matched, refined and compared.
        on_failure: Called with the name of a broken scene and the reason.
        progress: Reports the progress, as one stage.

    Raises:
        WeightsError: If the weights cannot be read.
        BackendUnavailableError: If the requested device or matcher is not available.
    """
    progress = progress or SilentProgress()
    backend = matching_backend(options.backend)
    device = resolve_device(options.refine.device)
    network = for_inference(load_weights(options.refine.weights, device))
    _warm_up(network, options.refine)
    results, failed = [], {}
    with progress.stage("Evaluating", len(sources)) as advance:
        for source in sources:
            try:
                result = _measure_scene(source, network, options, backend, advance)
            except ResDepthError as error:
                failed[source.name] = " ".join(str(error).split())
                if on_failure:
                    on_failure(source.name, failed[source.name])
            else:
                results.append(result)
    return DepthReport(about=_about(options), scenes=tuple(results), failed=failed)


def _about(options: EvaluationOptions) -> dict[str, Any]:
    refine = options.refine.to_mapping()
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "weights_sha256": weights_hash(options.refine.weights),
        "options": {
            "refine": {name: refine[name] for name in _REFINE_OPTIONS},
            "stereo": options.stereo.to_mapping(),
            "max_residual": options.max_residual,
        },
        "hardware": hardware(),
        "versions": versions(),
    }


def _measure_scene(
    source: SceneSource,
    network: ResDepthNet,
    options: EvaluationOptions,
    backend: StereoBackend,
    on_share: Callable[[float], None],
) -> SceneResult:
    num_sources = max(1, network.config.num_sources)
    lazy = source.read(SampleOptions(stereo=options.stereo, num_sources=num_sources))
    results = []
    for read_sample in lazy:
        sample = read_sample()
        logger.debug("%s: %s", source.name, sample.name)
        initial = initial_depth(
            source.name, sample, backend, options.stereo, options.cache
        )
        if not (initial.depth > 0).any():
            raise WorkspaceError(f"{sample.name}: no pixel has an initial depth.")
        results.append(
            measure_sample(
                sample, initial, network, options.refine, options.max_residual
            )
        )
        on_share(1 / len(lazy))
    return SceneResult(name=source.name, samples=tuple(results))


def _warm_up(network: ResDepthNet, config: RefineConfig) -> None:
    """Refine a tiny view: the first call is slower."""
    size = _WARM_UP_PX
    gray = np.random.default_rng(0).random((size, size), dtype=np.float32)
    K = np.array([[size, 0, size / 2], [0, size, size / 2], [0, 0, 1.0]])
    right = np.eye(3, 4)
    right[0, 3] = -0.1
    source = SourceView(gray=gray, K=K, source_from_reference=right)
    depth = np.ones_like(gray)
    inputs = ViewInputs(depth=depth, gray=gray, K=K, sources=(source,))
    refine_view(inputs, network, config)
