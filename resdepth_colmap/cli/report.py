"""The command `report`: the page that shows what the refinement changed."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    build_config,
    command,
    config_options,
    workspace_argument,
)
from resdepth_colmap.config import MaskConfig


@command(
    "Write the page that shows what refine changed.",
    "report scene/dense",
)
@workspace_argument
@config_options(MaskConfig)
def report(workspace: Path, **values: Any) -> None:
    """Write WORKSPACE/resdepth/report.html: one file, to open in any browser.

    `refine` writes it at its end; this writes it again, from the maps, the cloud and
    the run record that are there. Its path is printed.
    """
    masks = build_config(MaskConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.report.write_report import write_report

    click.echo(write_report(workspace, BarProgress(), masks))
