"""The command `compare`: filtered, unfiltered and refined maps, side by side."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.cli.results import (
    UNRECORDED,
    command_line,
    exit_if_failed,
    parsed_tolerances,
    result_options,
    show_failure,
    show_result,
)
from resdepth_colmap.config import FuseConfig, MaskConfig
from resdepth_colmap.evaluation.compare.config import FUSE_OPTIONS, CompareConfig

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.compare.comparison import GroundTruth


@command(
    "Compare filtered, unfiltered and refined maps and their fused clouds.",
    "compare scene/dense",
    "compare scene/dense other/dense --min-num-views 2 --output compare.json",
    "compare scene/dense --ground-truth scan_clean/scan_alignment.mlp",
)
@click.argument(
    "workspaces",
    metavar="WORKSPACE...",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
)
@click.option(
    "--ground-truth",
    type=click.Path(path_type=Path),
    help="ETH3D's scan_alignment.mlp: score the clouds against these laser scans, in "
    "metres.",
)
@click.option(
    "--tolerances",
    callback=parsed_tolerances,
    default="",
    help="Largest distances of a correct point, in workspace units, separated by "
    "commas.  [default: 1 % and 2 % of the mean true depth; with --ground-truth those "
    "of `evaluate cloud`]",
)
@click.option(
    "--filtered", default="", help='The kind of map to compare as "filtered".'
)
@click.option(
    "--unfiltered", default="", help='The kind of map to compare as "unfiltered".'
)
@config_options(FuseConfig, *FUSE_OPTIONS)
@config_options(MaskConfig)
@click.option(
    "--in-place", is_flag=True, help="Compare maps that `refine --in-place` has made."
)
@result_options
def compare(
    workspaces: tuple[Path, ...],
    ground_truth: Path | None,
    in_place: bool,
    as_json: bool,
    output: Path | None,
    **values: Any,
) -> None:
    """Compare the filtered, unfiltered and refined depth maps of each WORKSPACE.

    The maps of each method are fused by COLMAP and by open3d, with the same settings.
    With ground truth (ground_truth/IMAGE.bin or laser scans), each cloud gets accuracy,
    completeness and F1. Reference-free metrics need none: sparse points on the maps,
    consistency of neighbouring maps, and correlation of warped images. Differences are
    computed view by view. WORKSPACE stays as it is. A broken WORKSPACE does not stop
    the others, but the exit code is 1.
    """
    fuse = build_config(FuseConfig, values)
    masks = build_config(MaskConfig, values)
    config = build_config(CompareConfig, {**values, "fuse": fuse, "masks": masks})
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.cli.printed_comparison import show_workspaces
    from resdepth_colmap.evaluation.compare.comparison import compare_workspaces

    report = compare_workspaces(
        workspaces,
        config,
        _truth(ground_truth, config),
        in_place=in_place,
        on_failure=show_failure,
        progress=BarProgress(),
    )
    result = {"command": command_line(skip=UNRECORDED), **report}
    show_result(result, show_workspaces, as_json=as_json, output=output)
    exit_if_failed(report["failed"], len(workspaces), "workspaces", as_json=as_json)


def _truth(path: Path | None, config: CompareConfig) -> "GroundTruth | None":
    if path is None:
        return None
    from resdepth_colmap.evaluation.cloud.config import CloudConfig
    from resdepth_colmap.evaluation.cloud.laser_truth import read_laser_truth

    tolerances = config.tolerances or CloudConfig.tolerances
    return read_laser_truth(path, CloudConfig(tolerances=tolerances))
