"""The command `refine`: the whole road."""

import dataclasses
from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    build_config,
    command,
    config_options,
    enum_option,
    overwrite_option,
    workspace_argument,
)
from resdepth_colmap.config import (
    FuseConfig,
    MaskConfig,
    RefineConfig,
    StereoBackend,
    StereoConfig,
)
from resdepth_colmap.pipeline.run_config import CloudFormat, RunConfig


@command(
    "Refine depth maps, fuse them, show what changed.",
    "refine scene/dense",
    "refine scene/dense --stereo cpu --max-image-size 1000 --passes 2",
    "refine scene/dense --mask-path scene/masks",
)
@workspace_argument
@enum_option(
    "--stereo",
    "backend",
    kind=StereoBackend,
    default=RunConfig.backend,
    text="Where initial depth comes from: the maps that are there, COLMAP's "
    "PatchMatch (needs CUDA), or ours on the CPU; auto takes the first that works.",
)
@config_options(RefineConfig)
@config_options(MaskConfig)
@config_options(StereoConfig, "max_image_size")
@config_options(FuseConfig)
@enum_option(
    "--cloud-format",
    kind=CloudFormat,
    default=RunConfig.cloud_format,
    text="File format of the cloud.",
)
@click.option("--no-fuse", is_flag=True, help="Stop after the depth maps.")
@click.option("--no-pictures", is_flag=True, help="Make no pictures of the change.")
@click.option("--no-report", is_flag=True, help="Write no report.html.")
@click.option(
    "--in-place",
    is_flag=True,
    help="Put the refined maps into WORKSPACE/stereo as the geometric ones; the "
    "originals are kept beside them.",
)
@overwrite_option
def refine(
    workspace: Path, backend: StereoBackend, no_report: bool, **values: Any
) -> None:
    """Refine the depth maps of WORKSPACE and fuse them into a cloud.

    WORKSPACE is the folder that `colmap image_undistorter` wrote. The result goes to
    WORKSPACE/resdepth, a complete COLMAP workspace itself. A second run does only what
    is missing or has changed.
    """
    config = RunConfig(
        backend=backend,
        stereo=dataclasses.replace(
            RunConfig.stereo, max_image_size=values["max_image_size"]
        ),
        refine=build_config(RefineConfig, values),
        fuse=build_config(FuseConfig, values),
        masks=build_config(MaskConfig, values),
        **{name: values[name] for name in _RUN_OPTIONS},
    )
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.cli.printed import show_run
    from resdepth_colmap.pipeline.run import run_refine
    from resdepth_colmap.report.refine_and_report import refine_and_report

    run = run_refine if no_report else refine_and_report
    show_run(run(workspace, config, BarProgress()))


_RUN_OPTIONS = ("no_fuse", "no_pictures", "cloud_format", "in_place", "overwrite")
