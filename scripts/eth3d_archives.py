"""ETH3D's archives, fetched and unpacked into the folder that `evaluate eth3d` reads.

ETH3D publishes no checksums that we know of. Size and SHA-256 of an archive are
therefore written down when it is fetched first, in `eth3d.lock.json`, and held against
it from then on: the lock says that nothing has changed since, not that it was right.
"""

import contextlib
import dataclasses
import datetime
import lzma
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from resdepth_colmap.errors import BackendUnavailableError, WorkspaceError
from resdepth_colmap.evaluation.datasets.paper import PAPER_ROWS
from resdepth_colmap.io.colmap.output import read_record, write_record
from resdepth_colmap.io.files import safe_name
from scripts.download import OnBytes, download, file_hash

BASE_URL = "https://www.eth3d.net/data"
LOCK_NAME = "eth3d.lock.json"
ARCHIVES_FOLDER = "archives"

DEPTH_PARTS = ("dslr_undistorted", "dslr_jpg", "dslr_depth")
"""What `evaluate eth3d` reads."""

CLOUD_PARTS = ("dslr_scan_eval",)
"""What `evaluate cloud` reads; images and poses are in DEPTH_PARTS."""

PARTS = (*DEPTH_PARTS, *CLOUD_PARTS, "scan_clean", "dslr_occlusion")
SCENES = tuple(PAPER_ROWS)
"""The paper's."""

_DECODING_ERRORS = (lzma.LZMAError, EOFError, OSError, ValueError)

Facts = Mapping[str, int | str]
"""Size in bytes and SHA-256 of an archive."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fetching:
    """How archives are fetched.

    Attributes:
        root: Folder of the scenes; the archives go to `archives/` in it.
        base_url: Folder of the archives on the server.
        keep_archives: Whether an archive stays when it is unpacked.
        on_bytes: Told of each download's progress.
        on_done: Told the name of each archive that is unpacked, and of what size it is.
    """

    root: Path
    base_url: str = BASE_URL
    keep_archives: bool = False
    on_bytes: OnBytes | None = None
    on_done: Callable[[str, int], None] | None = None


def prepare_scenes(
    scenes: Sequence[str], parts: Sequence[str], fetching: Fetching
) -> dict[str, str]:
    """Fetch and unpack what is not there yet; one failure stops nothing else.

    Args:
        scenes: Their names.
        parts: Some of `PARTS`.
        fetching: Where to and how.

    Returns:
        What is wrong with each archive that could not be had, by its name.

    Raises:
        BackendUnavailableError: If py7zr is not installed.
    """
    _check_py7zr()
    failed = {}
    for scene in scenes:
        for part in parts:
            name = f"{safe_name(scene)}_{part}.7z"
            try:
                size = prepare_archive(name, scene, fetching)
            except WorkspaceError as error:
                failed[name] = " ".join(str(error).split())
            else:
                if fetching.on_done:
                    fetching.on_done(name, size)
    return failed


def prepare_archive(name: str, scene: str, fetching: Fetching) -> int:
    """Fetch and unpack one archive, unless that was done; returns its size in bytes.

    Raises:
        WorkspaceError: If it cannot be fetched or unpacked, or is not what the lock
            says.
    """
    lock = _Lock(fetching.root / LOCK_NAME)
    path = fetching.root / ARCHIVES_FOLDER / name
    done = path.with_name(f"{name}.unpacked")
    known = lock.entry(name)
    if done.is_file() and known:
        return int(known["bytes"])
    if not path.is_file():
        download(f"{fetching.base_url}/{name}", path, fetching.on_bytes)
    size = path.stat().st_size
    facts: Facts = {"bytes": size, "sha256": file_hash(path)}
    lock.check(path, facts)
    _unpack(path, scene, fetching.root)  # a broken one must not get into the lock
    lock.add(name, facts, f"{fetching.base_url}/{name}")
    done.touch()
    if not fetching.keep_archives:
        path.unlink()
    return size


class _Lock:
    """Sizes and hashes of the archives, as they were when they were fetched first."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._entries = read_record(path)

    def entry(self, name: str) -> dict[str, Any]:
        """What is known of an archive; {} if nothing is."""
        found = self._entries.get(name)
        return found if isinstance(found, dict) else {}

    def check(self, path: Path, facts: Facts) -> None:
        """Compare an archive with what is known of it, if anything is."""
        known = self.entry(path.name)
        if any(known.get(key, value) != value for key, value in facts.items()):
            raise WorkspaceError(
                f"{path}: {facts['bytes']} bytes, SHA-256 {facts['sha256']}, but "
                f"{self.path.name} says {known.get('bytes')} bytes, "
                f"{known.get('sha256')}; delete the file to fetch it again, or, if "
                "ETH3D has replaced it, its entry there."
            )

    def add(self, name: str, facts: Facts, url: str) -> None:
        """Write down what an archive is, unless that is known."""
        if self.entry(name):
            return
        date = datetime.datetime.now(datetime.UTC).date().isoformat()
        self._entries[name] = {**facts, "url": url, "fetched": date}
        write_record(self.path, self._entries)


def _unpack(path: Path, scene: str, root: Path) -> None:
    """Unpack beside the scene, then move file by file: several archives share it."""
    import py7zr

    with _staging(root, path.name) as staging:
        try:
            with py7zr.SevenZipFile(path) as archive:
                names = [safe_name(name) for name in archive.getnames()]
                archive.extractall(staging)
        except (py7zr.exceptions.ArchiveError, *_DECODING_ERRORS) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise WorkspaceError(
                f"{path}: cannot be unpacked ({reason}); delete it to fetch it again."
            ) from error
        is_inside = all(name.split("/")[0] == scene for name in names)
        target = root if is_inside else root / scene
        for file in sorted(staging.rglob("*")):
            if file.is_symlink() or not file.is_file():
                continue
            goal = target / file.relative_to(staging)
            goal.parent.mkdir(parents=True, exist_ok=True)
            file.replace(goal)


@contextlib.contextmanager
def _staging(root: Path, name: str) -> Iterator[Path]:
    path = root / ARCHIVES_FOLDER / f".unpacking-{name}"
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(parents=True)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _check_py7zr() -> None:
    try:
        import py7zr  # noqa: F401
    except ImportError as error:
        raise BackendUnavailableError(
            "unpacking ETH3D's .7z archives needs py7zr; "
            "install it with: pip install 'resdepth-colmap[eth3d]'."
        ) from error
