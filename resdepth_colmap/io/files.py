"""Atomic writing of files, links, and names that stay in their folder."""

import contextlib
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError

_CONTROL_CHARACTER = re.compile(r"[\x00-\x1f\x7f]")
_DRIVE = re.compile(r"[A-Za-z]:")


def write_whole(path: Path, data: bytes) -> None:
    """Write a file whole or not at all; its folder is made.

    An older file is replaced, a link never written through. WorkspaceError if the file
    cannot be written (no permission, disk full).
    """
    with whole_file(path) as partial:
        partial.write_bytes(data)


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary file to write; it becomes `path` when the block is left well.

    The temporary file lies in the same folder and has the same extension, for writers
    that choose the format by it. After an error in the block nothing is left behind.
    The folder of `path` is made.

    Raises:
        WorkspaceError: If the file cannot be written (no permission, disk full).
    """
    partial = path.parent / f".partial-{secrets.token_hex(8)}{path.suffix}"
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield partial
            _flush_to_disk(partial)
            partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make an OSError in the block a WorkspaceError that names the file to write."""
    try:
        yield
    except WorkspaceError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise WorkspaceError(
            f"{path}: cannot write ({reason}); "
            "check the permissions of its folder and the free space of the disk."
        ) from error


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Make an OSError in the block a WorkspaceError that names the file to read."""
    try:
        yield
    except WorkspaceError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise WorkspaceError(f"{path}: cannot be read ({reason}).") from error


def read_text(path: Path) -> str:
    """The text of a file; WorkspaceError if it cannot be read, or is not UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise WorkspaceError(f"{path}: cannot be read as text in UTF-8.") from error


def link_or_copy(source: Path, target: Path) -> None:
    """Make `target` show the content of `source` at the least cost.

    A hard link where the file system has them, else a symbolic link, else a copy.
    A target that is the same file already, or an unchanged copy, is left alone; any
    other one is replaced. The folder of `target` is made.

    Raises:
        WorkspaceError: If `source` is not a file or `target` cannot be made.
    """
    real_source = source.resolve()
    if not real_source.is_file():
        raise WorkspaceError(f"{source}: no such file, so it cannot be linked.")
    if _same_content(real_source, target):
        return
    with whole_file(target) as partial:
        try:
            os.link(real_source, partial)
        except OSError:
            _symlink_or_copy(real_source, partial)


def safe_name(name: str) -> str:
    """The same name, from a file we do not control, if it stays in its folder.

    Args:
        name: Relative path with "/" between folders, as in a COLMAP model.

    Raises:
        WorkspaceError: For a name that is empty, absolute, leads out of the folder
            (".."), in Unix or in Windows spelling, or holds control characters.
    """
    parts = re.split(r"[/\\]", name)
    wrong = (
        not parts[-1]
        or not parts[0]  # "/x", "\x": absolute
        or ".." in parts
        or parts[-1] == "."
        or _DRIVE.match(name) is not None
        or _CONTROL_CHARACTER.search(name) is not None
    )
    if wrong:
        raise WorkspaceError(
            f"image name {name!r} is empty, absolute or leads out of its folder; "
            "rename the image in the model (only names below images/ are read)."
        )
    return name


def _same_content(source: Path, target: Path) -> bool:
    try:
        old, new = source.stat(), target.stat()
    except OSError:
        return False
    same_copy = (old.st_size, old.st_mtime_ns) == (new.st_size, new.st_mtime_ns)
    return os.path.samestat(old, new) or same_copy


def _symlink_or_copy(source: Path, target: Path) -> None:
    try:
        target.symlink_to(source)
    except OSError:
        shutil.copy2(source, target)  # with the time: it marks unchanged copies


def _flush_to_disk(path: Path) -> None:
    # A link made by another program's data needs no flush; read-only files allow none.
    if path.is_symlink() or not os.access(path, os.W_OK):
        return
    with path.open("r+b") as file:
        os.fsync(file.fileno())
