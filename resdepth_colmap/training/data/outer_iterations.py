"""Samples of later outer iterations: compared with the refined maps of other views."""

import collections
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.network.inference import for_inference
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, weights_hash
from resdepth_colmap.pipeline.refine.view import ViewInputs, refine_view
from resdepth_colmap.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap
from resdepth_colmap.training.data.labelled_views import (
    LabelledView,
    Loaded,
    labelled_views,
    load_views,
)
from resdepth_colmap.training.data.samples import (
    LATER,
    build_sample,
    is_unfiltered,
    sample_path,
    samples_folder,
    write_sample,
)


def prepare_later_iterations(
    scenes: Sequence[Path],
    config: NetworkConfig,
    cache: Path,
    weights: Path,
    num_iterations: int,
    progress: Progress | None = None,
) -> list[Path]:
    """Build the samples of the second and of later outer iterations.

    Each unfiltered map of a view is compared with those of its other views after the
    weights have refined these, once for the second iteration, twice for the third. A
    view whose other views have no ground truth has no such sample.

    Args:
        scenes: Workspaces after `prepare_samples`.
        config: The network that will be trained.
        cache: Folder of the samples; those that exist and are up to date are kept.
        weights: Weights that refine the maps of the other views.
        num_iterations: Outer iterations in all.
        progress: Advances with each workspace.

    Returns:
        Paths of the samples, in the order of the workspaces; maybe none.

    Raises:
        WorkspaceError: If a workspace is broken.
        WeightsError: If the weights cannot be read.
    """
    progress = progress or SilentProgress()
    network = for_inference(load_weights(weights))
    folder = samples_folder(cache, config.num_sources)
    key = weights_hash(weights)
    keys = [f"{key} {index}" for index in range(2, num_iterations + 1)]
    found: list[Path] = []
    with progress.stage("Refining other views", len(scenes)) as advance:
        for scene in scenes:
            kinds = collections.defaultdict(list)
            for view in labelled_views(scene):
                kinds[view.kind].append(view)
            for views in kinds.values():
                paths = [
                    {view: sample_path(view, folder, LATER, key) for view in views}
                    for key in keys
                ]
                wanted = [path for each in paths for path in each.values()]
                if len(views) > 1 and not all(path.exists() for path in wanted):
                    _write_samples(views, config.num_sources, network, paths)
                found += [path for path in wanted if path.exists()]
            advance(1.0)
    return found


def _write_samples(
    views: Sequence[LabelledView],
    num_sources: int,
    network: ResDepthNet,
    paths: Sequence[Mapping[LabelledView, Path]],
) -> None:
    """Refine views of one kind of map, and write their samples of each iteration."""
    loaded = {
        view: found
        for view, found in load_views(views, num_sources)
        if is_unfiltered(found.inputs.depth)
    }
    inputs = {view: found.inputs for view, found in loaded.items()}
    for iteration_paths in paths:
        refined = {
            view.index: refine_view(own, network, RefineConfig()).depth
            for view, own in inputs.items()
        }
        inputs = {view: _updated(view, loaded[view], refined) for view in loaded}
        for view, own in inputs.items():
            if own.source_maps:
                sample = build_sample(loaded[view]._replace(inputs=own), num_sources)
                write_sample(iteration_paths[view], sample)


def _updated(
    view: LabelledView, loaded: Loaded, refined: Mapping[int, DepthMap]
) -> ViewInputs:
    """The inputs of a view with the refined maps of others, by their index."""
    own = loaded.inputs
    paired = zip(view.other_map_paths, own.source_maps, strict=True)
    maps = tuple(
        dataclasses.replace(source_map, depth=refined[index])
        for index, source_map in paired
        if index in refined
    )
    return dataclasses.replace(own, source_maps=maps)
