"""Files fetched over HTTP, from where an earlier attempt stopped."""

import contextlib
import hashlib
import http.client
import shutil
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError

PART_SUFFIX = ".part"
TAG_SUFFIX = ".part-tag"
_CHUNK_BYTES = 1 << 20
_TIMEOUT_S = 60

OnBytes = Callable[[int, int | None], None]
"""Told how many bytes are there and how many there will be (None = not known)."""


def download(url: str, path: Path, on_bytes: OnBytes | None = None) -> None:
    """Fetch a file; what an earlier attempt has left in `<path>.part` is kept.

    The rest is asked for with HTTP's Range, on condition that the file has not changed
    since (If-Range); a server that cannot do so sends it anew from the start.

    Args:
        url: Where it is.
        path: Where it goes; its folder is made. It is there only when it is whole.
        on_bytes: Told of the progress.

    Raises:
        WorkspaceError: If it cannot be fetched, or the connection ended early: the next
            call goes on. Also if the disk is too full for it.
    """
    part = path.with_name(path.name + PART_SUFFIX)
    tag = path.with_name(path.name + TAG_SUFFIX)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        total = _fetch(url, part, tag, on_bytes or _ignore)
        size = part.stat().st_size
    except (OSError, http.client.HTTPException) as error:
        raise WorkspaceError(
            f"{url}: cannot be fetched ({_reason(error)}); run the same again to go on."
        ) from error
    if total is not None and size != total:
        raise WorkspaceError(
            f"{url}: {size:,} of {total:,} bytes came; run the same again to go on."
        )
    part.replace(path)
    tag.unlink(missing_ok=True)


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _fetch(url: str, part: Path, tag: Path, on_bytes: OnBytes) -> int | None:
    """Append to the part what is missing of it; returns the size of the whole."""
    request = urllib.request.Request(url)
    known = tag.read_text(encoding="ascii") if tag.is_file() else ""
    start = part.stat().st_size if part.is_file() and known else 0
    if start:
        request.add_header("Range", f"bytes={start}-")
        request.add_header("If-Range", known)
    try:
        with urllib.request.urlopen(request, timeout=_TIMEOUT_S) as response:
            return _receive(response, part, tag, start, on_bytes)
    except urllib.error.HTTPError as error:
        with error:
            if error.code != http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
                raise
            # All of it is there already, or the part is longer than the whole.
            total = _total(error.headers.get("Content-Range", ""))
    if total != start:
        part.unlink()
        return _fetch(url, part, tag, on_bytes)
    return total


def _receive(
    response: http.client.HTTPResponse,
    part: Path,
    tag: Path,
    start: int,
    on_bytes: OnBytes,
) -> int | None:
    is_rest = response.status == http.HTTPStatus.PARTIAL_CONTENT
    num_bytes = start if is_rest else 0
    left = response.headers.get("Content-Length")
    total = num_bytes + int(left) if left else None
    _check_space(part, int(left or 0))
    tag.write_text(_tag(response), encoding="ascii")
    with part.open("ab" if is_rest else "wb") as file:
        on_bytes(num_bytes, total)
        while chunk := _read(response):
            file.write(chunk)
            num_bytes += len(chunk)
            on_bytes(num_bytes, total)
    return total


def _read(response: http.client.HTTPResponse) -> bytes:
    try:
        return response.read(_CHUNK_BYTES)
    except http.client.IncompleteRead as error:
        return error.partial


def _tag(response: http.client.HTTPResponse) -> str:
    """What names this version of the file; a weak ETag does not."""
    etag = response.headers.get("ETag", "")
    if etag and not etag.startswith("W/"):
        return str(etag)
    return str(response.headers.get("Last-Modified", ""))


def _total(content_range: str) -> int | None:
    """The size that "bytes */SIZE" tells."""
    with contextlib.suppress(ValueError):
        return int(content_range.rpartition("/")[2])
    return None


def _check_space(part: Path, num_bytes: int) -> None:
    num_free = shutil.disk_usage(part.parent).free
    if num_free < num_bytes:
        raise WorkspaceError(
            f"{part.parent}: {num_free:,} bytes are free, but {num_bytes:,} more are "
            "needed; make room or choose another folder."
        )


def _reason(error: Exception) -> str:
    reason = getattr(error, "reason", None) or getattr(error, "strerror", None)
    return " ".join(str(reason or error).split()) or type(error).__name__


def _ignore(_there: int, _total: int | None) -> None:
    """Nobody wants to know."""
