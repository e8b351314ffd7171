"""Which maps of a workspace's `stereo/` are ours, and from what they were made."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.io.colmap.masks import mask_file
from resdepth_colmap.io.colmap.output import read_record, write_record
from resdepth_colmap.io.colmap.workspace import Workspace
from resdepth_colmap.matching.patch_match import METHOD
from resdepth_colmap.pipeline.stereo.plan import StereoPlan
from resdepth_colmap.scene import Scene

PHOTOMETRIC = "photometric"
GEOMETRIC = "geometric"
LEDGER_NAME = "resdepth-stereo.json"

UNFINISHED = ""
"""As a fingerprint: these maps are being written. As a name: so is the whole."""


_SAID_OTHERWISE = (
    "cache_size",
    "depth_max",
    "depth_min",
    "mask_path",
    "max_num_sources",
    "min_triangulation_angle",
)
"""Options that decide nothing, or only what is part of a fingerprint itself."""


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

    def is_ours(self, name: str, kind: str) -> bool:
        """Whether the maps of that kind are ours, or there are none yet."""
        depth_path = self.workspace.depth_map_path(name, kind)
        return _key(name, kind) in self._fingerprints or not depth_path.exists()

    def is_kept(self, name: str, kind: str, fingerprint: str) -> bool:
        """Whether both maps are there, and are others' or ours from the same input."""
        if not self.is_ours(name, kind):
            return True
        depth_path = self.workspace.depth_map_path(name, kind)
        normal_path = self.workspace.normal_map_path(name, kind)
        there = depth_path.exists() and normal_path.exists()
        return there and self._fingerprints.get(_key(name, kind)) == fingerprint

    def start(self) -> None:
        """Matching begins."""
        self._fingerprints[UNFINISHED] = UNFINISHED
        write_record(self.path, self._fingerprints)

    def add(self, name: str, kind: str, fingerprint: str) -> None:
        """The maps of an image are ours, made from what the fingerprint says."""
        self._fingerprints[_key(name, kind)] = fingerprint
        write_record(self.path, self._fingerprints)

    def finish(self) -> None:
        """Matching is over."""
        del self._fingerprints[UNFINISHED]
        write_record(self.path, self._fingerprints)


class Fingerprints:
    """Hashes of all that the maps of a view are made from."""

    def __init__(
        self,
        scene: Scene,
        plans: Sequence[StereoPlan],
        config: StereoConfig,
        ledger: StereoLedger,
    ) -> None:
        """Of a scene matched as planned, with that configuration."""
        self.scene = scene
        self.plans = {plan.index: plan for plan in plans}
        self.config = config
        self.ledger = ledger

    def are_kept(self, plan: StereoPlan, kind: str) -> bool:
        """Whether a view's maps are there, and are others' or ours and unchanged."""
        name = self.scene.views[plan.index].name
        return self.ledger.is_kept(name, kind, self.of(plan, kind))

    def of(self, plan: StereoPlan, kind: str) -> str:
        """The hash for a view's maps of that kind."""
        if kind == PHOTOMETRIC:
            return self._photometric(plan)
        indices = (plan.index, *plan.sources)
        maps = [self._map(index, self.plans.get(index)) for index in indices]
        views = [self._view(index) for index in indices]
        return _hash([self._options(kind), plan.depth_range, views, maps])

    def _photometric(self, plan: StereoPlan) -> str:
        views = [self._view(index) for index in (plan.index, *plan.sources)]
        facts = [self._options(PHOTOMETRIC), plan.depth_range, views]
        return _hash([*facts, self._mask(plan.index)])

    def _map(self, index: int, plan: StereoPlan | None) -> Any:
        """What tells one photometric map from another: its input, or its file."""
        name = self.scene.views[index].name
        if plan is not None and self.ledger.is_ours(name, PHOTOMETRIC):
            return self._photometric(plan)
        return _stamp(self.ledger.workspace.depth_map_path(name, PHOTOMETRIC))

    def _view(self, index: int) -> list[Any]:
        view = self.scene.views[index]
        stamp = _stamp(self.ledger.workspace.image_path(view.name))
        return [view.name, stamp, view.cam_from_world.tolist(), repr(view.camera)]

    def _mask(self, index: int) -> Any:
        folder = self.config.mask_path
        if folder is None:
            return None
        return _stamp(mask_file(folder, self.scene.views[index].name))

    def _options(self, kind: str) -> dict[str, Any]:
        """Those that decide the maps of that kind."""
        options = self.config.to_mapping()
        idle = list(_SAID_OTHERWISE)
        is_first_of_two = kind == PHOTOMETRIC and self.config.geom_consistency
        if is_first_of_two or not self.config.filter:
            idle += [name for name in options if name.startswith("filter")]
            idle.append("write_consistency_graph")
        if kind == PHOTOMETRIC:
            idle += [name for name in options if name.startswith("geom_consistency")]
        deciding = {name: options[name] for name in options if name not in idle}
        return {"method": METHOD, **deciding}


def _key(name: str, kind: str) -> str:
    return f"{name}.{kind}"


def _hash(facts: Any) -> str:
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _stamp(path: Path) -> tuple[int, int] | None:
    """Size and time of a file; None if it is not there: no file is read."""
    if not path.is_file():
        return None
    status = path.stat()
    return status.st_size, status.st_mtime_ns
