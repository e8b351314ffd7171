"""Depth maps of a workspace against its `ground_truth/`, initial and refined."""

import dataclasses
from collections.abc import Mapping

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.metrics.depth_metrics import DepthMetrics, depth_metrics
from resdepth_colmap.io.colmap.depth_map import read_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.pipeline.initial_map import map_path


@dataclasses.dataclass(frozen=True, kw_only=True)
class Comparison:
    """Errors of the depth of one image.

    Attributes:
        name: Image name.
        before: Errors of the initial map.
        after: Errors of the refined map.
    """

    name: str
    before: DepthMetrics
    after: DepthMetrics


def compare_with_truth(
    output: OutputWorkspace, kinds: Mapping[str, str]
) -> tuple[Comparison, ...]:
    """The errors of the refined maps of a workspace and of their initial maps.

    No residual is discarded: rooms have no distant background.

    Args:
        output: Where the refined maps are; its source has `ground_truth/`.
        kinds: The kind of the initial map, by image name. Images without ground truth
            are left out.

    Raises:
        WorkspaceError: If no image has ground truth, or a map is broken or differs from
            it in size.
    """
    workspace = output.source
    comparisons = []
    for name, kind in kinds.items():
        path = workspace.truth_path(name)
        if not path.is_file():
            continue
        truth = read_depth_map(path)
        before = read_depth_map(map_path(workspace, name, kind))
        after = read_depth_map(output.depth_map_path(name))
        if before.shape != truth.shape or after.shape != truth.shape:
            raise WorkspaceError(
                f"{path}: {truth.shape[1]} x {truth.shape[0]} px, but the depth maps "
                f"of {name} are of another size; match it at full size."
            )
        comparisons.append(
            Comparison(
                name=name,
                before=depth_metrics(before, truth, max_residual=None),
                after=depth_metrics(after, truth, max_residual=None),
            )
        )
    if not comparisons:
        raise WorkspaceError(
            f"{workspace.path}: no ground_truth/<image>.bin of any refined image."
        )
    return tuple(comparisons)
