"""The command `info`: what a workspace holds and what `refine` would do."""

import json
from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import (
    build_config,
    command,
    config_options,
    workspace_argument,
)
from resdepth_colmap.config import MaskConfig, RefineConfig, StereoConfig


@command(
    "Say what a workspace holds and what refine would do.",
    "info scene/dense",
    "info scene/dense --json",
)
@workspace_argument
@config_options(RefineConfig, "input", "inner_iterations", "outer_iterations")
@config_options(MaskConfig)
@config_options(StereoConfig, "max_image_size")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def info(workspace: Path, as_json: bool, **values: Any) -> None:
    """Look at WORKSPACE and say what is there, what is missing and what to expect.

    Nothing is changed. Time and memory are rough, and those of the CPU.
    """
    refine = build_config(RefineConfig, values)
    stereo = build_config(StereoConfig, values)
    from resdepth_colmap.cli.printed import show_inspection
    from resdepth_colmap.io.colmap.model import read_scene
    from resdepth_colmap.io.colmap.workspace import open_workspace
    from resdepth_colmap.pipeline.info import inspect_workspace

    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    found = inspect_workspace(
        opened,
        scene,
        refine,
        stereo,
        build_config(MaskConfig, values),
    )
    if as_json:
        click.echo(json.dumps(found.to_mapping(), indent=2, ensure_ascii=False))
    else:
        show_inspection(found)
