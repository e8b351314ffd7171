"""The compared methods: which maps of a workspace are filtered, and which are not."""

import dataclasses
import shlex
from collections.abc import Mapping, Sequence

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.compare.config import CompareConfig
from resdepth_colmap.io.colmap.depth_map import read_depth_map, read_map_size
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import Workspace, original_map_path
from resdepth_colmap.pipeline.fuse.stage import refined_files
from resdepth_colmap.pipeline.fuse.views import MapFiles
from resdepth_colmap.pipeline.initial_map import choose_initial_map, map_path
from resdepth_colmap.pipeline.masks import wanted_pixels
from resdepth_colmap.pipeline.refine.cross_view import FILTERED_SHARE
from resdepth_colmap.scene import Scene, View

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

    @property
    def own_normals(self) -> bool:
        """Whether every view has a normal map; else they come from the depth."""
        return all(
            file.normal_path is not None and file.normal_path.is_file()
            for file in self.files
        )

    def to_mapping(self) -> dict[str, str]:
        """Kind and normals, ready for JSON."""
        normals = "own" if self.own_normals else "computed from the depth"
        return {"kind": self.kind, "normals": normals}


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class FoundMethods:
    """The methods that a workspace has maps of.

    Attributes:
        methods: The refined maps, and the filtered or unfiltered ones or both, of the
            same views.
        notes: What is missing.
    """

    methods: tuple[Method, ...]
    notes: tuple[str, ...]

    @property
    def views(self) -> tuple[View, ...]:
        """The compared views: every method has a map of each."""
        return tuple(file.view for file in self.methods[0].files)


def find_methods(
    output: OutputWorkspace, scene: Scene, config: CompareConfig
) -> FoundMethods:
    """Find the methods of a workspace by the share of pixels that its maps fill.

    Args:
        output: Where the refined maps of the workspace are.
        scene: Its views.
        config: May name the kinds of map.

    Raises:
        WorkspaceError: If there are no refined maps, no initial ones, no view that has
            both, or a map is broken.
    """
    workspace = output.source
    refined = [view for view in scene.views if output.is_written(view.name)]
    if not refined:
        raise WorkspaceError(
            f"{output.workspace.stereo_path}: no refined map; run `resdepth-colmap "
            f"refine {shlex.quote(str(workspace.path))}` first."
        )
    kinds = {view.name: workspace.original_kinds(view.name) for view in refined}
    if not any(kinds.values()):
        raise WorkspaceError(
            f"{workspace.stereo_path / 'depth_maps'}: no depth map of any refined "
            "image, so there is nothing to compare the refined maps with; make some "
            "with `resdepth-colmap stereo`."
        )
    chosen = _chosen_kinds(workspace, _filled_shares(workspace, refined, kinds), config)
    compared = [v for v in refined if set(chosen.values()) <= set(kinds[v.name])]
    if not compared:
        named = " and ".join(chosen.values())
        raise WorkspaceError(
            f"{workspace.stereo_path / 'depth_maps'}: no image has {named} maps and a "
            "refined one; refine more images, or choose with --filtered and "
            "--unfiltered."
        )
    notes = [f"{name}: {text}" for name, text in _WITHOUT.items() if name not in chosen]
    if len(compared) < len(scene.views):
        notes.append(
            f"{len(compared)} of {len(scene.views)} views are compared: the others "
            "lack a map of some method."
        )
    compared_names = {view.name for view in compared}
    files = {
        name: tuple(_initial_file(workspace, view, kind) for view in compared)
        for name, kind in chosen.items()
    }
    files[REFINED] = tuple(
        file
        for file in refined_files(output, scene)
        if file.view.name in compared_names
    )
    return FoundMethods(
        methods=tuple(
            Method(name=name, kind=chosen.get(name, REFINED), files=files[name])
            for name in METHODS
            if name in files
        ),
        notes=tuple(notes),
    )


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
