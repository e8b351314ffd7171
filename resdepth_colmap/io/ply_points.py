"""The coordinates of a PLY file, of any kind, and nothing made up.

open3d's reader leaves what a truncated file lacks as it finds it in memory, stops at an
"inf" in a text file, and says neither; so the header is read here, the rest by numpy.
Format: http://paulbourke.net/dataformats/ply.
"""

import dataclasses
import io
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading

_BYTE_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2"},
    **{"int": "i4", "uint": "u4", "float": "f4", "double": "f8"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"},
    **{"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"},
}
_MAX_LINE_BYTES = 10_000


@dataclasses.dataclass
class _Element:
    """Rows of the file that look alike; a list among its properties has the type ""."""

    name: str
    num_rows: int
    properties: list[tuple[str, str]] = dataclasses.field(default_factory=list)

    @property
    def has_list(self) -> bool:
        return any(not kind for _, kind in self.properties)


def read_ply_points(path: Path) -> npt.NDArray[np.float32]:
    """Read the coordinates of the vertices of a cloud or mesh, shape (N, 3), N >= 0.

    Text or binary of either byte order, coordinates of any type. They are rounded to
    float32, as all programs that read scans do; NaN and infinity are as in the file.

    Raises:
        WorkspaceError: If the file is not there, is no PLY, or holds less than its
            header says.
    """
    if not path.exists():
        raise WorkspaceError(f"{path}: no such file.")
    try:
        with reading(path), path.open("rb") as file:
            kind, elements = _read_header(file)
            before, vertices = _split_at_vertices(elements)
            read = _read_text if kind == "ascii" else _read_binary
            values = read(file, before, vertices, _BYTE_ORDERS[kind])
    except ValueError as error:
        raise WorkspaceError(
            f"{path}: {error}; is it a PLY file, and was it copied as a whole?"
        ) from error
    return values


def _read_header(file: BinaryIO) -> tuple[str, list[_Element]]:
    """The kind of the body, and its elements; the file stands at the body then."""
    if file.readline(_MAX_LINE_BYTES).strip() != b"ply":
        raise ValueError("the first line is not 'ply'")
    kind = ""
    elements: list[_Element] = []
    for line in iter(lambda: file.readline(_MAX_LINE_BYTES), b""):
        words = line.decode("ascii", errors="replace").split()
        if words == ["end_header"]:
            if kind not in _BYTE_ORDERS:
                raise ValueError(f"the body is {kind!r}, not text or binary")
            return kind, elements
        if words[:1] == ["format"]:
            kind = words[1] if len(words) > 1 else ""
        else:
            _declare(words, elements)
    raise ValueError("the header has no end")


def _declare(words: list[str], elements: list[_Element]) -> None:
    """Take in a line of the header."""
    match words:
        case ["element", name, count] if count.isdecimal():
            elements.append(_Element(name, int(count)))
        case ["property", "list", _, _, name] if elements:
            elements[-1].properties.append((name, ""))
        case ["property", type_name, name] if elements and type_name in _TYPES:
            elements[-1].properties.append((name, _TYPES[type_name]))
        case [] | ["comment" | "obj_info", *_]:
            pass
        case _:
            raise ValueError(f"the header has a line {' '.join(words)[:80]!r}")


def _split_at_vertices(elements: list[_Element]) -> tuple[list[_Element], _Element]:
    """What comes before the vertices, and the vertices."""
    for index, element in enumerate(elements):
        if element.name == "vertex":
            names = {name for name, _ in element.properties}
            if element.has_list or not names.issuperset("xyz"):
                raise ValueError("its vertices have no plain x, y and z")
            if len(names) != len(element.properties):
                raise ValueError("a property of its vertices is there twice")
            return elements[:index], element
    raise ValueError("it has no vertices")


def _read_binary(
    file: BinaryIO, before: list[_Element], vertices: _Element, order: str
) -> npt.NDArray[np.float32]:
    if any(element.has_list for element in before):
        raise ValueError("lists precede its vertices; write them after the vertices")
    for element in before:
        file.seek(element.num_rows * _row_type(element, order).itemsize, io.SEEK_CUR)
    row_type = _row_type(vertices, order)
    start = file.tell()
    num_there = (file.seek(0, io.SEEK_END) - start) // row_type.itemsize
    _check_count(max(num_there, 0), vertices.num_rows)
    if vertices.num_rows == 0:
        return np.empty((0, 3), np.float32)
    rows = np.memmap(file, row_type, "r", start, (vertices.num_rows,))
    return _columns(rows[axis] for axis in "xyz")


def _read_text(
    file: BinaryIO, before: list[_Element], vertices: _Element, _order: str
) -> npt.NDArray[np.float32]:
    for _ in range(sum(element.num_rows for element in before)):
        file.readline()
    if vertices.num_rows == 0:
        return np.empty((0, 3), np.float32)
    names = [name for name, _ in vertices.properties]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # no line left: counted below
        rows = np.loadtxt(
            (line for line in file if line.strip()),
            np.float64,
            comments=None,
            usecols=[names.index(axis) for axis in "xyz"],
            max_rows=vertices.num_rows,
            ndmin=2,
        )
    _check_count(len(rows), vertices.num_rows)
    return _columns(rows.T)


def _row_type(element: _Element, order: str) -> np.dtype[np.void]:
    return np.dtype([(name, order + kind) for name, kind in element.properties])


def _check_count(num_there: int, num_expected: int) -> None:
    if num_there < num_expected:
        raise ValueError(
            f"it is truncated, with {num_there} of its {num_expected} points"
        )


def _columns(columns: Iterable[npt.NDArray[np.generic]]) -> npt.NDArray[np.float32]:
    with np.errstate(over="ignore"):  # beyond float32 is infinite
        return np.stack([column.astype(np.float32) for column in columns], axis=1)
