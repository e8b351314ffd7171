"""Matched depth, kept between measurements: matching takes longest, and seldom changes.

A file is named after a hash of all that its depth depends on, the matcher's own source
included: a matcher that has changed is never measured by its old depth.
"""

import dataclasses
import hashlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import resdepth_colmap.matching
from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap

_HASH_LENGTH = 16
_FORMAT = 2
_SOURCE = "source_{}"


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Matching:
    """What the matcher found, and what that cost.

    Attributes:
        depth: Shape (H, W), float32, in workspace units; all > 0.
        cpu_s: Processor seconds of all threads.
        source_depths: What was found in the sources, in their order; maybe nothing.
    """

    depth: DepthMap
    cpu_s: float
    source_depths: tuple[DepthMap, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchCache:
    """A folder of matched depth maps.

    Attributes:
        folder: Where the files are; it is made when it is needed.
    """

    folder: Path

    def find(
        self,
        name: str,
        views: Sequence[MatchView],
        depth_range: tuple[float, float],
        config: StereoConfig,
    ) -> Matching | None:
        """What `add` was given for the same input; None if it was given nothing."""
        path = self._path(name, views, depth_range, config)
        if not path.is_file():
            return None
        with np.load(path) as file:
            names = [_SOURCE.format(index) for index in range(len(views) - 1)]
            return Matching(
                depth=file["depth"],
                cpu_s=float(file["cpu_s"]),
                source_depths=tuple(file[name] for name in names if name in file),
            )

    def add(
        self,
        name: str,
        views: Sequence[MatchView],
        depth_range: tuple[float, float],
        config: StereoConfig,
        matching: Matching,
    ) -> None:
        """Keep a result.

        Raises:
            WorkspaceError: If the file cannot be written.
        """
        data = io.BytesIO()
        arrays: dict[str, Any] = {
            _SOURCE.format(index): depth
            for index, depth in enumerate(matching.source_depths)
        }
        np.savez(data, depth=matching.depth, cpu_s=matching.cpu_s, **arrays)
        write_whole(self._path(name, views, depth_range, config), data.getvalue())

    def _path(
        self,
        name: str,
        views: Sequence[MatchView],
        depth_range: tuple[float, float],
        config: StereoConfig,
    ) -> Path:
        text = json.dumps([_FORMAT, config.to_mapping(), depth_range], sort_keys=True)
        digest = hashlib.sha256(text.encode())
        for view in views:
            for array in (view.gray, view.K, view.cam_from_world):
                digest.update(str(array.shape).encode() + array.tobytes())
        for folder in resdepth_colmap.matching.__path__:
            for source in sorted(Path(folder).glob("*.py")):
                digest.update(source.read_bytes())
        return self.folder / f"{name}-{digest.hexdigest()[:_HASH_LENGTH]}.npz"
