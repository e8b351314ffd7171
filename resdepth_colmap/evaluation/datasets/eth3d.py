"""Stereo pairs of ETH3D as samples, by the protocol of the paper.

The undistorted images are resized to a width of 886 pixels; the first image of a pair
is matched against the second one alone.
"""

import dataclasses
import functools
from pathlib import Path
from typing import Any

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.eth3d_pairs import (
    NUM_PAIRS,
    PAIRS_NAME,
    Pair,
    choose_pairs,
    named_pairs,
    read_pairs,
)
from resdepth_colmap.evaluation.datasets.eth3d_truth import undistorted_truth
from resdepth_colmap.evaluation.datasets.paper import PAPER_IMAGE_WIDTH_PX, PAPER_ROWS
from resdepth_colmap.evaluation.datasets.sample import (
    DepthSample,
    LazySample,
    SampleOptions,
    SceneSource,
)
from resdepth_colmap.geometry.depth_range import depth_range
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.resize import area_resized
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.eth3d import (
    DISTORTED,
    DOWNLOADS,
    UNDISTORTED,
    DistortedView,
    Eth3dScene,
    find_eth3d_scenes,
    read_distorted_views,
)
from resdepth_colmap.io.images import read_gray, read_unit_colors
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.pipeline.view_images import camera_at_scale
from resdepth_colmap.scene import Camera, Scene, UnitColors, View


@dataclasses.dataclass(frozen=True, kw_only=True)
class Eth3dOptions:
    """Which samples of ETH3D to read.

    Attributes:
        scenes: Names of the scenes; () = all in the root.
        pairs_path: File of the pairs; None = `pairs.txt` in the root, if present.
        num_pairs: Number of pairs of a scene that the file does not list; None = as in
            the paper, or 4 for other scenes.
        image_width_px: Longest side of the images; they are never enlarged.
    """

    scenes: tuple[str, ...] = ()
    pairs_path: Path | None = None
    num_pairs: int | None = None
    image_width_px: int = PAPER_IMAGE_WIDTH_PX

    def pairs_file(self, root: Path) -> Path | None:
        """The file that lists the pairs; None if there is none."""
        if self.pairs_path is not None:
            return self.pairs_path
        return root / PAIRS_NAME if (root / PAIRS_NAME).is_file() else None

    def protocol(self, root: Path) -> dict[str, Any]:
        """The protocol, for the result, ready for JSON."""
        path = self.pairs_file(root)
        return {
            "image_width_px": self.image_width_px,
            "pairs": "chosen by rule" if path is None else f"of {path.name}",
        }


def eth3d_sources(root: Path, options: Eth3dOptions) -> tuple[SceneSource, ...]:
    """The scenes to read; reading a scene that is not in the root fails.

    Raises:
        WorkspaceError: If there is no scene, or the file of pairs is malformed.
    """
    scenes = {scene.name: scene for scene in find_eth3d_scenes(root)}
    path = options.pairs_file(root)
    listed = {} if path is None else read_pairs(path)

    def read(name: str, wanted: SampleOptions) -> list[LazySample]:
        if name not in scenes:
            raise WorkspaceError(
                f"{root}: no scene {name}; there are: {', '.join(scenes)}; "
                f"download {name} from {DOWNLOADS}."
            )
        reader = _SceneReader(scenes[name], options.image_width_px)
        if path is not None and name in listed:
            pairs = named_pairs(path, listed[name], reader.indices)
        else:
            pairs = reader.pairs_by_rule(options.num_pairs)
        return [functools.partial(reader.sample, pair, wanted) for pair in pairs]

    names = dict.fromkeys(options.scenes or scenes)
    return tuple(
        SceneSource(name=name, read=functools.partial(read, name)) for name in names
    )


class _SceneReader:
    """A scene with its models."""

    def __init__(self, files: Eth3dScene, image_width_px: int) -> None:
        files.check_parts()
        self.files = files
        self.image_width_px = image_width_px
        self.scene: Scene = read_scene(
            files.undistorted_model_path, files.images_path, files.path
        )
        self.distorted = read_distorted_views(files.distorted_model_path)
        self.indices = {
            _file_name(view): index for index, view in enumerate(self.scene.views)
        }

    def pairs_by_rule(self, num_pairs: int | None) -> tuple[Pair, ...]:
        """Pairs whose reference has ground truth; WorkspaceError if there are none."""
        paper = PAPER_ROWS.get(self.files.name)
        num_pairs = num_pairs or (paper.num_pairs if paper else NUM_PAIRS)
        truth_path, indices = self.files.truth_path, self.indices
        references = [indices[name] for name in indices if truth_path(name).is_file()]
        pairs = choose_pairs(self.scene, references, num_pairs)
        if not pairs:
            raise WorkspaceError(
                f"{self.files.path}: no pair of high overlap among the "
                f"{len(references)} of {len(indices)} images with ground truth; "
                f"list pairs in {PAIRS_NAME}."
            )
        return pairs

    def sample(self, pair: Pair, wanted: SampleOptions) -> DepthSample:
        """Read the images and the ground truth of a pair."""
        reference, source = (self.scene.views[index] for index in pair)
        camera = self._camera(reference)
        near, far = wanted.stereo.depth_min, wanted.stereo.depth_max
        if near <= 0:
            near, far = depth_range(self.scene, pair.reference, [pair.source])
        distorted = self._distorted(reference)
        truth = undistorted_truth(self.files, distorted, reference, camera)
        if not truth.any():
            raise WorkspaceError(
                f"{self.files.truth_path(_file_name(reference))}: none of its depths "
                f"projects into the undistorted image; {DISTORTED} is of other images."
            )
        return DepthSample(
            name=f"{_file_name(reference)} {_file_name(source)}",
            reference=self._match_view(reference),
            sources=(self._match_view(source),),
            depth_range=(near, far),
            truth=truth,
            colors=self._colors(reference),
            source_colors=(self._colors(source),),
        )

    def _distorted(self, view: View) -> DistortedView:
        name = _file_name(view)
        if name not in self.distorted:
            raise WorkspaceError(
                f"{self.files.distorted_model_path}: no image {name}, but the "
                f"undistorted model has it; unpack {self.files.name}_dslr_jpg.7z anew."
            )
        return self.distorted[name]

    def _camera(self, view: View) -> Camera:
        longest_px = max(view.camera.width_px, view.camera.height_px)
        return camera_at_scale(view.camera, min(1.0, self.image_width_px / longest_px))

    def _colors(self, view: View) -> UnitColors:
        camera = self._camera(view)
        colors = read_unit_colors(self.files.image_path(view.name))
        return area_resized(colors, (camera.width_px, camera.height_px))

    def _match_view(self, view: View) -> MatchView:
        path = self.files.image_path(view.name)
        gray = read_gray(path)
        height_px, width_px = gray.shape
        if (width_px, height_px) != (view.camera.width_px, view.camera.height_px):
            raise WorkspaceError(
                f"{path}: the image has {width_px} x {height_px} pixels, but its "
                f"camera in {UNDISTORTED}/ {view.camera.width_px} x "
                f"{view.camera.height_px}; unpack both from one archive."
            )
        camera = self._camera(view)
        return MatchView(
            gray=area_resized(gray, (camera.width_px, camera.height_px)),
            K=index_K(camera),
            cam_from_world=view.cam_from_world,
        )


def _file_name(view: View) -> str:
    return view.name.rpartition("/")[2]
