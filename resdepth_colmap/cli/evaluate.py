"""The commands `evaluate ...`: depth maps and clouds against ground truth."""

import click

from resdepth_colmap.cli.lazy_group import LazyGroup
from resdepth_colmap.cli.options import example, verbosity_options

EVALUATIONS: tuple[str, ...] = ("cloud", "depth", "eth3d")
"""Names of the sub-commands; "cloud" is `cloud` in evaluate_cloud.py."""


@click.group(
    cls=LazyGroup,
    module_prefix="resdepth_colmap.cli.evaluate_",
    commands_in=EVALUATIONS,
    short_help="Compare depth maps and clouds with ground truth.",
    epilog=example("evaluate cloud fused.ply --ground-truth scan_alignment.mlp"),
)
@verbosity_options
def evaluate() -> None:
    """Compare depth maps and clouds with ground truth."""
