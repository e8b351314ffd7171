"""Which initial maps of a workspace are ours, and from what they were made."""

import hashlib
import json

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.output import read_record, write_record
from resdepth_colmap.io.workspace import Workspace
from resdepth_colmap.scene import Scene

KIND = "photometric"
LEDGER_NAME = "resdepth-stereo.json"

UNFINISHED = ""
"""As a fingerprint: these maps are being written. As a name: so is the whole."""


class StereoLedger:
    """Which maps are ours, from what they were made, and whether all of them are."""

    def __init__(self, workspace: Workspace) -> None:
        """Read the ledger of a workspace, empty if there is none."""
        self.workspace = workspace
        self.path = workspace.stereo_path / LEDGER_NAME
        self._fingerprints = read_record(self.path)

    @property
    def is_unfinished(self) -> bool:
        """Whether matching was interrupted."""
        return UNFINISHED in self._fingerprints

    def is_kept(self, name: str, fingerprint: str) -> bool:
        """Whether both maps are there, and are others' or ours from the same input."""
        depth_path = self.workspace.depth_map_path(name, KIND)
        normal_path = self.workspace.normal_map_path(name, KIND)
        if name not in self._fingerprints:
            return depth_path.exists()
        there = depth_path.exists() and normal_path.exists()
        return there and self._fingerprints[name] == fingerprint

    def start(self) -> None:
        """Matching begins."""
        self.add(UNFINISHED, UNFINISHED)

    def add(self, name: str, fingerprint: str) -> None:
        """The maps of an image are ours, made from what the fingerprint says."""
        self._fingerprints[name] = fingerprint
        write_record(self.path, self._fingerprints)

    def finish(self) -> None:
        """Matching is over."""
        del self._fingerprints[UNFINISHED]
        write_record(self.path, self._fingerprints)


def stereo_fingerprint(
    workspace: Workspace,
    scene: Scene,
    index: int,
    sources: tuple[int, ...],
    config: StereoConfig,
) -> str:
    """A hash of all that the maps of a view are made from."""
    digest = hashlib.sha256(json.dumps(config.to_mapping(), sort_keys=True).encode())
    for other in (index, *sources):
        view = scene.views[other]
        status = workspace.image_path(view.name).stat()
        digest.update(f"{view.name} {status.st_size} {status.st_mtime_ns}".encode())
        digest.update(view.cam_from_world.tobytes())
        digest.update(repr(view.camera).encode())
    return digest.hexdigest()
