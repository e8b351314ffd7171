"""A cache of matched depth maps, since matching is most of the time of an evaluation.

The name of a file has a hash of all inputs, which include the source of the matcher: a
changed matcher never gets the depth of an earlier one.
"""

import dataclasses
import hashlib
import io
import json
from collections.abc import Callable, Sequence
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
    """A matched depth map and its cost.

    Attributes:
        depth: Shape (H, W), float32, in workspace units; all > 0.
        cpu_s: Processor seconds of all threads.
        source_depths: Maps of the sources, in their order; () = none.
    """

    depth: DepthMap
    cpu_s: float
    source_depths: tuple[DepthMap, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class MatchCache:
    """A folder of matched depth maps.

    Attributes:
        folder: Where the files are; created when needed.
    """

    folder: Path

    def get(
        self,
        name: str,
        views: Sequence[MatchView],
        depth_range: tuple[float, float],
        config: StereoConfig,
        match: Callable[[], Matching],
    ) -> Matching:
        """The result of an earlier call for the same input, else of `match`.

        The file's name starts with `name`; WorkspaceError if it cannot be written.
        """
        path = self.folder / f"{name}-{_digest(views, depth_range, config)}.npz"
        if path.is_file():
            return _read(path)
        matching = match()
        data = io.BytesIO()
        sources = enumerate(matching.source_depths)
        arrays: dict[str, Any] = {_SOURCE.format(i): depth for i, depth in sources}
        np.savez(data, depth=matching.depth, cpu_s=matching.cpu_s, **arrays)
        write_whole(path, data.getvalue())
        return matching


def _digest(
    views: Sequence[MatchView], depth_range: tuple[float, float], config: StereoConfig
) -> str:
    text = json.dumps([_FORMAT, config.to_mapping(), depth_range], sort_keys=True)
    digest = hashlib.sha256(text.encode())
    for view in views:
        for array in (view.gray, view.K, view.cam_from_world):
            digest.update(str(array.shape).encode() + array.tobytes())
    for folder in resdepth_colmap.matching.__path__:
        for source in sorted(Path(folder).glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:_HASH_LENGTH]


def _read(path: Path) -> Matching:
    with np.load(path) as file:
        num_sources = len(file.files) - 2
        return Matching(
            depth=file["depth"],
            cpu_s=float(file["cpu_s"]),
            source_depths=tuple(file[_SOURCE.format(i)] for i in range(num_sources)),
        )
