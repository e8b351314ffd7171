"""The command `evaluate eth3d`: the paper's comparison on ETH3D."""

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
from resdepth_colmap.cli.options import command, config_options, enum_option
from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.evaluation.datasets.paper import PAPER_IMAGE_WIDTH_PX

CACHE_NAME = "resdepth-cache"


@command(
    "Compare with unfiltered COLMAP on ETH3D, as the paper does.",
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
    "--scene", "scenes", multiple=True, help="Compare this scene; may be repeated."
)
@click.option(
    "--pairs",
    "pairs_path",
    type=click.Path(path_type=Path),
    help="File of stereo pairs: lines 'SCENE REFERENCE SOURCE'; else "
    "ETH3D_ROOT/pairs.txt where it is there.",
)
@click.option(
    "--num-pairs",
    type=click.IntRange(min=1),
    help="Pairs of a scene that the file does not name; else as many as in the paper.",
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
    text="Whose PatchMatch: COLMAP's (needs CUDA), or ours on the CPU.",
)
@config_options(
    RefineConfig,
    "inner_iterations",
    "outer_iterations",
    "update_gating",
    "weights",
    "device",
)
@config_options(StereoConfig, skip=(*NO_MATCHER_OPTIONS, "max_num_sources"))
@max_residual_option
@click.option(
    "--cache",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder that keeps matched depth, for a run to go on from; "
    f"else ETH3D_ROOT/{CACHE_NAME}.",
)
@report_options
def eth3d(
    root: Path, backend: StereoBackend, cache: Path | None, **values: Any
) -> None:
    """Compare unfiltered, median-filtered and refined depth with ETH3D's truth.

    ETH3D_ROOT is the folder that the archives of the high-resolution multi-view scenes
    were unpacked into: dslr_undistorted, dslr_jpg and dslr_depth of each
    (https://www.eth3d.net/datasets); the environment variable RESDEPTH_ETH3D may
    name it instead. Depth is matched in each pair's first image
    against the second one alone. The table has the paper's figures beside it. A broken
    scene does not stop the others; the exit code is 1 then.
    """
    options = evaluation_options(values, backend, cache or root / CACHE_NAME)
    from resdepth_colmap.evaluation.datasets.eth3d import Eth3dOptions, eth3d_sources
    from resdepth_colmap.evaluation.depth.eth3d_tables import eth3d_table

    names = ("scenes", "pairs_path", "num_pairs", "image_width_px")
    chosen = Eth3dOptions(**{name: values[name] for name in names})
    sources = eth3d_sources(root, chosen)
    run_evaluation(sources, options, eth3d_table, values, chosen.protocol(root))
