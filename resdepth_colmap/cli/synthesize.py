"""The command `synthesize`: rendered rooms with exact depth."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.config import SynthesisConfig


@command(
    "Render rooms with known depth, to train on.",
    "synthesize rooms/ --num-scenes 20 --num-views 2 --workers 2",
)
@click.argument("output", type=click.Path(path_type=Path, file_okay=False))
@config_options(SynthesisConfig)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Rooms to render at once.",
)
def synthesize(output: Path, workers: int, **values: Any) -> None:
    """Render rooms into workspaces OUTPUT/room_SEED, each with ground_truth/.

    The same options give the same rooms. Rooms that are there are kept. The paths are
    printed.
    """
    config = build_config(SynthesisConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.synthetic.synthesize import synthesize as render

    with BarProgress().stage("Rendering", config.num_scenes) as advance:
        paths = render(output, config, lambda _done, _total: advance(1), workers)
    for path in paths:
        click.echo(path)
