"""`stereo/patch-match.cfg` (the sources of each image) and `stereo/fusion.cfg`."""

import dataclasses
import enum
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading, write_whole

_SEPARATOR = re.compile("[,;]")


class SourceKind(enum.StrEnum):
    """How the sources of an image are named."""

    AUTO = "auto"
    ALL = "all"
    EXPLICIT = "explicit"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SourceSpec:
    """The sources that PatchMatch compares an image with.

    Attributes:
        kind: `auto`: those with the most shared points; `all`: all other images;
            `explicit`: those of `names`.
        num_auto: How many at most, where `kind` is auto (COLMAP's default: 20); else 0.
        names: Image names, where `kind` is explicit; else ().
    """

    kind: SourceKind
    num_auto: int = 0
    names: tuple[str, ...] = ()


def read_sources(path: Path) -> dict[str, SourceSpec]:
    """Read a `patch-match.cfg`: an image name on a line, its sources on the next one.

    Blank lines and lines that begin with "#" are skipped. Names of sources are parted
    by "," or ";", as COLMAP does. An image named twice has the sources named first:
    COLMAP skips the second turn, as its maps are there by then.

    Raises:
        WorkspaceError: If the file is not there or malformed; the line is named.
    """
    sources: dict[str, SourceSpec] = {}
    lines = _lines(path)
    for number, name in lines:
        follows = next(lines, None)
        if follows is None:
            raise WorkspaceError(
                f"{path}, line {number}: no line of sources after {name!r}."
            )
        sources.setdefault(name, _parse(path, *follows))
    return sources


def write_patch_match_cfg(path: Path, sources: Mapping[str, SourceSpec]) -> None:
    """Write a `patch-match.cfg`; WorkspaceError if it, or a name, cannot be written."""
    lines: list[str] = []
    for name, spec in sources.items():
        for source in spec.names:
            _check_name(path, source, forbidden=",")
            _check_name(path, source, forbidden=";")
        lines += [name, _format(spec)]
    _write_lines(path, lines)


def write_fusion_cfg(path: Path, names: Sequence[str]) -> None:
    """Write a `fusion.cfg`; WorkspaceError if it, or a name, cannot be written."""
    _write_lines(path, list(names))


def _parse(path: Path, number: int, text: str) -> SourceSpec:
    parts = [part.strip() for part in _SEPARATOR.split(text) if part.strip()]
    if parts == ["__all__"]:
        return SourceSpec(kind=SourceKind.ALL)
    if len(parts) == 2 and parts[0] == "__auto__" and _is_count(parts[1]):
        return SourceSpec(kind=SourceKind.AUTO, num_auto=int(parts[1]))
    if not parts or any(part in ("__all__", "__auto__") for part in parts):
        raise WorkspaceError(
            f"{path}, line {number}: {text!r} but expected '__auto__, NUMBER', "
            "'__all__' or image names with commas between them."
        )
    return SourceSpec(kind=SourceKind.EXPLICIT, names=tuple(parts))


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit() and 0 < len(text) < 10 and int(text) > 0


def _format(spec: SourceSpec) -> str:
    if spec.kind is SourceKind.ALL:
        return "__all__"
    if spec.kind is SourceKind.AUTO:
        return f"__auto__, {spec.num_auto}"
    return ", ".join(spec.names)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that are neither blank nor comments, with their numbers."""
    try:
        with reading(path):
            text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        number = error.object[: error.start].count(b"\n") + 1
        raise WorkspaceError(f"{path}, line {number}: not text in UTF-8.") from error
    # Not splitlines(), which also splits at characters that a name may hold.
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip()
        if stripped and not stripped.startswith("#"):
            yield number, stripped


def _write_lines(path: Path, lines: list[str]) -> None:
    for line in lines:
        _check_name(path, line, forbidden="\n")
    data = "".join(f"{line}\n" for line in lines).encode("utf-8")
    if not (path.is_file() and path.read_bytes() == data):
        write_whole(path, data)


def _check_name(path: Path, name: str, forbidden: str) -> None:
    if not name.strip() or name != name.strip() or name[0] == "#" or forbidden in name:
        raise WorkspaceError(
            f"{path}: the name {name!r} cannot stand in a line of it (empty, '#' in "
            f"front, blanks round it or {forbidden!r} in it); rename the image."
        )
