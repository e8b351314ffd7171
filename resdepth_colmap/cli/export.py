"""The command `export`: depth maps in the formats of other programs."""

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
from resdepth_colmap.config import MaskConfig
from resdepth_colmap.pipeline.export_config import REFINED, MapFormat


@command(
    "Write depth maps as NPY, PFM or 16-bit PNG.",
    "export scene/dense --format pfm --output depth/",
    "export scene/dense --format png16 --maps photometric --output depth/",
)
@workspace_argument
@enum_option(
    "--format",
    "kind",
    kind=MapFormat,
    default=MapFormat.NPY,
    text="npy: float32; pfm: float32; png16: 16-bit grey, depth = value * "
    "unit of depth_scale.json. 0 = no depth in all.",
)
@click.option(
    "--maps",
    default=REFINED,
    show_default=True,
    help="Which maps: refined, or a kind in WORKSPACE/stereo (photometric, ...).",
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder to write to.",
)
@config_options(MaskConfig)
def export(
    workspace: Path, kind: MapFormat, maps: str, output: Path, **values: Any
) -> None:
    """Write the depth maps of WORKSPACE for programs that do not know COLMAP's format.

    The path of each file is printed. Files of the same name are replaced.
    """
    masks = build_config(MaskConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.io.colmap.model import read_scene
    from resdepth_colmap.io.colmap.workspace import open_workspace
    from resdepth_colmap.pipeline.export import export_maps
    from resdepth_colmap.pipeline.masks import with_masks

    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    opened = with_masks(opened, scene, masks, after_run=True)
    for path in export_maps(opened, output, kind, maps, BarProgress()):
        click.echo(path)
