"""The command `evaluate cloud`: a cloud against laser scans, by ETH3D's rules."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.cli.results import (
    parsed_tolerances,
    result_options,
    show_result,
)
from resdepth_colmap.evaluation.cloud.config import DEFAULT_TOLERANCES, CloudConfig

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.cloud.scores import CloudScores


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
    help="ETH3D's scan_alignment.mlp, which lists the laser scans.",
)
@click.option(
    "--tolerances",
    callback=parsed_tolerances,
    default=",".join(map(str, DEFAULT_TOLERANCES)),
    show_default=True,
    help="Largest distances of a correct point, in metres, separated by commas.",
)
@config_options(CloudConfig, skip=("tolerances",))
@result_options
def cloud(
    reconstruction: Path,
    ground_truth: Path,
    as_json: bool,
    output: Path | None,
    **values: Any,
) -> None:
    """Score RECONSTRUCTION, a PLY file, against the laser scans of a scene.

    Accuracy is the share of the points of the cloud that are near the scans,
    completeness the share of the points of the scans that are near the cloud, both
    averaged over voxels. Points that no laser beam has observed do not count. The cloud
    has to be in metres in the frame of the scans: use the poses that come with them.
    """
    config = build_config(CloudConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.evaluation.cloud.laser_truth import score_cloud_file

    scores = score_cloud_file(reconstruction, ground_truth, config, BarProgress())
    result = {
        "reconstruction": str(reconstruction),
        "ground_truth": str(ground_truth),
        "options": config.to_mapping(),
        **scores.to_mapping(),
    }
    show_result(result, lambda _: _show(scores), as_json=as_json, output=output)


def _show(scores: "CloudScores") -> None:
    from resdepth_colmap.cli.printed import show_line, show_table

    show_line("cloud", f"{scores.num_points:,} points")
    show_line("scans", f"{scores.num_scan_points:,} points")
    shares = zip(scores.accuracy, scores.completeness, scores.f1, strict=True)
    rows = [
        [f"{tolerance:g}", *(f"{100 * share:.2f} %" for share in row)]
        for tolerance, row in zip(scores.tolerances, shares, strict=True)
    ]
    headers = ("tolerance, m", "accuracy", "completeness", "F1")
    show_table(headers, rows, num_left=0)
