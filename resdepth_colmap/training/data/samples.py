"""Training samples: what the network may see of a view, ready to be cut.

What does not depend on the crop (warping, filling, correlation) is done once for each
view and kept in a cache folder. A sample holds the channels of all variants.
"""

import dataclasses
import functools
import hashlib
import io
import json
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from resdepth_colmap.io.files import write_whole
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.pipeline.refine.cross_view import FILTERED_SHARE
from resdepth_colmap.pipeline.refine.network_inputs import build_inputs
from resdepth_colmap.pipeline.refine.view import ViewInputs, view_tensors
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.data.labelled_views import (
    LabelledView,
    Loaded,
    labelled_views,
)

HOLES_CONSISTENCY = 0.25
"""Photo-consistency above which the copy "with holes" of a map has none."""

DENSE, FILLED, LATER, HOLES = "-dense", "-filled", "-later", "-holes"
"""How the names of samples end: of a map without holes, of one that the maps of other
views have been compared with, of one that their refined maps have been, and of a map
with holes."""

_FORMAT = 8


class Sample(NamedTuple):
    """One view with its initial and its true inverse depth, ready to be cut.

    Attributes:
        inverse_depth: Initial, holes filled, shape (H, W), float32, 1/unit.
        target: True inverse depth, shape (H, W), float32, 1/unit; 0 = unknown.
        valid: Where the initial depth was real, shape (H, W), bool.
        guidance: The channels of `guidance_names`, shape (C, H, W), float16.
        baseline: Distance to the first source, and what is taken for it by a network
            that sees no source, shape (2,), float32, units.
        K: K of the view for index coordinates, shape (3, 3), float64, in pixels.
        source_gray: The first source, in 0..1, shape (Hs, Ws), float16; without pixels
            where there is none.
        source_K: Its K, likewise.
        source_from_reference: Its pose, shape (3, 4), float64, translation in units.
    """

    inverse_depth: NDArray[np.float32]
    target: NDArray[np.float32]
    valid: NDArray[np.bool_]
    guidance: NDArray[np.float16]
    baseline: NDArray[np.float32]
    K: NDArray[np.float64]
    source_gray: NDArray[np.float16]
    source_K: NDArray[np.float64]  # noqa: N815 (K is mathematics)
    source_from_reference: NDArray[np.float64]


def guidance_names(num_sources: int) -> tuple[str, ...]:
    """Names of the channels in a sample, in order."""
    return _all_channels(num_sources).channels[1:]


def prepare_samples(
    scenes: Sequence[Path],
    config: NetworkConfig,
    cache: Path,
    progress: Progress | None = None,
) -> list[Path]:
    """Build the samples of all views that have a depth map and a ground truth.

    A map without holes gives three: as it is, compared with the maps of other views,
    and with holes where the photographs contradict it, as a filter would leave it.
    Every map that is there is used, unfiltered and filtered; a workspace without any is
    matched.

    Args:
        scenes: Dense workspaces with `ground_truth/<image>.bin`.
        config: The network that will be trained.
        cache: Folder of the samples; those that are there and up to date are kept.
        progress: Is told of each workspace.

    Returns:
        Paths of all samples, in the order of the workspaces; maybe none.

    Raises:
        WorkspaceError: If a workspace is broken, or cannot be matched.
    """
    progress = progress or SilentProgress()
    folder = samples_folder(cache, config.num_sources)
    paths: list[Path] = []
    with progress.stage("Preparing samples", len(scenes)) as advance:
        for path in scenes:
            for view in labelled_views(path, progress=progress):
                paths += _prepare_view(view, config.num_sources, folder)
            advance(1.0)
    return paths


def samples_folder(cache: Path, num_sources: int) -> Path:
    """Where the samples for networks with so many sources lie."""
    return cache / f"{num_sources}-sources"


def sample_path(view: LabelledView, folder: Path, end: str, key: str = "") -> Path:
    """Where a sample of a view lies: the name changes when what it is made of does.

    Args:
        view: The view.
        folder: Of `samples_folder`.
        end: How its name ends.
        key: What else it is made of than the view's files.
    """
    return folder / f"{view.name}-{_fingerprint(view, key)}{end}.npz"


def is_whole(depth: DepthMap) -> bool:
    """Whether so much of a map is filled that no filter can have been at it."""
    return bool((depth > 0).mean() >= FILTERED_SHARE)


def build_sample(loaded: Loaded, num_sources: int, use_maps: bool = True) -> Sample:
    """The sample of a view, with or without a look at the maps of other views."""
    tensors = view_tensors(loaded.inputs, torch.device("cpu"), use_maps)
    stack = build_inputs(tensors, _all_channels(num_sources))
    alone = build_inputs(tensors._replace(sources=()), NetworkConfig())
    known = loaded.truth > 0
    target = np.where(known, 1.0 / np.where(known, loaded.truth, 1.0), 0.0)
    baselines = [float(stack.baseline), float(alone.baseline)]
    return Sample(
        inverse_depth=stack.inverse_depth[0, 0].numpy(),
        target=target.astype(np.float32),
        valid=stack.valid[0, 0].numpy(),
        guidance=stack.guidance[0].half().numpy(),
        baseline=np.array(baselines, np.float32),
        K=loaded.inputs.K,
        **_first_source(loaded.inputs),
    )


def _first_source(view: ViewInputs) -> dict[str, NDArray[Any]]:
    if not view.sources:
        return {
            "source_gray": np.zeros((0, 0), np.float16),
            "source_K": np.eye(3),
            "source_from_reference": np.eye(3, 4),
        }
    source = view.sources[0]
    return {
        "source_gray": source.gray.astype(np.float16),
        "source_K": source.K,
        "source_from_reference": source.source_from_reference,
    }


def _all_channels(num_sources: int) -> NetworkConfig:
    return NetworkConfig(num_sources=num_sources, color=True)


def read_sample(path: Path) -> Sample:
    """Read what `prepare_samples` wrote."""
    with np.load(path) as arrays:
        return Sample(**{name: arrays[name] for name in Sample._fields})


@functools.cache
def sample_size(path: Path) -> tuple[int, int]:
    """Height and width of a sample, in pixels, without reading the rest of it."""
    with zipfile.ZipFile(path) as archive, archive.open("target.npy") as file:
        np.lib.format.read_magic(file)
        height_px, width_px = np.lib.format.read_array_header_1_0(file)[0]
    return height_px, width_px


def _prepare_view(view: LabelledView, num_sources: int, folder: Path) -> list[Path]:
    ends = (DENSE, FILLED, HOLES)
    paths = {end: sample_path(view, folder, end) for end in ends}
    if not paths[HOLES].exists():  # written last
        loaded = view.load(num_sources)
        for end, sample in _samples(loaded, num_sources) if loaded else ():
            write_sample(paths[end], sample)
    return [path for path in paths.values() if path.exists()]


def _samples(loaded: Loaded, num_sources: int) -> Iterator[tuple[str, Sample]]:
    """The samples of a view, each with the end of its name, the one with holes last."""
    dense = build_sample(loaded, num_sources, use_maps=False)
    if not is_whole(loaded.inputs.depth):
        yield HOLES, build_sample(loaded, num_sources)
        return
    yield DENSE, dense
    if loaded.inputs.source_maps:
        yield FILLED, build_sample(loaded, num_sources)
    depth = _with_holes(loaded.inputs.depth, dense, num_sources)
    if depth is not None:
        # The maps of other views would have to be filtered like it.
        inputs = dataclasses.replace(loaded.inputs, depth=depth, source_maps=())
        yield HOLES, build_sample(loaded._replace(inputs=inputs), num_sources)


def _fingerprint(view: LabelledView, key: str) -> str:
    """Changes when a file that the sample depends on does."""
    image_path = view.workspace.image_path(view.image_name)
    others = view.other_map_paths.values()
    paths = (view.map_path, view.truth_path, image_path, *others)
    states = [(path.stat().st_size, path.stat().st_mtime_ns) for path in paths]
    facts = [_FORMAT, str(view.workspace.path.resolve()), states, *([key] * bool(key))]
    return hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:10]


def _with_holes(depth: DepthMap, sample: Sample, num_sources: int) -> DepthMap | None:
    """The map without what the photographs contradict; None if little would be left."""
    names = guidance_names(num_sources)
    consistency = sample.guidance[names.index("photo_consistency")]
    kept = np.where(consistency < HOLES_CONSISTENCY, depth, 0.0).astype(np.float32)
    return kept if (kept > 0).mean() > 0.05 else None


def write_sample(path: Path, sample: Sample) -> None:
    """Write what `read_sample` reads, whole or not at all."""
    buffer = io.BytesIO()
    np.savez(buffer, **sample._asdict())
    write_whole(path, buffer.getvalue())
