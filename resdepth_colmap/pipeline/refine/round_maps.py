"""Depth maps of the rounds before the last one, kept until that one is done."""

import dataclasses
import shutil
from pathlib import Path

from resdepth_colmap.io.colmap.depth_map import read_depth_map, write_depth_map
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.scene import DepthMap


@dataclasses.dataclass(frozen=True, kw_only=True)
class EarlierMaps:
    """A folder of maps, each named after its image and all that it depends on.

    Attributes:
        folder: Where they are; it is made when it is needed.
    """

    folder: Path

    def has(self, name: str, fingerprint: str) -> bool:
        """Whether the map of an image with that fingerprint is there."""
        return self._path(name, fingerprint).is_file()

    def read(self, name: str, fingerprint: str) -> DepthMap | None:
        """The map, shape (H, W), in units, 0 = hole; None if it is not there.

        Raises:
            WorkspaceError: If it cannot be read.
        """
        path = self._path(name, fingerprint)
        return read_depth_map(path) if path.is_file() else None

    def write(self, name: str, fingerprint: str, depth: DepthMap) -> None:
        """Keep a map, whole or not at all.

        Raises:
            WorkspaceError: If it cannot be written.
        """
        write_depth_map(self._path(name, fingerprint), depth)

    def forget(self) -> None:
        """Delete them all."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, name: str, fingerprint: str) -> Path:
        return self.folder / f"{safe_name(name)}.{fingerprint[:16]}.bin"
