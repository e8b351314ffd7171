"""The command `evaluate eth3d`: the comparison of the paper on ETH3D."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.depth_comparison import (
    evaluation_command_options,
    evaluation_options,
    run_evaluation,
)
from resdepth_colmap.cli.options import command, enum_option
from resdepth_colmap.config import StereoBackend
from resdepth_colmap.evaluation.datasets.paper import PAPER_IMAGE_WIDTH_PX

CACHE_NAME = "resdepth-cache"


@command(
    "Compare depth maps on ETH3D by the protocol of the paper.",
    "evaluate eth3d ETH3D/",
    "evaluate eth3d ETH3D/ --scene office --scene pipes --output eth3d.json",
)
@click.argument(
    "root",
    metavar="ETH3D_ROOT",
    envvar="RESDEPTH_ETH3D",
    type=click.Path(path_type=Path),
)
@click.option(
    "--scene",
    "scenes",
    multiple=True,
    help="Evaluate this scene; may be repeated.  [default: all]",
)
@click.option(
    "--pairs",
    "pairs_path",
    type=click.Path(path_type=Path),
    help="File of stereo pairs, one line 'SCENE REFERENCE SOURCE' each.  [default: "
    "ETH3D_ROOT/pairs.txt, if present]",
)
@click.option(
    "--num-pairs",
    type=click.IntRange(min=1),
    help="Number of pairs of a scene that the file does not list.  [default: as in the "
    "paper]",
)
@click.option(
    "--image-width",
    "image_width_px",
    type=click.IntRange(min=32),
    default=PAPER_IMAGE_WIDTH_PX,
    show_default=True,
    help="Longest side of the images, in pixels.",
)
@enum_option(
    "--stereo",
    "backend",
    kind=StereoBackend,
    default=StereoBackend.AUTO,
    text="The matcher: COLMAP's PatchMatch (needs CUDA), or PatchMatch on the CPU.",
)
@evaluation_command_options(
    "Folder that keeps matched depth for later runs.  "
    f"[default: ETH3D_ROOT/{CACHE_NAME}]",
    "max_num_sources",
)
def eth3d(
    root: Path, backend: StereoBackend, cache: Path | None, **values: Any
) -> None:
    """Compare unfiltered, median-filtered and refined depth with ETH3D's ground truth.

    ETH3D_ROOT is the folder with the unpacked archives of the high-resolution
    multi-view scenes: dslr_undistorted, dslr_jpg and dslr_depth of each
    (https://www.eth3d.net/datasets). Its default is the environment variable
    RESDEPTH_ETH3D. The first image of each pair is matched against the second one
    alone. The table lists the figures of the paper, too. A broken scene does not stop
    the others, but the exit code is 1.
    """
    options = evaluation_options(values, backend, cache or root / CACHE_NAME)
    from resdepth_colmap.evaluation.datasets.eth3d import Eth3dOptions, eth3d_sources
    from resdepth_colmap.evaluation.depth.tables import eth3d_table

    names = ("scenes", "pairs_path", "num_pairs", "image_width_px")
    chosen = Eth3dOptions(**{name: values[name] for name in names})
    sources = eth3d_sources(root, chosen)
    run_evaluation(sources, options, eth3d_table, values, chosen.protocol(root))
