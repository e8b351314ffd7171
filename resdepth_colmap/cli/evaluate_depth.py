"""The command `evaluate depth`: depth maps against ground truth."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.depth_comparison import (
    evaluation_command_options,
    evaluation_options,
    run_evaluation,
)
from resdepth_colmap.cli.options import command
from resdepth_colmap.config import StereoBackend


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
@evaluation_command_options("Folder that keeps matched depth for later runs.")
def depth(scenes: tuple[Path, ...], cache: Path | None, **values: Any) -> None:
    """Compare unfiltered, median-filtered and refined depth with ground truth.

    A SCENE is a dense workspace with ground_truth/IMAGE.bin (COLMAP's map format), a
    scene as Middlebury distributes it (calib.txt, im0.png, im1.png, disp0.pfm), or a
    folder of these. The depth maps in stereo/ with the fewest holes are refined again
    with these options; without any, PatchMatch on the CPU computes them. SCENE stays as
    it is. A broken SCENE does not stop the others, but the exit code is 1.
    """
    options = evaluation_options(values, StereoBackend.CPU, cache)
    from resdepth_colmap.evaluation.datasets.scenes import scene_sources
    from resdepth_colmap.evaluation.depth.tables import depth_table

    sources = scene_sources(scenes)
    run_evaluation(sources, options, depth_table, values)
