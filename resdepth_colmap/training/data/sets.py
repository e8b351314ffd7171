"""The data of a training: crops to train on, crops and views to validate with."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.progress import Progress
from resdepth_colmap.training.config import TrainConfig
from resdepth_colmap.training.data.batches import CropSet
from resdepth_colmap.training.data.outer_iterations import prepare_later_iterations
from resdepth_colmap.training.data.samples import prepare_samples
from resdepth_colmap.training.data.scenes import check_apart, find_scenes, split_scenes
from resdepth_colmap.training.distributed import Ranks
from resdepth_colmap.training.initialisation import init_path
from resdepth_colmap.training.validation import ValidationSet

CACHE_FOLDER = "samples"

logger = logging.getLogger(__name__)


class Folders(NamedTuple):
    """Folders that a training reads and writes.

    Attributes:
        workspaces: Workspaces to train on and to hold out, or folders of such.
        validate_on: More workspaces, only to validate with.
        output: Output folder of the training.
    """

    workspaces: Sequence[Path]
    validate_on: Sequence[Path]
    output: Path


class Data(NamedTuple):
    """What is trained on and what is validated with.

    Attributes:
        training: Crops to train on.
        held_out: Crops of held-out scenes; None if there are none.
        sets: Views to refine, of held-out and of watched scenes; only the first process
            has any.
    """

    training: CropSet
    held_out: CropSet | None
    sets: tuple[ValidationSet, ...]


def prepare_data(
    folders: Folders,
    network: NetworkConfig,
    config: TrainConfig,
    ranks: Ranks,
    progress: Progress,
) -> Data:
    """Split the scenes, and prepare the samples in the first process.

    Raises:
        TrainingError: If there is nothing to train on, or a scene is given both for
            training and for validation.
        WeightsError: If the weights that refine for later outer iterations cannot be
            read.
        WorkspaceError: If a workspace is broken, or cannot be matched.
    """
    scenes, watched = find_scenes(folders.workspaces), find_scenes(folders.validate_on)
    check_apart(scenes, watched)
    split = split_scenes(scenes, config.validation_share)
    cache = config.samples or folders.output / CACHE_FOLDER

    def samples_of(part: Sequence[Path]) -> tuple[Path, ...]:
        paths = prepare_samples(part, network, cache, progress)
        if config.outer_iterations > 1 and config.init is not None:
            weights = init_path(config.init)
            paths += prepare_later_iterations(
                part, network, cache, weights, config.outer_iterations, progress
            )
        return tuple(paths)

    training, held_out = (
        CropSet(paths=paths, network=network, config=config)
        for paths in ranks.from_first(lambda: [samples_of(part) for part in split])
    )
    if not training.paths:
        raise TrainingError(
            f"{scenes[0]}: no view has both a true depth map in ground_truth/ and a "
            "depth map in stereo/depth_maps/ that agrees with it anywhere; check that "
            "the names are <image>.bin and the units those of the model."
        )
    sets = []
    if ranks.is_first:
        for name, part in (("held_out", split.held_out), ("watched", watched)):
            if part:
                sets.append(ValidationSet.of(name, part, config.validation_views))
        logger.info(
            "%d samples of %d scenes; %d scenes held out, %d watched.",
            len(training.paths),
            len(split.training),
            len(split.held_out),
            len(watched),
        )
    return Data(training, held_out if held_out.paths else None, tuple(sets))
