"""What is refined from what: for each image its map, its second views, its hash."""

import dataclasses
import hashlib
import importlib.metadata
import json
import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from resdepth_colmap.geometry.view_selection import SourceChoice, choose_sources
from resdepth_colmap.io.colmap.cfg import SourceKind, read_sources
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.pipeline.initial_map import candidate_kinds, map_path
from resdepth_colmap.scene import Scene, View

logger = logging.getLogger(__name__)

Skipped = tuple[tuple[str, str], ...]
"""Name and reason of each image that is not refined."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewPlan:
    """What an image is refined from.

    Attributes:
        index: Its place in the scene.
        kinds: The maps to choose from.
        sources: Its second views, best first; () for a network that needs none.
        map_sources: Positions of the views whose depth maps are looked at.
        fingerprints: For each round a hash of all that its refined map depends on.
    """

    index: int
    kinds: tuple[str, ...]
    sources: tuple[SourceChoice, ...]
    map_sources: tuple[int, ...]
    fingerprints: tuple[str, ...]


def plan_views(
    workspace: Workspace,
    scene: Scene,
    requested: str,
    nums: tuple[int, int],
    options: dict[str, Any],
) -> tuple[tuple[ViewPlan, ...], Skipped]:
    """Decide what each image is refined from, without reading a map.

    Args:
        workspace: Where the maps lie.
        scene: The views. An explicit list of sources in patch-match.cfg is what the
            second views are chosen from; else all views are.
        requested: The kind of map to start from, or auto.
        nums: Second views that the network looks at, and maps of other views that are
            looked at; each may be 0.
        options: What else decides the result: it becomes part of the hash.

    Returns:
        The plans, in the order of the scene; and what is skipped, and why.

    Raises:
        WorkspaceError: If patch-match.cfg is malformed.
    """
    listed = _listed_sources(workspace, scene)
    num_sources, num_maps = nums
    plans, skipped = [], []
    for index, view in enumerate(scene.views):
        kinds = candidate_kinds(workspace, view.name, requested)
        if not kinds:
            skipped.append((view.name, _no_map(workspace, view.name, requested)))
            continue
        sources: tuple[SourceChoice, ...] = ()
        if num_sources or num_maps:
            most = max(num_sources, num_maps)
            sources = choose_sources(scene, index, most, listed.get(view.name))
        if num_sources and not sources:
            skipped.append((view.name, "no other view overlaps with it"))
            continue
        plan = ViewPlan(
            index=index,
            kinds=kinds,
            sources=sources[:num_sources],
            map_sources=tuple(choice.index for choice in sources[:num_maps]),
            fingerprints=(),
        )
        fingerprint = _fingerprint(workspace, scene, plan, options)
        plans.append(dataclasses.replace(plan, fingerprints=(fingerprint,)))
    return tuple(plans), tuple(skipped)


def with_rounds(plans: tuple[ViewPlan, ...], num_rounds: int) -> tuple[ViewPlan, ...]:
    """The same for so many rounds: each looks at the maps that the one before made.

    Args:
        plans: As `plan_views` makes them, for one round.
        num_rounds: At least 1.
    """
    for _ in range(num_rounds - 1):
        before = {plan.index: plan.fingerprints[-1] for plan in plans}
        plans = tuple(_with_round(plan, before) for plan in plans)
    return plans


def _with_round(plan: ViewPlan, before: Mapping[int, str]) -> ViewPlan:
    others = [before.get(index) for index in plan.map_sources]
    fingerprint = _hashed([plan.fingerprints[0], others])
    return dataclasses.replace(plan, fingerprints=(*plan.fingerprints, fingerprint))


def _listed_sources(workspace: Workspace, scene: Scene) -> dict[str, tuple[int, ...]]:
    """The sources that patch-match.cfg names for an image, where it names any."""
    path = workspace.stereo_path / "patch-match.cfg"
    if not path.is_file():
        return {}
    listed = {}
    for name, spec in read_sources(path).items():
        if spec.kind is not SourceKind.EXPLICIT:
            continue
        indices = tuple(scene.index(source) for source in spec.names)
        known = tuple(index for index in indices if index >= 0)
        if known:
            listed[name] = known
        else:
            logger.warning(
                "%s: the model has none of the sources of %s; choosing others.",
                path,
                name,
            )
    return listed


def _no_map(workspace: Workspace, name: str, requested: str) -> str:
    kinds = workspace.original_kinds(name)
    if not kinds:
        return "no depth map"
    return f"no {requested} depth map (there is: {', '.join(kinds)})"


def _fingerprint(
    workspace: Workspace, scene: Scene, plan: ViewPlan, options: dict[str, Any]
) -> str:
    view = scene.views[plan.index]
    views = [view, *(scene.views[source.index] for source in plan.sources)]
    others = [scene.views[index] for index in plan.map_sources]
    facts = {
        "package": importlib.metadata.version("resdepth-colmap"),
        "options": options,
        "views": [_facts_of(v) for v in views],
        "images": _stamps(workspace.image_path(v.name) for v in views),
        "maps": [plan.kinds, _map_stamps(workspace, view.name, plan.kinds)],
        "source_maps": [[_facts_of(v), _map_stamps(workspace, v.name)] for v in others],
    }
    return _hashed(facts)


def _hashed(facts: Any) -> str:
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _facts_of(view: View) -> list[Any]:
    camera = dataclasses.asdict(view.camera)
    return [view.name, camera, view.cam_from_world.tolist()]


def _map_stamps(
    workspace: Workspace, name: str, kinds: Iterable[str] | None = None
) -> list[tuple[int, int]]:
    """Those of the maps of an image, of these kinds or of all."""
    kinds = workspace.original_kinds(name) if kinds is None else kinds
    return _stamps(map_path(workspace, name, kind) for kind in kinds)


def _stamps(paths: Iterable[Path]) -> list[tuple[int, int]]:
    """Size and time of files, (0, 0) for one that is not there: no file is read."""
    stamps = []
    for path in paths:
        status = path.stat() if path.is_file() else None
        stamps.append((status.st_size, status.st_mtime_ns) if status else (0, 0))
    return stamps
