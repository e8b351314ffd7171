"""The command `fuse`: refined maps into a cloud."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    build_config,
    command,
    config_options,
    enum_option,
    workspace_argument,
)
from resdepth_colmap.config import FuseConfig, MaskConfig
from resdepth_colmap.pipeline.run_config import CloudFormat, RunConfig


@command(
    "Fuse refined maps into a cloud.",
    "fuse scene/dense",
    "fuse scene/dense --min-num-views 2 --voxel-size 0.01 --cloud-format pcd",
)
@workspace_argument
@config_options(FuseConfig)
@config_options(MaskConfig)
@enum_option(
    "--cloud-format",
    kind=CloudFormat,
    default=RunConfig.cloud_format,
    text="File format of the cloud.",
)
@click.option(
    "--in-place", is_flag=True, help="Fuse what `refine --in-place` has refined."
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File to write instead of WORKSPACE/resdepth/fused; it must end in "
    ".ply, .pcd or .xyz.",
)
def fuse(
    workspace: Path,
    cloud_format: CloudFormat,
    in_place: bool,
    output: Path | None,
    **values: Any,
) -> None:
    """Fuse the refined depth maps of WORKSPACE into one cloud.

    A cloud that is there is replaced.
    """
    config = build_config(FuseConfig, values)
    masks = build_config(MaskConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.cli.printed import show_line
    from resdepth_colmap.pipeline.fuse.to_file import fuse_to_file

    path, num_points = fuse_to_file(
        workspace,
        config,
        output or cloud_format,
        in_place=in_place,
        masks=masks,
        progress=BarProgress(),
    )
    show_line("cloud", f"{path} ({num_points:,} points)")
