"""What was made from what: the only judge of whether a result is fresh.

A manifest stands in the folder of the results. It holds one JSON object a line; of the
lines about one result the last one counts. Adding a line costs the same however long
the manifest is, and a line that an interruption cut off is as if it was never written.
"""

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import write_whole, writing
from resdepth_colmap.pipeline.fingerprints import Fingerprints
from resdepth_colmap.scene import View

MANIFEST_NAME = "resdepth-manifest.jsonl"

IN_PROGRESS = ""
"""The key of a result that is being written."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task:
    """One result to make.

    Attributes:
        stage: The stage that makes it.
        name: What it is called there: the image, the cloud.
        key: Hash of all that the result depends on.
        writes: Its files.
    """

    stage: str
    name: str
    key: str
    writes: tuple[Path, ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Entry:
    """What the manifest knows of a result.

    Attributes:
        key: That of the task which made it; `IN_PROGRESS` while it is made.
        files: Digest of each of its files as it was written, by its path relative to
            the folder of the manifest; empty while it is made.
        facts: What is worth knowing of it, fit for JSON.
    """

    key: str
    files: Mapping[str, str]
    facts: Mapping[str, Any]


class Manifest:
    """The results of a folder.

    Attributes:
        path: Its file; it is made with the first entry.
        fingerprints: Of files, remembered from run to run.
    """

    def __init__(self, folder: Path) -> None:
        """Read what is there.

        Args:
            folder: That of the results.

        Raises:
            WorkspaceError: If the file is there and cannot be read.
        """
        self.path = folder / MANIFEST_NAME
        self._entries: dict[tuple[str, str], Entry] = {}
        self._is_compact = False
        known: dict[str, Any] = {}
        for line in _lines(self.path):
            if isinstance(line.get("file"), str):
                known[line["file"]] = line
            elif (entry := _entry(line)) is not None:
                self._entries[line["stage"], line["name"]] = entry
            elif line.get("forget") is not None:
                self._drop(str(line["forget"]))
        self.fingerprints = Fingerprints(folder, known)

    def is_fresh(self, task: Task) -> bool:
        """Whether a result is there, made from just this, and nobody changed it."""
        entry = self._entries.get((task.stage, task.name))
        if entry is None or entry.key != task.key:
            return False
        return all(self._is_as_written(entry, path) for path in task.writes)

    def is_ours(self, task: Task) -> bool:
        """Whether the files of a task are of this program, or not there at all.

        A file that somebody else has put in the place of ours is not.
        """
        there = [path for path in task.writes if path.exists()]
        entry = self._entries.get((task.stage, task.name))
        if entry is None:
            return not there
        if entry.key == IN_PROGRESS:
            return True
        return all(self._is_as_written(entry, path) for path in there)

    def has_any(self, stage: str) -> bool:
        """Whether the stage has made anything here, or began to."""
        return any(entry_stage == stage for entry_stage, _ in self._entries)

    def has(self, stage: str, name: str) -> bool:
        """Whether the stage has made, or begun, a result of that name."""
        return (stage, name) in self._entries

    def facts_of(self, stage: str) -> list[dict[str, Any]]:
        """What was noted of each result of a stage, the latest last."""
        entries = self._entries.items()
        return [dict(entry.facts) for key, entry in entries if key[0] == stage]

    def facts(self, task: Task) -> dict[str, Any]:
        """What was noted of a result; {} if there is none."""
        entry = self._entries.get((task.stage, task.name))
        return dict(entry.facts) if entry else {}

    def written_digest(self, path: Path) -> str | None:
        """Digest of a file as it was written; None: it is not known as a result."""
        name = self.fingerprints.relative(path)
        digests = (entry.files.get(name) for entry in self._entries.values())
        return next((digest for digest in digests if digest is not None), None)

    def start(self, task: Task, facts: Mapping[str, Any] | None = None) -> None:
        """A result is about to be written: nothing vouches for its files any more."""
        self._add(task, Entry(key=IN_PROGRESS, files={}, facts=dict(facts or {})))

    def finish(self, task: Task, facts: Mapping[str, Any] | None = None) -> None:
        """A result is there.

        Args:
            task: What made it.
            facts: What is worth knowing of it, fit for JSON.

        Raises:
            WorkspaceError: If the manifest cannot be written.
        """
        files = {
            self.fingerprints.relative(path): self.fingerprints.of(path)
            for path in task.writes
            if path.is_file()
        }
        self._add(task, Entry(key=task.key, files=files, facts=dict(facts or {})))

    def forget(self, stage: str) -> None:
        """Forget all results of a stage; its files are deleted elsewhere."""
        if self.has_any(stage):
            self._drop(stage)
            self._append([{"forget": stage}])

    def save(self) -> None:
        """Write the fingerprints that were found, so that no file is read again.

        Raises:
            WorkspaceError: If the manifest cannot be written.
        """
        if self.fingerprints.has_news:
            self._append([])

    def _drop(self, stage: str) -> None:
        kept = {key: value for key, value in self._entries.items() if key[0] != stage}
        self._entries = kept

    def _is_as_written(self, entry: Entry, path: Path) -> bool:
        digest = entry.files.get(self.fingerprints.relative(path))
        return (
            digest is not None
            and path.is_file()
            and self.fingerprints.of(path) == digest
        )

    def _add(self, task: Task, entry: Entry) -> None:
        self._entries.pop((task.stage, task.name), None)  # the latest is the last
        self._entries[task.stage, task.name] = entry
        self._append([_line(task.stage, task.name, entry)])

    def _append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        text = _text([*self.fingerprints.news(), *lines])
        if not self._is_compact:  # once a run: a cut line goes, and what is outdated
            self._is_compact = True
            entries = (_line(*key, entry) for key, entry in self._entries.items())
            write_whole(self.path, _text([*self.fingerprints.all(), *entries]))
            return
        with writing(self.path), self.path.open("ab") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())


def key_of(facts: Any) -> str:
    """Hash of plain values, to tell one input of a result from another."""
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def view_facts(view: View) -> list[Any]:
    """What a result depends on of a view: name, camera and pose."""
    camera = dataclasses.asdict(view.camera)
    return [view.name, camera, view.cam_from_world.tolist()]


def _lines(path: Path) -> list[dict[str, Any]]:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return []
    except OSError as error:
        reason = error.strerror or str(error)
        raise WorkspaceError(
            f"{path}: cannot read it ({reason}); delete it, and all is made again."
        ) from error
    found = []
    for line in text.splitlines():
        try:
            value = json.loads(line)
        except (ValueError, RecursionError):
            continue  # cut off by an interruption, or not ours: as if it was not there
        if isinstance(value, dict):
            found.append(value)
    return found


def _entry(line: Mapping[str, Any]) -> Entry | None:
    strings = all(isinstance(line.get(name), str) for name in ("stage", "name", "key"))
    files, facts = line.get("files"), line.get("facts")
    if not (strings and isinstance(files, dict) and isinstance(facts, dict)):
        return None
    entry = Entry(key=line["key"], files=files, facts=facts)
    is_whole = line == _line(line["stage"], line["name"], entry)
    return entry if is_whole else None  # damaged, or of another version


def _line(stage: str, name: str, entry: Entry) -> dict[str, Any]:
    line = {"stage": stage, "name": name, **dataclasses.asdict(entry)}
    return {**line, "check": key_of(line)[:16]}


def _text(lines: Iterable[Mapping[str, Any]]) -> bytes:
    return "".join(json.dumps(dict(line)) + "\n" for line in lines).encode()
