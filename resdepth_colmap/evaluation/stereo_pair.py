"""The scenes of the Middlebury benchmark, as dense workspaces of two views.

data/README.md says what a scene holds and where it comes from.
"""

import dataclasses
from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.io.depth_map import read_depth_map
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.io.model import read_scene
from resdepth_colmap.io.workspace import Workspace, open_workspace
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap, Matrix, Scene, View, cam_from_cam

REFERENCE_NAME = "im0.png"
SOURCE_NAME = "im1.png"
TRUTH_NAME = f"ground_truth/{REFERENCE_NAME}.bin"
SEEN_NAME = f"ground_truth/{REFERENCE_NAME}.nonoccluded.png"
_WAY_OUT = "data/README.md says what a scene of this benchmark holds"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class StereoPair:
    """One scene of the benchmark.

    Attributes:
        name: Its folder's name.
        reference: The view whose depth is known.
        source: The second view.
        source_from_reference: Pose, shape (3, 4), in metres.
        depth_range: Near and far depth to match between, in metres.
        truth: True depth of the reference, shape (H, W), in metres; 0 = not known.
        seen: Which pixels of the reference the source sees too, shape (H, W), bool.
    """

    name: str
    reference: MatchView
    source: MatchView
    source_from_reference: Matrix
    depth_range: tuple[float, float]
    truth: DepthMap
    seen: npt.NDArray[np.bool_]

    @property
    def megapixels(self) -> float:
        """Size of the reference, in millions of pixels."""
        return self.truth.size / 1e6


def scene_folders(folder: Path) -> tuple[Path, ...]:
    """The folders in a folder that are scenes with truth, sorted by name.

    Raises:
        WorkspaceError: If there is none.
    """
    truths = sorted(folder.glob(f"*/{TRUTH_NAME}"))
    if not truths:
        raise WorkspaceError(
            f"{folder}: no folder with {TRUTH_NAME} in it; {_WAY_OUT}."
        )
    return tuple(path.parents[1] for path in truths)


def read_pair(path: Path) -> StereoPair:
    """Read one scene.

    Raises:
        WorkspaceError: If the workspace or its truth is broken, lacks a view, or has
            maps and images of different sizes.
    """
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    indices = [_index(path, scene, name) for name in (REFERENCE_NAME, SOURCE_NAME)]
    reference, source = (scene.views[index] for index in indices)
    pair = StereoPair(
        name=path.name,
        reference=_match_view(workspace, reference),
        source=_match_view(workspace, source),
        source_from_reference=cam_from_cam(source, reference),
        depth_range=depth_range(scene, indices[0], indices[1:]),
        truth=read_depth_map(path / TRUTH_NAME),
        seen=read_gray(path / SEEN_NAME) == 1,  # 255; occluded pixels are grey
    )
    shapes = [pair.reference.gray.shape, pair.truth.shape, pair.seen.shape]
    if len(set(shapes)) > 1:
        raise WorkspaceError(
            f"{path}: image, true depth and mask of {REFERENCE_NAME} differ in size "
            f"(height, width: {shapes}); {_WAY_OUT}."
        )
    return pair


def _index(path: Path, scene: Scene, name: str) -> int:
    index = scene.index(name)
    if index < 0:
        raise WorkspaceError(f"{path}: its model has no image {name}; {_WAY_OUT}.")
    return index


def _match_view(workspace: Workspace, view: View) -> MatchView:
    return MatchView(
        gray=read_gray(workspace.image_path(view.name)),
        K=index_K(view.camera),
        cam_from_world=view.cam_from_world,
    )
