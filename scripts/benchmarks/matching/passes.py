"""Maps of the CPU PatchMatch for its measurements, and the means over them.

The stage `stereo` makes them with default options, in separate workspaces.
"""

import dataclasses
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.cfg import SourceKind, SourceSpec
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.scene import DepthMap
from scripts.benchmarks.matching.matched_workspace import MatchedWorkspace
from scripts.benchmarks.matching.shares import mean_of
from scripts.benchmarks.record import rounded

logger = logging.getLogger(__name__)

KINDS = ("photometric", "geometric")
FIRST = StereoConfig(geom_consistency=False, filter=False)
BOTH = StereoConfig(filter=False)
AUTO = SourceSpec(kind=SourceKind.AUTO, num_auto=20)
ALL = SourceSpec(kind=SourceKind.ALL)
LIMITS = (0.01, 0.02, 0.05)

Result = dict[str, Any]
Specs = Mapping[str, SourceSpec]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Folders:
    """Where scenes are read from, and where maps are kept.

    Attributes:
        data: The scenes.
        cache: The workspaces of `MatchedWorkspace`.
    """

    data: Path
    cache: Path


def match_both(
    matched: MatchedWorkspace,
    sources: Specs,
    second: Specs | None = None,
    ranged: Mapping[str, Any] | None = None,
) -> Result:
    """Unfiltered maps of both passes; processor seconds a map of each.

    Args:
        matched: Where they go.
        sources: The images of the first pass, and their sources.
        second: Those of the second one, if they are fewer.
        ranged: Options for the depth range.
    """
    seconds = {}
    for kind, config, specs in (
        ("photometric", FIRST, sources),
        ("geometric", BOTH, second or sources),
    ):
        config = dataclasses.replace(config, **(ranged or {}))
        seconds[kind] = rounded(matched.match(kind, specs, config))
        logger.info("%s: %s %s s a map.", matched.path.name, kind, seconds[kind])
    return seconds


def depth_of(workspace: Workspace, name: str, kind: str) -> DepthMap:
    """A depth map."""
    return read_depth_map(workspace.depth_map_path(name, kind))


def mean_over(maps: Result, key: str) -> Result:
    """Means over the maps that have this."""
    return mean_of([entry[key] for entry in maps.values() if key in entry])


def compared(maps: Result, seconds: Result) -> Result:
    """The figures of each map, their means, and the processor seconds."""
    means = {
        kind: mean_over(maps, kind)
        for kind in KINDS
        if any(kind in entry for entry in maps.values())
    }
    return {"maps": maps, "mean": means, "cpu_s_per_map": seconds}
