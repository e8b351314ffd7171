"""Training samples: the inputs and the ground truth of one view, prepared once.

What does not depend on the crop (warping, filling, correlation) is computed once per
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
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.pipeline.refine.cross_view import FILTERED_SHARE
from resdepth_colmap.pipeline.refine.network_inputs import build_inputs
from resdepth_colmap.pipeline.refine.view import view_tensors
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.data.labelled_views import (
    LabelledView,
    Loaded,
    labelled_views,
    load_views,
)

HOLES_CONSISTENCY = 0.25
"""Photo-consistency above which the copy "with holes" of a map has none."""

DENSE, FILLED, LATER, HOLES = "-dense", "-filled", "-later", "-holes"
"""How the names of samples end: of an unfiltered map; of one compared with the initial
maps of other views; of one compared with their refined maps, as in later outer
iterations; of a filtered map."""

_FORMAT = 8


class Sample(NamedTuple):
    """One view with its initial and its true inverse depth, ready to be cut.

    Attributes:
        inverse_depth: Initial, holes filled, shape (H, W), float32, 1/unit.
        target: True inverse depth, shape (H, W), float32, 1/unit; 0 = unknown.
        valid: Where the initial depth was real, shape (H, W), bool.
        guidance: The channels of `guidance_names`, shape (C, H, W), float16.
        baseline: Distance to the first source, and the value that replaces it in a
            network without sources, shape (2,), float32, units.
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

    An unfiltered map gives three: as it is, compared with the maps of other views, and
    with holes where the photographs contradict it, as a filter would leave it. Every
    map of a view is used; a workspace without any is matched.

    Args:
        scenes: Dense workspaces with `ground_truth/<image>.bin`.
        config: The network that will be trained.
        cache: Folder of the samples; those that exist and are up to date are kept.
        progress: Advances with each workspace.

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
            views = labelled_views(path, progress=progress)
            paths += _prepare_views(views, config.num_sources, folder)
            advance(1.0)
    return paths


def _prepare_views(
    views: Sequence[LabelledView], num_sources: int, folder: Path
) -> list[Path]:
    paths = {
        view: {end: sample_path(view, folder, end) for end in (DENSE, FILLED, HOLES)}
        for view in views
    }
    missing = [view for view in views if not paths[view][HOLES].exists()]
    for view, loaded in load_views(missing, num_sources):
        for end, sample in _samples(loaded, num_sources):
            write_sample(paths[view][end], sample)
    return [path for own in paths.values() for path in own.values() if path.exists()]


def _samples(loaded: Loaded, num_sources: int) -> Iterator[tuple[str, Sample]]:
    """The samples of a view, each with the end of its name, the one with holes last."""
    dense = build_sample(loaded, num_sources, use_maps=False)
    if not is_unfiltered(loaded.inputs.depth):
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


def _with_holes(depth: DepthMap, sample: Sample, num_sources: int) -> DepthMap | None:
    """The map where the photographs do not contradict it; None if little is left."""
    names = guidance_names(num_sources)
    consistency = sample.guidance[names.index("photo_consistency")]
    left = np.where(consistency < HOLES_CONSISTENCY, depth, 0.0).astype(np.float32)
    return left if (left > 0).mean() > 0.05 else None


def samples_folder(cache: Path, num_sources: int) -> Path:
    """Folder of the samples for networks with that number of sources."""
    return cache / f"{num_sources}-sources"


def sample_path(view: LabelledView, folder: Path, end: str, key: str = "") -> Path:
    """Path of a sample of a view; it changes when a file that it is made of does.

    Args:
        view: The view.
        folder: Of `samples_folder`.
        end: How its name ends.
        key: What it depends on besides the view's files.
    """
    image_path = view.workspace.image_path(view.image_name)
    others = view.other_map_paths.values()
    paths = (view.map_path, view.truth_path, image_path, *others)
    states = [(path.stat().st_size, path.stat().st_mtime_ns) for path in paths]
    facts = [_FORMAT, str(view.workspace.path.resolve()), states, key]
    digest = hashlib.sha256(json.dumps(facts).encode()).hexdigest()
    return folder / f"{view.name}-{digest[:10]}{end}.npz"


def is_unfiltered(depth: DepthMap) -> bool:
    """Whether more of a map has a depth than a filter leaves."""
    return bool((depth > 0).mean() >= FILTERED_SHARE)


def build_sample(loaded: Loaded, num_sources: int, use_maps: bool = True) -> Sample:
    """The sample of a view, with or without the maps of other views."""
    tensors = view_tensors(loaded.inputs, torch.device("cpu"), use_maps)
    stack = build_inputs(tensors, _all_channels(num_sources))
    alone = build_inputs(tensors._replace(sources=()), NetworkConfig())
    baselines = [float(stack.baseline), float(alone.baseline)]
    sample = Sample(
        inverse_depth=stack.inverse_depth[0, 0].numpy(),
        target=invert_map(loaded.truth),
        valid=stack.valid[0, 0].numpy(),
        guidance=stack.guidance[0].half().numpy(),
        baseline=np.array(baselines, np.float32),
        K=loaded.inputs.K,
        source_gray=np.zeros((0, 0), np.float16),
        source_K=np.eye(3),
        source_from_reference=np.eye(3, 4),
    )
    for source in loaded.inputs.sources[:1]:
        sample = sample._replace(
            source_gray=source.gray.astype(np.float16),
            source_K=source.K,
            source_from_reference=source.source_from_reference,
        )
    return sample


def _all_channels(num_sources: int) -> NetworkConfig:
    return NetworkConfig(num_sources=num_sources, color=True)


def read_sample(path: Path) -> Sample:
    """Read what `write_sample` wrote."""
    with np.load(path) as arrays:
        return Sample(**{name: arrays[name] for name in Sample._fields})


def write_sample(path: Path, sample: Sample) -> None:
    """Write a sample, whole or not at all."""
    buffer = io.BytesIO()
    np.savez(buffer, **sample._asdict())
    write_whole(path, buffer.getvalue())


@functools.cache
def sample_size(path: Path) -> tuple[int, int]:
    """Height and width of a sample, in pixels, without reading the rest of it."""
    with zipfile.ZipFile(path) as archive, archive.open("target.npy") as file:
        np.lib.format.read_magic(file)
        height_px, width_px = np.lib.format.read_array_header_1_0(file)[0]
    return height_px, width_px
