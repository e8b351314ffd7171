"""Which views each view is matched against, and between which depths."""

import dataclasses
import logging
from collections.abc import Sequence

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.view_selection import (
    SourceChoice,
    choose_sources,
    spread_choices,
)
from resdepth_colmap.io.colmap.cfg import SourceKind, SourceSpec, read_sources
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.scene import Scene

logger = logging.getLogger(__name__)

AUTO_SOURCES = 20  # COLMAP's default in patch-match.cfg
MOST_NAMES_SHOWN = 3

Skipped = tuple[tuple[str, str], ...]
"""Name and reason of each image that is not matched."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class StereoPlan:
    """What a view is matched against.

    Attributes:
        index: Its place in the scene.
        sources: Places of its sources, at least one.
        depth_range: Near and far depth, in workspace units, 0 < near < far.
        is_guess: Whether nothing but the poses tells the depth range.
        unknown_sources: What patch-match.cfg names as sources and the model lacks.
    """

    index: int
    sources: tuple[int, ...]
    depth_range: tuple[float, float]
    is_guess: bool = False
    unknown_sources: tuple[str, ...] = ()


def plan_stereo(
    workspace: Workspace,
    scene: Scene,
    config: StereoConfig,
    *,
    all_views: bool = False,
) -> tuple[tuple[StereoPlan, ...], Skipped]:
    """Decide what each view is matched against, as patch-match.cfg says.

    Without that file every view is matched against automatically chosen ones.

    Args:
        workspace: Where that file lies.
        scene: The views.
        config: Options.
        all_views: Match views that the file does not name, too.

    Returns:
        The plans, and the views that cannot be matched, each with the reason.

    Raises:
        WorkspaceError: If patch-match.cfg is malformed.
    """
    path = workspace.stereo_path / "patch-match.cfg"
    specs = read_sources(path) if path.exists() else _automatic(scene)
    if all_views:
        specs = {**_automatic(scene), **specs}
    plans, skipped = [], []
    for name, spec in specs.items():
        index = scene.index(name)
        if index < 0:
            skipped.append((name, f"{path.name} names it, but the model does not"))
            continue
        sources = _sources_of(scene, index, spec, config)
        if not sources:
            skipped.append((name, "no other view overlaps with it"))
            continue
        try:
            plan = _plan(scene, index, sources, config)
            unknown = tuple(n for n in dict.fromkeys(spec.names) if scene.index(n) < 0)
            plans.append(dataclasses.replace(plan, unknown_sources=unknown))
        except ValueError as error:
            skipped.append((name, str(error).removesuffix(".")))
    return tuple(plans), tuple(skipped)


def _automatic(scene: Scene) -> dict[str, SourceSpec]:
    return {
        view.name: SourceSpec(kind=SourceKind.AUTO, num_auto=AUTO_SOURCES)
        for view in scene.views
    }


def _sources_of(
    scene: Scene, index: int, spec: SourceSpec, config: StereoConfig
) -> tuple[int, ...]:
    limit = config.max_num_sources
    if spec.kind is SourceKind.EXPLICIT:
        return _listed(scene, index, spec.names)[:limit]
    if spec.kind is SourceKind.AUTO:
        return automatic_sources(scene, index, limit, config, spec.num_auto)
    choices = choose_sources(scene, index, len(scene.views))
    return _places(spread_choices(scene, index, choices, limit))


def automatic_sources(
    scene: Scene,
    index: int,
    number: int,
    config: StereoConfig,
    num_auto: int = AUTO_SOURCES,
) -> tuple[int, ...]:
    """Places of the sources that `__auto__, num_auto` gives a view, best first.

    COLMAP takes the `num_auto` best; ours are up to `number` of these.
    """
    choices = [
        choice
        for choice in choose_sources(scene, index, len(scene.views))
        # Without shared points there is no such angle, only one between the axes.
        if not choice.num_shared_points
        or choice.angle_deg >= config.min_triangulation_angle
    ]
    return _places(spread_choices(scene, index, choices[:num_auto], number))


def _places(choices: tuple[SourceChoice, ...]) -> tuple[int, ...]:
    return tuple(choice.index for choice in choices)


def _listed(scene: Scene, index: int, names: tuple[str, ...]) -> tuple[int, ...]:
    indices = [scene.index(name) for name in dict.fromkeys(names)]
    return tuple(other for other in indices if other not in (-1, index))


def _plan(
    scene: Scene, index: int, sources: tuple[int, ...], config: StereoConfig
) -> StereoPlan:
    if config.depth_min > 0:
        limits, is_guess = (config.depth_min, config.depth_max), False
    else:
        limits = depth_range(scene, index, sources)
        is_guess = scene.depth_range is None or not scene.depth_range[index, 0] > 0
    return StereoPlan(
        index=index, sources=sources, depth_range=limits, is_guess=is_guess
    )


def say_plan(scene: Scene, plans: Sequence[StereoPlan], config: StereoConfig) -> None:
    """Warn of sources that are not there, and of views with too few of them."""
    for plan in plans:
        for name in plan.unknown_sources:
            logger.warning(
                "%s: its source %s is left out: the model does not have it.",
                scene.views[plan.index].name,
                name,
            )
    needed = config.filter_min_num_consistent
    few = [scene.views[p.index].name for p in plans if len(p.sources) < needed]
    if config.filter and few:
        logger.warning(
            "%d views have fewer sources than filter_min_num_consistent=%d, so that "
            "all of their sources have to agree on a depth: %s%s.",
            len(few),
            needed,
            ", ".join(few[:MOST_NAMES_SHOWN]),
            " ..." if len(few) > MOST_NAMES_SHOWN else "",
        )
