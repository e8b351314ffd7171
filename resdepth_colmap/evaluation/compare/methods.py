"""The compared methods: which maps of a workspace are filtered, and which are not."""

import dataclasses
import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.compare.config import CompareConfig
from resdepth_colmap.evaluation.metrics.view_maps import ViewMaps
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.maps import read_depth_map, read_map_size
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace, original_map_path
from resdepth_colmap.pipeline.fuse.stage import refined_files
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.initial_map import choose_initial_map, map_path
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.pipeline.recent_cache import RecentCache
from resdepth_colmap.pipeline.refine.cross_view import FILTERED_SHARE
from resdepth_colmap.scene import DepthMap, Scene, View

METHODS = ("filtered", "unfiltered", "refined")
REFINED = "refined"

_PREFERRED = "geometric"  # the last pass of COLMAP
_WITHOUT = {
    "filtered": "no depth map with holes, so not compared; `resdepth-colmap stereo` "
    "and COLMAP's patch_match_stereo write filtered geometric maps.",
    "unfiltered": "no depth map without holes, so not compared; `resdepth-colmap "
    "stereo` and COLMAP's patch_match_stereo write unfiltered photometric maps.",
}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """The maps of one method.

    Attributes:
        name: One of `METHODS`.
        kind: The kind of map, as in the names of its files, or "refined".
        files: The maps of each compared view, in the order of the scene.
    """

    name: str
    kind: str
    files: tuple[MapFiles, ...]

    def to_mapping(self) -> dict[str, str]:
        """Kind and normals, ready for JSON."""
        paths = [file.normal_path for file in self.files]
        has_all = all(path is not None and path.is_file() for path in paths)
        normals = "own" if has_all else "computed from the depth"
        return {"kind": self.kind, "normals": normals}


def find_methods(
    output: OutputWorkspace, scene: Scene, config: CompareConfig
) -> tuple[list[Method], list[str]]:
    """Find the methods of a workspace by the share of pixels that its maps fill.

    Returns:
        The refined maps, and the filtered or unfiltered ones or both, of the same
        views; notes on what is missing.

    Raises:
        WorkspaceError: If there are no refined maps, no initial ones, no view that has
            both, or a map is broken.
    """
    workspace = output.source
    folder = workspace.stereo_path / "depth_maps"
    refined = [view for view in scene.views if output.is_written(view.name)]
    if not refined:
        raise WorkspaceError(
            f"{output.workspace.stereo_path}: no refined map; run `resdepth-colmap "
            f"refine {shlex.quote(str(workspace.path))}` first."
        )
    kinds = {view.name: workspace.original_kinds(view.name) for view in refined}
    if not any(kinds.values()):
        raise WorkspaceError(
            f"{folder}: no depth map of any refined image, so there is nothing to "
            "compare the refined maps with; make some with `resdepth-colmap stereo`."
        )
    chosen = _chosen_kinds(workspace, _filled_shares(workspace, refined, kinds), config)
    compared = [v for v in refined if set(chosen.values()) <= set(kinds[v.name])]
    if not compared:
        named = " and ".join(chosen.values())
        raise WorkspaceError(
            f"{folder}: no image has {named} maps and a refined one; refine more "
            "images, or choose with --filtered and --unfiltered."
        )
    notes = [f"{name}: {text}" for name, text in _WITHOUT.items() if name not in chosen]
    if len(compared) < len(scene.views):
        notes.append(
            f"{len(compared)} of {len(scene.views)} views are compared: the others "
            "lack a map of some method."
        )
    names = {view.name for view in compared}
    files = {
        name: tuple(_initial_file(workspace, view, kind) for view in compared)
        for name, kind in chosen.items()
    }
    every = refined_files(output, scene)
    files[REFINED] = tuple(file for file in every if file.view.name in names)
    methods = [
        Method(name=name, kind=chosen.get(name, REFINED), files=files[name])
        for name in METHODS
        if name in files
    ]
    return methods, notes


def _filled_shares(
    workspace: Workspace, views: Sequence[View], kinds: Mapping[str, Sequence[str]]
) -> dict[str, float]:
    """Mean share of pixels with a depth, of those that are wanted, by kind."""
    shares: dict[str, list[float]] = {}
    for view in views:
        for kind in kinds[view.name]:
            found = choose_initial_map(workspace, view.name, view.camera, [kind])
            share = found.filled
            size_px = read_map_size(found.path)
            wanted = wanted_pixels(workspace.masks, view.name, size_px)
            if wanted is not None:
                depth = read_depth_map(found.path)[wanted]
                share = float(np.count_nonzero(depth) / max(1, depth.size))
            shares.setdefault(kind, []).append(share)
    return {kind: sum(values) / len(values) for kind, values in shares.items()}


def _chosen_kinds(
    workspace: Workspace, shares: Mapping[str, float], config: CompareConfig
) -> dict[str, str]:
    """The kinds of the filtered and the unfiltered maps, where there are any."""
    chosen = {"filtered": config.filtered, "unfiltered": config.unfiltered}
    for name, kind in chosen.items():
        if kind and kind not in shares:
            raise WorkspaceError(
                f"{workspace.stereo_path / 'depth_maps'}: no {kind} map of a refined "
                f"image, but there are: {', '.join(shares)}; choose one of these with "
                f"--{name}."
            )
    free = [kind for kind in shares if kind not in chosen.values()]
    candidates = {
        "filtered": [kind for kind in free if shares[kind] < FILTERED_SHARE],
        "unfiltered": [kind for kind in free if shares[kind] >= FILTERED_SHARE],
    }
    for name, kinds in candidates.items():
        if kinds and not chosen[name]:
            chosen[name] = _PREFERRED if _PREFERRED in kinds else kinds[0]
    return {name: kind for name, kind in chosen.items() if kind}


def _initial_file(workspace: Workspace, view: View, kind: str) -> MapFiles:
    return MapFiles(
        view=view,
        image_path=workspace.image_path(view.name),
        depth_path=map_path(workspace, view.name, kind),
        normal_path=original_map_path(workspace.normal_map_path(view.name, kind)),
        masks=workspace.masks,
    )


MAX_NUM_BYTES = 512 << 20
"""Size of the cache of maps; each is compared with those of several views."""


class MethodMaps(Sequence[ViewMaps]):
    """The maps of the compared views; the latest stay in memory."""

    def __init__(self, methods: Sequence[Method], min_confidence: float = 0.0) -> None:
        """Read nothing yet; depth below that confidence counts as none."""
        self._methods = methods
        self._min_confidence = min_confidence
        self._cache = RecentCache(MAX_NUM_BYTES)

    def __len__(self) -> int:
        """The number of views."""
        return len(self._methods[0].files)

    def __getitem__(self, index: int) -> ViewMaps:  # type: ignore[override] # no slices
        """The maps of a view at the largest size; WorkspaceError if one is broken."""
        files = {method.name: method.files[index] for method in self._methods}
        depths = {name: self._depth(name, file) for name, file in files.items()}
        height_px, width_px = max(depth.shape for depth in depths.values())
        size_px = (width_px, height_px)
        view = self._methods[0].files[index].view
        return ViewMaps(
            view=view,
            K=index_K(view.camera.resized(width_px, height_px)),
            depths={name: nearest_resized(it, size_px) for name, it in depths.items()},
        )

    def _depth(self, method: str, file: MapFiles) -> DepthMap:
        key = (method, file.view.name)
        return self._cache.get(key, lambda: confident_depth(file, self._min_confidence))


def confident_depth(file: MapFiles, min_confidence: float) -> DepthMap:
    """The depth map of a view, shape (H, W); 0 where the confidence is lower.

    Without a confidence map, all depth is kept. WorkspaceError if a map is broken.
    """
    depth = file.read_depth()
    path = file.confidence_path
    if min_confidence > 0 and path is not None and path.is_file():
        depth = np.where(read_depth_map(path) >= min_confidence, depth, np.float32(0))
    return depth
