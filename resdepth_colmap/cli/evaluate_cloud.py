"""The command `evaluate cloud`: a cloud against laser scans, by ETH3D's rules."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.evaluation.cloud.config import DEFAULT_TOLERANCES, CloudConfig

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.cloud.scores import CloudScores


def _tolerances(_context: click.Context, _option: object, text: str) -> Any:
    try:
        values = {float(word) for word in text.replace(",", " ").split()}
    except ValueError as error:
        raise click.BadParameter(f"{text!r}: {error}.") from error
    return tuple(sorted(values))


@command(
    "Score a cloud against laser scans, by ETH3D's rules.",
    "evaluate cloud fused.ply --ground-truth scan_clean/scan_alignment.mlp",
    "evaluate cloud fused.ply --ground-truth scan_alignment.mlp --tolerances 0.02,0.1",
)
@click.argument("reconstruction", type=click.Path(path_type=Path))
@click.option(
    "--ground-truth",
    type=click.Path(path_type=Path),
    required=True,
    help="ETH3D's scan_alignment.mlp, which names the scans beside it.",
)
@click.option(
    "--tolerances",
    callback=_tolerances,
    default=",".join(map(str, DEFAULT_TOLERANCES)),
    show_default=True,
    help="Distances up to which a point is right, in metres, with commas between.",
)
@config_options(CloudConfig, skip=("tolerances",))
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@click.option(
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="JSON file to write as well.",
)
def cloud(
    reconstruction: Path,
    ground_truth: Path,
    as_json: bool,
    output: Path | None,
    **values: Any,
) -> None:
    """Score RECONSTRUCTION, a PLY file, against the laser scans of a scene.

    Accuracy is the share of its points that the scans confirm, completeness the share
    of the scans that it reaches, both averaged over small voxels; what no laser has
    seen does not count. The cloud has to be in metres in the frame of the scans: use
    the poses that come with them.
    """
    config = build_config(CloudConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.evaluation.cloud.laser_truth import score_cloud_file
    from resdepth_colmap.io.files import write_whole

    scores = score_cloud_file(reconstruction, ground_truth, config, BarProgress())
    record = {
        "reconstruction": str(reconstruction),
        "ground_truth": str(ground_truth),
        "options": config.to_mapping(),
        **scores.to_mapping(),
    }
    text = json.dumps(record, indent=2, ensure_ascii=False)
    if output is not None:
        write_whole(output, f"{text}\n".encode())
    if as_json:
        click.echo(text)
    else:
        _show(scores)


def _show(scores: "CloudScores") -> None:
    from rich.table import Table

    from resdepth_colmap.cli.printed import show_line, show_table

    show_line("cloud", f"{scores.num_points:,} points")
    show_line("scans", f"{scores.num_scan_points:,} points")
    table = Table()
    for header in ("tolerance, m", "accuracy", "completeness", "F1"):
        table.add_column(header, justify="right")
    rows = zip(
        scores.tolerances, scores.accuracy, scores.completeness, scores.f1, strict=True
    )
    for tolerance, *shares in rows:
        table.add_row(f"{tolerance:g}", *(f"{100 * share:.2f} %" for share in shares))
    show_table(table)
