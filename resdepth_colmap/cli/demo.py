"""The command `demo`: the main job on a room rendered on the spot."""

from pathlib import Path
from typing import Any

import click

from resdepth_colmap.cli.options import build_config, command, config_options
from resdepth_colmap.config import StereoBackend, SynthesisConfig
from resdepth_colmap.pipeline.run_config import RunConfig


@command(
    "Render a small room, refine it, show the error before and after.",
    "demo",
    "demo --output somewhere/ --num-views 3",
)
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("resdepth-demo"),
    show_default=True,
    help="Folder for the room.",
)
@config_options(SynthesisConfig, "num_views", "width_px", "height_px", "seed")
def demo(output: Path, **values: Any) -> None:
    """Render a small room and run the whole road on it: a few minutes on two cores.

    The room has no depth maps, so PatchMatch, refinement, fusion and pictures all run;
    its true depth is known, so the error before and after can be shown.
    """
    config = build_config(SynthesisConfig, values)
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.cli.printed import show_comparison, show_run
    from resdepth_colmap.report.image_maps import image_errors
    from resdepth_colmap.report.refine_and_report import refine_and_report
    from resdepth_colmap.synthetic.synthesize import synthesize

    progress = BarProgress()
    (room,) = synthesize(output, config, progress)
    result = refine_and_report(room, RunConfig(backend=StereoBackend.CPU), progress)
    images = result.refine.images
    kinds = {name: record["input"] for name, record in images.items()}
    show_comparison(image_errors(result.refine.output, kinds))
    show_run(result)
