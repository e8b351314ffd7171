"""Where refined maps go: a new COLMAP workspace, or the given one, in place."""

import contextlib
import dataclasses
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.cfg import (
    SourceKind,
    SourceSpec,
    write_fusion_cfg,
    write_patch_match_cfg,
)
from resdepth_colmap.io.colmap.maps import write_depth_map, write_normal_map
from resdepth_colmap.io.colmap.reconstruction import MODEL_PARTS
from resdepth_colmap.io.colmap.workspace import (
    ORIGINAL_SUFFIX,
    OUTPUT_FOLDER,
    Workspace,
)
from resdepth_colmap.io.files import (
    link_or_copy,
    reading,
    safe_name,
    whole_file,
    write_whole,
)
from resdepth_colmap.scene import DepthMap, FloatMap, NormalMap

KIND = "geometric"
"""Refined maps are called so, because COLMAP's fusion takes this kind by default."""

BACKDROP_FOLDER = "backdrop_masks"
"""In the output: masks of a uniform backdrop; they are made again where they lack."""

OVERVIEW_NAME = "overview.png"
"""The picture of all images of the workspace, in its output."""

_MODEL_FILES = frozenset(
    f"{part}{suffix}" for part in MODEL_PARTS for suffix in (".bin", ".txt")
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class OutputWorkspace:
    """The output for a workspace.

    Attributes:
        source: The user's workspace.
        in_place: Put the maps into the user's `stereo/`, keeping the originals beside
            them under `.original`, instead of into `resdepth/stereo/`.
    """

    source: Workspace
    in_place: bool = False

    @property
    def path(self) -> Path:
        """Folder of clouds, pictures and the run record: `WORKSPACE/resdepth`."""
        return self.source.path / OUTPUT_FOLDER

    @property
    def record_path(self) -> Path:
        """The run record, for `read_record` and `write_record`."""
        return self.path / "run.json"

    @property
    def workspace(self) -> Workspace:
        """The workspace that holds the refined maps: it can be fused."""
        if self.in_place:
            return self.source
        return Workspace(
            path=self.path,
            sparse_path=self.path / "sparse",
            images_path=self.path / "images",
            stereo_path=self.path / "stereo",
            masks=self.source.masks,
        )

    def depth_map_path(self, name: str) -> Path:
        """The refined depth map of an image."""
        return self.workspace.depth_map_path(name, KIND)

    def normal_map_path(self, name: str) -> Path:
        """The normal map of an image's refined depth."""
        return self.workspace.normal_map_path(name, KIND)

    def confidence_map_path(self, name: str) -> Path:
        """The confidence map of an image: one channel, 0..1, in COLMAP's map format."""
        file_name = f"{safe_name(name)}.{KIND}.bin"
        return self.workspace.stereo_path / "confidence_maps" / file_name

    def map_paths(self, name: str) -> tuple[Path, ...]:
        """All maps of an image that `write_maps` writes."""
        return (
            self.depth_map_path(name),
            self.normal_map_path(name),
            self.confidence_map_path(name),
        )

    def prepare(self, names: Sequence[str]) -> None:
        """Make the folders, and link images and model; doing it again is fine.

        Images without a file are left out. WorkspaceError if a folder or link cannot be
        made.
        """
        for folder in ("depth_maps", "normal_maps", "confidence_maps"):
            make_folder(self.workspace.stereo_path / folder)
        make_folder(self.path)
        if self.in_place:
            return
        for name in names:
            image_path = self.source.image_path(name)
            if image_path.is_file():
                link_or_copy(image_path, self.workspace.image_path(name))
        _link_model(self.source.sparse_path, self.workspace.sparse_path)

    def write_cfgs(
        self, names: Sequence[str], sources: Mapping[str, SourceSpec] | None = None
    ) -> None:
        """Write `fusion.cfg` and `patch-match.cfg`; in place, only where there is none.

        Args:
            names: The images that have a refined map, in the order of the fusion.
            sources: The sources of each; None: COLMAP's automatic choice.
        """
        automatic = SourceSpec(kind=SourceKind.AUTO, num_auto=20)
        sources = sources or dict.fromkeys(names, automatic)
        stereo_path = self.workspace.stereo_path
        if not (self.in_place and (stereo_path / "patch-match.cfg").exists()):
            write_patch_match_cfg(stereo_path / "patch-match.cfg", sources)
        if not (self.in_place and (stereo_path / "fusion.cfg").exists()):
            write_fusion_cfg(stereo_path / "fusion.cfg", names)

    def write_maps(
        self,
        name: str,
        depth: DepthMap,
        normals: NormalMap,
        confidence: FloatMap | None = None,
    ) -> None:
        """Write the maps of one image, each file whole or not at all.

        The depth map is written last: where it is, the others are too.

        Args:
            name: Image name, as in the model.
            depth: Refined depth, shape (H, W), float32; 0 = no depth.
            normals: Normals in the camera frame, shape (H, W, 3); (0, 0, 0) = none.
            confidence: Confidence, shape (H, W), 0..1; None = the network gives none.

        Raises:
            WorkspaceError: If a file cannot be written, or an original not be kept.
        """
        if self.in_place:
            _keep_original(self.depth_map_path(name))
            _keep_original(self.normal_map_path(name))
        if confidence is not None:
            write_depth_map(self.confidence_map_path(name), confidence)
        write_normal_map(self.normal_map_path(name), normals)
        write_depth_map(self.depth_map_path(name), depth)

    def is_written(self, name: str) -> bool:
        """Whether the refined depth and normal maps of an image are there.

        In place, a map is ours if something was kept for it (see `write_maps`).
        """
        paths = (self.depth_map_path(name), self.normal_map_path(name))
        if self.in_place and not all(_kept_path(path).is_file() for path in paths):
            return False
        return all(path.is_file() for path in paths)


def read_record(path: Path) -> dict[str, Any]:
    """Read a run record (`run.json`), {} if none; WorkspaceError if it is no object."""
    try:
        with reading(path):
            if not path.exists():
                return {}
            record = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise _no_record(path, str(error)) from error
    if not isinstance(record, dict):
        raise _no_record(path, "no JSON object")
    return record


def write_record(path: Path, mapping: Mapping[str, Any]) -> None:
    """Write a run record, whole or not at all; paths and enums become strings."""
    text = json.dumps(dict(mapping), indent=2, ensure_ascii=False, default=str)
    write_whole(path, (text + "\n").encode("utf-8"))


def _no_record(path: Path, reason: str) -> WorkspaceError:
    return WorkspaceError(
        f"{path}: not a run record ({reason}); delete it, and the next run starts anew."
    )


def make_folder(path: Path) -> None:
    """Make a folder and those above it, if missing.

    Raises:
        WorkspaceError: If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise WorkspaceError(
            f"{path}: cannot make the folder ({reason}); check the permissions, "
            "and that no file is in its place."
        ) from error


def _link_model(source_path: Path, target_path: Path) -> None:
    linked = set()
    for path in source_path.iterdir():
        if path.name in _MODEL_FILES:
            link_or_copy(path, target_path / path.name)
            linked.add(path.name)
    # COLMAP prefers .bin to .txt: what an earlier model left would be read instead.
    for name in _MODEL_FILES - linked:
        (target_path / name).unlink(missing_ok=True)


def _kept_path(path: Path) -> Path:
    return path.with_name(path.name + ORIGINAL_SUFFIX)


def _keep_original(path: Path) -> None:
    """Keep a map before the first time it is replaced, and never again.

    Where there is no map, an empty file is kept: without it, a second run would take
    the first one's refined map for the original.
    """
    kept = _kept_path(path)
    if kept.exists():
        return
    if not path.exists():
        write_whole(kept, b"")
        return
    # No symbolic link: it would show the refined map as soon as that is in its place.
    with whole_file(kept) as partial:
        with contextlib.suppress(OSError):
            os.link(path.resolve(), partial)
        if not partial.exists():
            shutil.copy2(path, partial)
