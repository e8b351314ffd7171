"""The initial depth of a sample: existing, or matched by COLMAP or on the CPU."""

import functools
import re
import time
from collections.abc import Sequence

from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import BackendUnavailableError, ConfigError
from resdepth_colmap.evaluation.datasets.sample import DepthSample, InitialDepth
from resdepth_colmap.evaluation.depth.colmap_pair import match_by_colmap
from resdepth_colmap.evaluation.depth.match_cache import MatchCache, Matching
from resdepth_colmap.matching.patch_match import MatchView, match_view
from resdepth_colmap.pipeline.stereo.warm_up import warm_up

ORIGINS = {
    StereoBackend.CPU: "our PatchMatch (CPU)",
    StereoBackend.COLMAP: "COLMAP's PatchMatch (CUDA), unfiltered",
}
_UNSAFE = re.compile(r"[^\w.-]+", re.ASCII)


def matching_backend(requested: StereoBackend) -> StereoBackend:
    """The matcher: COLMAP where pycolmap has CUDA, else the CPU.

    Raises:
        ConfigError: If existing maps are requested: the scenes have none.
        BackendUnavailableError: If COLMAP is requested and has no CUDA.
    """
    if requested is StereoBackend.EXISTING:
        raise ConfigError(
            "--stereo existing: the scenes have no depth maps to compare; use auto, "
            "cpu or colmap, or evaluate depth on a workspace that has maps."
        )
    if requested is StereoBackend.CPU:
        return StereoBackend.CPU
    import pycolmap

    if pycolmap.has_cuda:
        return StereoBackend.COLMAP
    if requested is StereoBackend.COLMAP:
        raise BackendUnavailableError(
            "COLMAP's PatchMatch needs CUDA, and this pycolmap has none; use "
            "--stereo cpu, or install pycolmap-cuda12 on a machine with an NVIDIA GPU."
        )
    return StereoBackend.CPU


def initial_depth(
    scene: str,
    sample: DepthSample,
    backend: StereoBackend,
    config: StereoConfig,
    cache: MatchCache | None = None,
) -> InitialDepth:
    """The depth that the refinement of a sample starts from: existing or matched.

    `scene` is the name of its scene, for the file in the cache.
    """
    if sample.initial is not None:
        return sample.initial
    views = (sample.reference, *sample.sources)
    name = cache_name(scene, sample.name, backend)
    match = functools.partial(_match, views, sample.depth_range, backend, config)
    if cache is None:
        found = match()
    else:
        found = cache.get(name, views, sample.depth_range, config, match)
    return InitialDepth(
        depth=found.depth,
        origin=ORIGINS[backend],
        cpu_s=found.cpu_s or None,
        source_depths=found.source_depths,
    )


def cache_name(scene: str, sample: str, backend: StereoBackend) -> str:
    """The start of the name of the file of a sample in the cache."""
    return _UNSAFE.sub("_", f"{scene}-{sample}-{backend}")


def _match(
    views: Sequence[MatchView],
    depth_range: tuple[float, float],
    backend: StereoBackend,
    config: StereoConfig,
) -> Matching:
    if backend is StereoBackend.COLMAP:
        depth = match_by_colmap(views, depth_range, config)
        return Matching(depth=depth, cpu_s=0.0)  # it ran on the GPU
    _compile()
    return _match_here(views, depth_range, config)


def _match_here(
    views: Sequence[MatchView], depth_range: tuple[float, float], config: StereoConfig
) -> Matching:
    """Match the first view, in both passes unless `geom_consistency` is off."""
    # The seconds leave out the photometric maps of the sources, which the geometric
    # pass and the refinement use: in a workspace each of them is matched once.
    start = time.process_time()
    found = match_view(views[0], views[1:], depth_range, config)
    cpu_s = time.process_time() - start
    source_depths = []
    for index in range(1, len(views)):
        others = [*views[:index], *views[index + 1 :]]
        source = match_view(views[index], others, depth_range, config)
        source_depths.append(source.depth)
    if config.geom_consistency:
        start = time.process_time()
        found = match_view(
            *(views[0], views[1:], depth_range, config),
            start=found,
            source_depths=source_depths,
        )
        cpu_s += time.process_time() - start
    return Matching(depth=found.depth, cpu_s=cpu_s, source_depths=tuple(source_depths))


@functools.cache
def _compile() -> None:
    """Compile the matcher once, outside of the measured time."""
    warm_up(StereoConfig(filter=False))
