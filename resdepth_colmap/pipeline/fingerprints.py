"""Digests of files and maps, each read once as long as its file stays as it is."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map


class MapFacts(NamedTuple):
    """What is known of a depth map.

    Attributes:
        digest: Of its size and its depths.
        filled: Share of its pixels that have a depth, in 0..1.
        size_px: Width and height.
    """

    digest: str
    filled: float
    size_px: tuple[int, int]


class Fingerprints:
    """Digests of files below, and beside, a folder.

    A file is read again when its size, its times, or its place on the disk have
    changed. The time of the last change cannot be set by a program that copies files
    with their dates.
    """

    def __init__(self, folder: Path, known: Mapping[str, Mapping[str, Any]]) -> None:
        """Take over what an earlier run knew.

        Args:
            folder: Paths are kept relative to it, so that a workspace may be moved.
            known: What `all` gave, by "file".
        """
        self._folder = folder
        self._known = {name: dict(facts) for name, facts in known.items()}
        self._news: dict[str, dict[str, Any]] = {}

    @property
    def has_news(self) -> bool:
        """Whether anything was found since the last call of `news`."""
        return bool(self._news)

    def relative(self, path: Path) -> str:
        """The path as it is kept: relative to the folder."""
        return os.path.relpath(path, self._folder).replace(os.sep, "/")

    def of(self, path: Path) -> str:
        """Digest of a file's bytes.

        Raises:
            WorkspaceError: If it cannot be read.
        """
        facts = self._facts(path)
        if not isinstance(facts.get("digest"), str):
            facts["digest"] = _digest(path)
            self._note(facts)
        return str(facts["digest"])

    def of_map(self, path: Path) -> MapFacts:
        """Digest of a depth map, and how much of it is filled.

        Raises:
            WorkspaceError: If it is no depth map.
        """
        facts = self._facts(path)
        if not _has_map_facts(facts):
            depth = read_depth_map(path)
            hasher = hashlib.sha256(repr(depth.shape).encode())
            hasher.update(np.ascontiguousarray(depth).data)
            facts["map"] = hasher.hexdigest()
            facts["filled"] = float(np.count_nonzero(depth) / depth.size)
            facts["size_px"] = [depth.shape[1], depth.shape[0]]
            self._note(facts)
        width_px, height_px = facts["size_px"]
        return MapFacts(facts["map"], facts["filled"], (width_px, height_px))

    def all(self) -> list[dict[str, Any]]:
        """What is known, fit for JSON; none of it is news any more."""
        self._news.clear()
        return [dict(facts) for facts in self._known.values()]

    def news(self) -> list[dict[str, Any]]:
        """What was found since the last call, fit for JSON."""
        news = [dict(facts) for facts in self._news.values()]
        self._news.clear()
        return news

    def _facts(self, path: Path) -> dict[str, Any]:
        """What is known of the file as it is now."""
        name, stamp = self.relative(path), _stamp(path)
        facts = self._known.get(name, {})
        if facts.get("stamp") != stamp:
            facts = {"file": name, "stamp": stamp}
        return facts

    def _note(self, facts: dict[str, Any]) -> None:
        self._known[facts["file"]] = self._news[facts["file"]] = facts


def _has_map_facts(facts: Mapping[str, Any]) -> bool:
    size_px = facts.get("size_px")
    return (
        isinstance(facts.get("map"), str)
        and isinstance(facts.get("filled"), float)
        and isinstance(size_px, list)
        and [type(value) for value in size_px] == [int, int]
    )


def _stamp(path: Path) -> list[int]:
    try:
        status = path.stat()
    except OSError as error:
        raise _unreadable(path, error) from error
    times = [status.st_mtime_ns, status.st_ctime_ns]
    return [status.st_size, *times, status.st_ino]


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> WorkspaceError:
    reason = error.strerror or str(error)
    return WorkspaceError(f"{path}: cannot read it ({reason}).")
