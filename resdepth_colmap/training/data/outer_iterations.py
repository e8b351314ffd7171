"""Samples of later rounds: compared with the refined maps of other views."""

import collections
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
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
)
from resdepth_colmap.training.data.samples import (
    LATER,
    build_sample,
    is_whole,
    sample_path,
    samples_folder,
    write_sample,
)


def prepare_later_rounds(
    scenes: Sequence[Path],
    config: NetworkConfig,
    cache: Path,
    weights: Path,
    num_rounds: int,
    progress: Progress | None = None,
) -> list[Path]:
    """Build the samples of the second and of later rounds of refining.

    Each whole map of a view is compared with those of its other views after the weights
    have refined these, once for the second round, twice for the third. A view whose
    other views have no ground truth has no such sample.

    Args:
        scenes: Workspaces that `prepare_samples` has been through.
        config: The network that will be trained.
        cache: Folder of the samples; those that are there and up to date are kept.
        weights: What the maps of the other views are refined with.
        num_rounds: The last round that there are samples of.
        progress: Is told of each workspace.

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
    keys = [f"{key} {number}" for number in range(2, num_rounds + 1)]
    found: list[Path] = []
    with progress.stage("Refining other views", len(scenes)) as advance:
        for path in scenes:
            for views in _by_kind(labelled_views(path)):
                rounds = [
                    {view: sample_path(view, folder, LATER, key) for view in views}
                    for key in keys
                ]
                wanted = [path for paths in rounds for path in paths.values()]
                if not all(path.exists() for path in wanted):
                    _write_samples(views, config.num_sources, network, rounds)
                found += [path for path in wanted if path.exists()]
            advance(1.0)
    return found


def _by_kind(views: Sequence[LabelledView]) -> Iterator[list[LabelledView]]:
    """Views of one kind of map, where there are several: they look at each other."""
    kinds = collections.defaultdict(list)
    for view in views:
        kinds[view.kind].append(view)
    return (group for group in kinds.values() if len(group) > 1)


def _write_samples(
    views: Sequence[LabelledView],
    num_sources: int,
    network: ResDepthNet,
    rounds: Sequence[Mapping[LabelledView, Path]],
) -> None:
    """Refine all views round by round, and write what each sees of the others then."""
    loaded: dict[LabelledView, Loaded] = {}
    for view in views:
        found = view.load(num_sources)
        if found is not None and is_whole(found.inputs.depth):
            loaded[view] = found
    seen = {view: found.inputs for view, found in loaded.items()}
    for paths in rounds:
        refined = {
            view.index: refine_view(inputs, network, RefineConfig()).depth
            for view, inputs in seen.items()
        }
        seen = {view: _after(found, view, refined) for view, found in loaded.items()}
        for view, inputs in seen.items():
            if inputs.source_maps:
                found = loaded[view]._replace(inputs=inputs)
                write_sample(paths[view], build_sample(found, num_sources))


def _after(
    loaded: Loaded, view: LabelledView, refined: Mapping[int, DepthMap]
) -> ViewInputs:
    """What a view sees once others, by their positions, are refined."""
    own = loaded.inputs
    paired = zip(view.other_map_paths, own.source_maps, strict=True)
    maps = tuple(
        dataclasses.replace(source_map, depth=refined[index])
        for index, source_map in paired
        if index in refined
    )
    return dataclasses.replace(own, source_maps=maps)
