"""The command `evaluate depth`: depth maps against their truth."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.depth_comparison import (
    NO_MATCHER_OPTIONS,
    evaluation_options,
    max_residual_option,
    report_options,
    run_evaluation,
)
from resdepth_colmap.cli.options import command, config_options
from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig


@command(
    "Compare depth maps with ground truth, before and after refinement.",
    "evaluate depth scene/dense",
    "evaluate depth middlebury/ --cache matched/ --output depth.json",
)
@click.argument(
    "scenes",
    metavar="SCENE...",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
)
@config_options(
    RefineConfig,
    "inner_iterations",
    "outer_iterations",
    "update_gating",
    "weights",
    "device",
)
@config_options(StereoConfig, skip=NO_MATCHER_OPTIONS)
@max_residual_option
@click.option(
    "--cache",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder that keeps matched depth for the next time.",
)
@report_options
def depth(scenes: tuple[Path, ...], cache: Path | None, **values: Any) -> None:
    """Compare unfiltered, median-filtered and refined depth with the truth of SCENEs.

    A SCENE is a dense workspace with ground_truth/IMAGE.bin (COLMAP's map format), a
    scene as Middlebury distributes it (calib.txt, im0.png, im1.png, disp0.pfm), or a
    folder of these. The fullest depth maps in stereo/ are refined anew with these
    options; where there are none, our PatchMatch makes them. Nothing in SCENE is
    changed. A broken SCENE does not stop the others; the exit code is 1 then.
    """
    options = evaluation_options(values, StereoBackend.CPU, cache)
    from resdepth_colmap.evaluation.datasets.scenes import scene_sources
    from resdepth_colmap.evaluation.depth.tables import depth_table

    sources = scene_sources(scenes)
    run_evaluation(sources, options, depth_table, values)
