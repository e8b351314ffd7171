"""The command `resdepth-colmap`: its commands, log, and what an error looks like."""

from typing import Any

import click

from resdepth_colmap.cli.colmap_spelling import plain_name
from resdepth_colmap.cli.lazy_group import LazyGroup
from resdepth_colmap.cli.options import example, verbosity_options
from resdepth_colmap.errors import ResDepthError

INTERRUPTED = 130  # the shell's code for a program that Ctrl-C ended
COMMANDS = (
    "refine",
    "stereo",
    "fuse",
    "export",
    "info",
    "report",
    "compare",
    "evaluate",
    "demo",
    "synthesize",
    "train",
)


class _Program(LazyGroup):
    """The commands, and what becomes of their errors."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; our own errors are one line, all others are bugs."""
        try:
            return super().invoke(ctx)
        except ResDepthError as error:
            raise click.ClickException(" ".join(str(error).split())) from error
        except KeyboardInterrupt:
            click.echo("Interrupted; run the same command again to go on.", err=True)
            ctx.exit(INTERRUPTED)


@click.group(
    cls=_Program,
    module_prefix="resdepth_colmap.cli.",
    commands_in=COMMANDS,
    epilog=example("info scene/dense", "refine scene/dense"),
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 100,
        "token_normalize_func": plain_name,
    },
)
@verbosity_options
@click.version_option(package_name="resdepth-colmap", prog_name="resdepth-colmap")
def main() -> None:
    """Makes the depth maps of a COLMAP workspace right, on any machine."""
