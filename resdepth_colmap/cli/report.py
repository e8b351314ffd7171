"""The command `report`: the page that shows what the refinement changed."""

from pathlib import Path

import click

from resdepth_colmap.cli.options import command, workspace_argument


@command(
    "Write the page that shows what refine changed.",
    "report scene/dense",
)
@workspace_argument
def report(workspace: Path) -> None:
    """Write WORKSPACE/resdepth/report.html: one file, to open in any browser.

    `refine` writes it at its end; this writes it again, from the maps, the cloud and
    the run record that are there. Its path is printed.
    """
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.report.write_report import write_report

    click.echo(write_report(workspace, BarProgress()))
