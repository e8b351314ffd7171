"""The command `synthesize`."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.config import SynthesisConfig


@command(
    "Render rooms with exact depth, for training.",
    "synthesize rooms/ --num-scenes 20 --num-views 2 --workers 2",
)
@click.argument("output", type=click.Path(path_type=Path, file_okay=False))
@config_options(SynthesisConfig)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of processes, each rendering a room.",
)
def synthesize(output: Path, workers: int, **values: Any) -> None:
    """Render rooms as COLMAP workspaces OUTPUT/room_SEED with ground_truth/.

    The same options give the same rooms. Existing rooms are kept. Prints the paths of
    the workspaces.
    """
    config = build_config(SynthesisConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.synthetic.synthesize import synthesize as render

    for path in render(output, config, BarProgress(), workers):
        click.echo(path)
