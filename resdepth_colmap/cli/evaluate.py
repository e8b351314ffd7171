"""The commands `evaluate ...`: a result against measured truth."""

import click

from resdepth_colmap.cli.lazy_group import LazyGroup
from resdepth_colmap.cli.options import example, verbosity_options

EVALUATIONS: tuple[str, ...] = ("cloud", "depth", "eth3d")
"""Names of the sub-commands; that of "cloud" is `cloud` in evaluate_cloud.py."""


@click.group(
    cls=LazyGroup,
    module_prefix="resdepth_colmap.cli.evaluate_",
    commands_in=EVALUATIONS,
    short_help="Compare depth maps and clouds with measured truth.",
    epilog=example("evaluate cloud fused.ply --ground-truth scan_alignment.mlp"),
)
@verbosity_options
def evaluate() -> None:
    """Compare depth maps and clouds with measured truth."""
