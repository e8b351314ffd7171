"""The comparison of several workspaces; a broken one stops no other."""

import datetime
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.errors import ResDepthError
from resdepth_colmap.evaluation.compare.comparison import CloudTruth, compare_workspace
from resdepth_colmap.evaluation.compare.config import CompareConfig
from resdepth_colmap.evaluation.datasets.scenes import distinct_names
from resdepth_colmap.evaluation.metrics.measures import MEASURES
from resdepth_colmap.progress import Progress
from resdepth_colmap.versions import versions


def compare_workspaces(
    paths: Sequence[Path],
    config: CompareConfig,
    truth: CloudTruth | None = None,
    *,
    in_place: bool = False,
    on_failure: Callable[[str, str], None] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Compare the arms of each workspace.

    Args:
        paths: The workspaces.
        config: Which maps, and how they are fused and scored.
        truth: What to score all clouds against; None = each one's `ground_truth/`.
        in_place: Whether the maps were refined in place.
        on_failure: Told the name of a workspace that is broken, and what is wrong.
        progress: Who listens.

    Returns:
        Plain values, ready for JSON: the results and the failures by name.
    """
    results, failed = {}, {}
    for name, path in zip(distinct_names(paths), paths, strict=True):
        try:
            comparison = compare_workspace(
                path, config, truth, in_place=in_place, progress=progress
            )
        except ResDepthError as error:
            failed[name] = " ".join(str(error).split())
            if on_failure:
                on_failure(name, failed[name])
        else:
            results[name] = comparison.to_mapping()
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "versions": versions(),
        "options": {**config.to_mapping(), "in_place": in_place},
        "measures": MEASURES,
        "workspaces": results,
        "failed": failed,
    }
