"""What `evaluate depth` and `evaluate eth3d` share: options and evaluation."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from resdepth_colmap.cli.options import Command, build_config, config_options
from resdepth_colmap.cli.results import (
    UNRECORDED,
    command_line,
    exit_if_failed,
    result_options,
    show_failure,
    show_result,
)
from resdepth_colmap.config import RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.evaluation.datasets.paper import PAPER_MAX_RESIDUAL

if TYPE_CHECKING:
    from resdepth_colmap.evaluation.datasets.sample import SceneSource
    from resdepth_colmap.evaluation.depth.evaluation import EvaluationOptions
    from resdepth_colmap.evaluation.markdown import Measured

_IRRELEVANT = (
    *("max_image_size", "min_triangulation_angle", "filter", "filter_min_ncc"),
    *("filter_min_triangulation_angle", "filter_min_num_consistent"),
    *("filter_geom_consistency_max_cost", "write_consistency_graph"),
    "cache_size",
)
"""Options of StereoConfig that do not change an unfiltered map of full size."""

_max_residual = click.option(
    "--max-residual",
    type=click.FloatRange(min=0),
    default=PAPER_MAX_RESIDUAL,
    show_default=True,
    help="Leave larger errors, in workspace units, out of MAE, RMSE and MedAE; 0 = no "
    "limit.",
)


def evaluation_command_options(
    cache_help: str, *skip: str
) -> Callable[[Command], Command]:
    """The options of refinement, matcher (without `skip`), errors, cache and result."""
    cache = click.option(
        "--cache", type=click.Path(path_type=Path, file_okay=False), help=cache_help
    )
    iterations = ("inner_iterations", "outer_iterations")
    refine = config_options(
        RefineConfig, *iterations, "update_gating", "weights", "device"
    )
    stereo = config_options(StereoConfig, skip=(*_IRRELEVANT, *skip))

    def decorate(function: Command) -> Command:
        return refine(stereo(_max_residual(cache(result_options(function)))))

    return decorate


def evaluation_options(
    values: dict[str, Any], backend: StereoBackend, cache: Path | None
) -> "EvaluationOptions":
    """The options of an evaluation, from the values of a command."""
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
    """Evaluate, print and write the result; exit code 1 if a scene is broken.

    Args:
        sources: The scenes.
        options: How they are evaluated.
        table: Renders the result as tables.
        values: The values of the command, with as_json and output.
        protocol: How samples were chosen, for the result.
    """
    from resdepth_colmap.cli.log import BarProgress
    from resdepth_colmap.evaluation.depth.evaluation import evaluate_scenes

    report = evaluate_scenes(sources, options, show_failure, BarProgress())
    measured = {"command": command_line(skip=UNRECORDED), **report.to_mapping()}
    if protocol is not None:
        measured["protocol"] = protocol
    as_json, output = values["as_json"], values["output"]
    show_result(
        measured, lambda it: click.echo(table(it)), as_json=as_json, output=output
    )
    exit_if_failed(report.failed, len(sources), "scenes", as_json=as_json)
