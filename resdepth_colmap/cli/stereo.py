"""The command `stereo`: initial depth alone."""

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
from resdepth_colmap.config import MaskConfig, StereoBackend, StereoConfig


@command(
    "Make initial depth maps by PatchMatch.",
    "stereo scene/dense --max-image-size 1000",
    "stereo scene/dense --no-filter --mask-path scene/masks",
    "stereo scene/dense --PatchMatchStereo.geom_consistency 0",
)
@workspace_argument
@enum_option(
    "--stereo",
    "backend",
    kind=StereoBackend,
    default=StereoBackend.CPU,
    text="Whose PatchMatch: COLMAP's (needs CUDA), or ours on the CPU.",
)
@config_options(StereoConfig)
@config_options(MaskConfig)
@overwrite_option
def stereo(
    workspace: Path, backend: StereoBackend, overwrite: bool, **values: Any
) -> None:
    """Make the depth and normal maps that WORKSPACE lacks: COLMAP's patch_match_stereo.

    They go to WORKSPACE/stereo, in COLMAP's format, and `colmap stereo_fusion` takes
    them: photometric ones with a depth at each pixel, then geometric ones, which are
    matched against the neighbours' depth, too, and filtered. The options have COLMAP's
    names and meanings, and are taken in its spelling too. Maps that are there are kept;
    what was interrupted goes on.
    """
    config = build_config(StereoConfig, values)
    masks = build_config(MaskConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.io.colmap.model import read_scene
    from resdepth_colmap.io.colmap.workspace import check_images, open_workspace
    from resdepth_colmap.pipeline.masks import with_masks
    from resdepth_colmap.pipeline.stereo.stage import stereo_workspace

    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    check_images(opened, scene)
    opened = with_masks(opened, scene, masks)
    report = stereo_workspace(
        opened, scene, config, backend, overwrite=overwrite, progress=BarProgress()
    )
    click.echo(f"backend   {report.backend}")
    click.echo(f"matched   {len(report.matched)} images")
    click.echo(f"kept      {len(report.kept)} images")
    for name, reason in report.skipped:
        click.echo(f"skipped   {name}: {reason}")
    click.echo(f"maps      {opened.stereo_path / 'depth_maps'}")
