"""What `evaluate depth` and `evaluate eth3d` share: options, progress, the result."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.command_line import command_line
from resdepth_colmap.cli.options import Command, build_config
from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.datasets.sample import SceneSource
    from resdepth_colmap.evaluation.depth.evaluation import EvaluationOptions
    from resdepth_colmap.evaluation.markdown import Measured

NO_MATCHER_OPTIONS = (
    "max_image_size",
    "min_triangulation_angle",
    "filter",
    "filter_min_ncc",
    "filter_min_triangulation_angle",
    "filter_min_num_consistent",
    "filter_geom_consistency_max_cost",
    "write_consistency_graph",
    "mask_path",
    "cache_size",
)
"""Those of StereoConfig that an unfiltered map of full size does not depend on."""

max_residual_option = click.option(
    "--max-residual",
    type=click.FloatRange(min=0),
    default=PAPER_MAX_RESIDUAL,
    show_default=True,
    help="Larger errors, in workspace units, are left out of MAE, RMSE and MedAE; 0 = "
    "none is.",
)


_UNSAID = ("as_json", "output", "cache")  # they change no figure


def report_options(function: Command) -> Command:
    """Give a command --json and --output."""
    as_json = click.option(
        "--json", "as_json", is_flag=True, help="Print JSON instead of tables."
    )
    output = click.option(
        "--output",
        type=click.Path(path_type=Path, dir_okay=False),
        help="Write the JSON to this file, too.",
    )
    return as_json(output(function))


def evaluation_options(
    values: dict[str, Any], backend: StereoBackend, cache: Path | None
) -> "EvaluationOptions":
    """The options of a comparison, from a command's values."""
    refine = build_config(RefineConfig, values)
    stereo = build_config(StereoConfig, values)
    from resdepth_colmap.evaluation.depth.evaluation import EvaluationOptions
    from resdepth_colmap.evaluation.depth.match_cache import MatchCache

    return EvaluationOptions(
        refine=refine,
        stereo=stereo,
        backend=backend,
        cache=MatchCache(folder=cache) if cache else None,
        max_residual=values["max_residual"] or None,
    )


def run_evaluation(
    sources: "Sequence[SceneSource]",
    options: "EvaluationOptions",
    table: "Callable[[Measured], str]",
    values: dict[str, Any],
    protocol: dict[str, Any] | None = None,
) -> None:
    """Measure, print and write the result; exit code 1 if a scene is broken.

    Args:
        sources: The scenes.
        options: How they are measured.
        table: Makes tables of the result.
        values: The command's values: as_json and output.
        protocol: What else the result has to say of itself.
    """
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.evaluation.depth.evaluation import Listener, evaluate_scenes
    from resdepth_colmap.io.files import write_whole

    listener = Listener(on_failure=_say_failure, progress=BarProgress())
    report = evaluate_scenes(sources, options, listener)
    measured = {"command": command_line(skip=_UNSAID), **report.to_mapping()}
    if protocol is not None:
        measured["protocol"] = protocol
    text = json.dumps(measured, indent=2, ensure_ascii=False)
    if values["output"]:
        write_whole(values["output"], f"{text}\n".encode())
    click.echo(text if values["as_json"] else table(measured))
    if report.failed:
        names = ", ".join(report.failed)
        failed = f"{len(report.failed)} of {len(sources)} scenes failed: {names}"
        click.echo(failed, err=values["as_json"])
        click.get_current_context().exit(1)


def _say_failure(name: str, reason: str) -> None:
    click.echo(f"Error: {name}: {reason}", err=True)
