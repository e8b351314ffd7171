"""The command `train`."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    build_config,
    command,
    config_options,
    given_values,
)
from resdepth_colmap.config import TrainConfig
from resdepth_colmap.network.network_config import NetworkConfig


@command(
    "Train a network on workspaces with known depth.",
    "synthesize rooms/ --num-scenes 100 --num-views 3",
    "stereo rooms/room_000000",
    "train rooms/room_* --output training/",
    "train rooms/room_* --output more/ --init shipped --learning-rate 3e-4",
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
    help="Folder of weights, state and log; a stopped training goes on from it.",
)
@config_options(TrainConfig)
@config_options(NetworkConfig)
def train(workspaces: tuple[Path, ...], output: Path, **values: Any) -> None:
    """Train a network on WORKSPACES that have depth maps and a ground_truth folder.

    The path of the weights is printed, for `refine --weights`.
    """
    config = build_config(TrainConfig, values)
    given = given_values(NetworkConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.training.beginning import chosen_network
    from resdepth_colmap.training.loop import train as run_training

    network_config = chosen_network(config, given)
    path = run_training(workspaces, output, network_config, config, BarProgress())
    click.echo(path)
