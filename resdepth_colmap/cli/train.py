"""The command `train`."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    command,
    config_options,
    enum_option,
    given_values,
)
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.training.config import Preset, TrainConfig


@command(
    "Train a network on workspaces with ground truth.",
    "synthesize rooms/ --num-scenes 100 --num-views 3",
    "train rooms/ --output training/ --validate-on real_scenes/",
    "train rooms/ --output more/ --init shipped --learning-rate 3e-4",
    "train rooms/ --output paper/ --preset paper --variant mono",
)
@click.argument(
    "workspaces",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path, exists=True, file_okay=False),
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder of weights, state, log and pictures; an existing training resumes.",
)
@click.option(
    "--validate-on",
    multiple=True,
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    help="Workspace with ground_truth/, or folder of such, for validation only, for "
    "example of real photographs; can be repeated. The best weights are then the best "
    "on these.",
)
@enum_option(
    "--preset",
    kind=Preset,
    default=Preset.DEFAULT,
    text="Values of the options below that are not given: the defaults shown there, or "
    "the paper's training and network.",
)
@config_options(TrainConfig)
@config_options(NetworkConfig)
def train(
    workspaces: tuple[Path, ...],
    output: Path,
    validate_on: tuple[Path, ...],
    preset: Preset,
    **values: Any,
) -> None:
    """Train a network on WORKSPACES (or folders of such) with ground_truth/.

    Uses all their depth maps, unfiltered and filtered; workspaces without any are
    matched first. `torchrun -m resdepth_colmap train ...` trains in several processes.
    Prints the path of the weights, for `refine --weights`.
    """
    config = TrainConfig.of(preset, given_values(TrainConfig, values))
    given = given_values(NetworkConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.training.distributed import is_first_process
    from resdepth_colmap.training.initialisation import chosen_network
    from resdepth_colmap.training.loop import train as run_training

    network_config = chosen_network(config, given, preset)
    path = run_training(
        workspaces, output, network_config, config, BarProgress(), validate_on
    )
    if is_first_process():
        click.echo(path)
