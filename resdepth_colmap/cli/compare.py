"""The command `compare`: filtered, unfiltered and refined maps, side by side."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.command_line import command_line
from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.config import FuseConfig
from resdepth_colmap.evaluation.compare.config import FUSE_OPTIONS, CompareConfig

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.compare.result import GroundTruth

_UNSAID = ("as_json", "output")  # they change no figure


def _tolerances(_context: click.Context, _option: object, text: str) -> Any:
    try:
        return tuple(sorted({float(word) for word in text.replace(",", " ").split()}))
    except ValueError as error:
        raise click.BadParameter(f"{text!r}: {error}.") from error


@command(
    "Compare filtered, unfiltered and refined maps, all fused alike.",
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
    help="ETH3D's scan_alignment.mlp: score the clouds by its rules, in metres.",
)
@click.option(
    "--tolerances",
    callback=_tolerances,
    default="",
    help="Distances up to which a point is right, in workspace units, with commas "
    "between.  [default: 1 % and 2 % of the mean true depth; those of `evaluate cloud` "
    "with --ground-truth]",
)
@click.option(
    "--filtered", default="", help="The kind of map that is the filtered arm."
)
@click.option(
    "--unfiltered", default="", help="The kind of map that is the unfiltered arm."
)
@config_options(FuseConfig, *FUSE_OPTIONS)
@click.option(
    "--in-place", is_flag=True, help="Compare what `refine --in-place` has refined."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of tables.")
@click.option(
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="JSON file to write as well.",
)
def compare(
    workspaces: tuple[Path, ...],
    ground_truth: Path | None,
    in_place: bool,
    as_json: bool,
    output: Path | None,
    **values: Any,
) -> None:
    """Compare the filtered, unfiltered and refined depth maps of each WORKSPACE.

    All are fused by COLMAP's fusion and ours, with the same settings. Where the truth
    is known (ground_truth/IMAGE.bin, or laser scans), each cloud gets accuracy,
    completeness and F1. Sparse points, the agreement of neighbouring maps, and photos
    warped onto each other are witnesses where it is not. Differences are taken view by
    view. Nothing in WORKSPACE is changed. A broken WORKSPACE does not stop the others;
    the exit code is 1 then.
    """
    fuse = build_config(FuseConfig, values)
    config = build_config(CompareConfig, {**values, "fuse": fuse})
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.cli.printed_comparison import show_workspace
    from resdepth_colmap.evaluation.compare.comparison import compare_workspaces
    from resdepth_colmap.io.files import write_whole

    report = compare_workspaces(
        workspaces,
        config,
        _truth(ground_truth, config),
        in_place=in_place,
        on_failure=_say_failure,
        progress=BarProgress(),
    )
    measured = {"command": command_line(skip=_UNSAID), **report}
    text = json.dumps(measured, indent=2, ensure_ascii=False)
    if output is not None:
        write_whole(output, f"{text}\n".encode())
    if as_json:
        click.echo(text)
    else:
        for name, found in measured["workspaces"].items():
            show_workspace(name, found)
    if measured["failed"]:
        failed = measured["failed"]
        names = ", ".join(failed)
        summary = f"{len(failed)} of {len(workspaces)} workspaces failed: {names}"
        click.echo(summary, err=as_json)
        click.get_current_context().exit(1)


def _truth(path: Path | None, config: CompareConfig) -> "GroundTruth | None":
    if path is None:
        return None
    from resdepth_colmap.evaluation.cloud.config import CloudConfig
    from resdepth_colmap.evaluation.cloud.laser_truth import read_laser_truth

    tolerances = config.tolerances or CloudConfig.tolerances
    return read_laser_truth(path, CloudConfig(tolerances=tolerances))


def _say_failure(name: str, reason: str) -> None:
    click.echo(f"Error: {name}: {reason}", err=True)
