from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.exported_map import read_pfm, write_pfm
from resdepth_colmap.scene import FloatMap

VALUES = np.array([[1.5, np.inf, -2], [0, 1e-30, 3e30]], np.float32)
BOTTOM_UP = VALUES[::-1]


@pytest.mark.parametrize("scale", ["1.0", "0.003922", "1"])
@pytest.mark.parametrize(("sign", "order"), [("-", "<f4"), ("", ">f4")])
def test_values_are_read_as_they_are_stored_the_top_row_first(
    tmp_path: Path, scale: str, sign: str, order: str
) -> None:
    path = tmp_path / "disparität.pfm"
    header = f"Pf\n3 2\n{sign}{scale}\n".encode()
    path.write_bytes(header + BOTTOM_UP.astype(order).tobytes())
    read = read_pfm(path)
    assert read.dtype == np.float32
    assert np.array_equal(read, VALUES)


@pytest.mark.parametrize("values", [VALUES, VALUES[:, ::2], VALUES.T, VALUES[:1, :1]])
def test_what_is_written_is_read(tmp_path: Path, values: FloatMap) -> None:
    path = tmp_path / "map.pfm"
    write_pfm(path, values)
    assert np.array_equal(read_pfm(path), values)
    height, width = values.shape
    stored = f"Pf\n{width} {height}\n-1.0\n".encode() + values[::-1].tobytes()
    assert path.read_bytes() == stored


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"Pf",
        b"Pf\n3 2\n-1.0\n" + bytes(23),  # truncated
        b"Pf\n999999999 999999999\n-1.0\n" + bytes(24),
        b"Pf\n-3 2\n-1.0\n" + bytes(24),
        b"Pf\n3 2\n0\n" + bytes(24),
        b"Pf\n3 2\none\n" + bytes(24),
        b"PF\n3 2\n-1.0\n" + bytes(72),  # in colour
        b"P5\n3 2\n255\n" + bytes(6),
    ],
)
def test_a_broken_file_names_itself(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.pfm"
    path.write_bytes(content)
    with pytest.raises(WorkspaceError, match=r"broken\.pfm: [^\n]+$"):
        read_pfm(path)


def test_a_missing_file_or_another_kind_of_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"gone\.pfm"):
        read_pfm(tmp_path / "gone.pfm")
    Image.new("F", (3, 2)).save(tmp_path / "a.tif")
    with pytest.raises(WorkspaceError, match=r"a\.tif: not a grey PFM"):
        read_pfm(tmp_path / "a.tif")
