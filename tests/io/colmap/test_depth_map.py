from pathlib import Path

import numpy as np
import numpy.typing as npt
import pycolmap
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import (
    read_depth_map,
    read_map_size,
    write_depth_map,
)


def _f32(values: object) -> npt.NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


@given(height=st.integers(1, 40), width=st.integers(1, 40), seed=st.integers(0, 999))
def test_what_is_written_is_read(
    tmp_path: Path, height: int, width: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0, 9, (height, width)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = 0
    path = tmp_path / "map.bin"
    write_depth_map(path, depth)
    np.testing.assert_array_equal(read_depth_map(path), depth)
    assert read_map_size(path) == (width, height)


def test_colmap_reads_what_we_write_and_we_read_what_it_writes(tmp_path: Path) -> None:
    depth = np.random.default_rng(0).uniform(1, 2, (5, 7)).astype(np.float32)
    write_depth_map(tmp_path / "ours.bin", depth)
    colmap_map = pycolmap.DepthMap()
    colmap_map.read(tmp_path / "ours.bin")
    np.testing.assert_array_equal(colmap_map.to_array(), depth)
    colmap_map.write(tmp_path / "theirs.bin")
    np.testing.assert_array_equal(read_depth_map(tmp_path / "theirs.bin"), depth)


def test_values_that_are_no_depth_are_neither_written_nor_read(tmp_path: Path) -> None:
    values = np.array([[np.nan, np.inf, -1, 2]], dtype=np.float32)
    path = tmp_path / "map.bin"
    write_depth_map(path, values)
    assert path.read_bytes() == b"4&1&1&" + _f32([0, 0, 0, 2]).tobytes()
    path.write_bytes(b"4&1&1&" + values.tobytes())
    np.testing.assert_array_equal(read_depth_map(path), [[0, 0, 0, 2]])


def test_an_empty_map_is_legal_but_a_map_of_nan_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "broken.bin"
    path.write_bytes(b"2&1&1&" + np.zeros(2, np.float32).tobytes())
    assert not read_depth_map(path).any()
    path.write_bytes(b"2&1&1&" + np.full(2, np.nan, np.float32).tobytes())
    with pytest.raises(WorkspaceError, match=r"broken\.bin.*NaN"):
        read_depth_map(path)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"2&1&1",
        b"2&1&1&1234",  # truncated
        b"2&1&1&123456789",  # more than the header says
        b"999999999&999999999&1&12345678",
        b"99999999999999999999&1&1&12345678",
        b"-2&1&1&12345678",
        b"0&0&1&",
        b"two&1&1&12345678",
        b"2 1 1 12345678",
        b"1&1&3&123456789012",  # a normal map
        b"\x89PNG\r\n\x1a\n",
    ],
)
def test_a_broken_file_names_itself(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.bin"
    path.write_bytes(content)
    with pytest.raises(WorkspaceError, match=r"broken\.bin"):
        read_depth_map(path)


def test_a_lying_header_is_shown_with_the_bytes_that_are_there(tmp_path: Path) -> None:
    path = tmp_path / "broken.bin"
    path.write_bytes(b"999999999&2&1&12345678")
    with pytest.raises(WorkspaceError, match=r"999999999 x 2 x 1.*has 22"):
        read_depth_map(path)


def test_a_missing_file_or_a_folder_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "gone.bin", tmp_path):
        with pytest.raises(WorkspaceError, match=path.name):
            read_depth_map(path)
        with pytest.raises(WorkspaceError, match=path.name):
            read_map_size(path)


def test_a_wrong_shape_is_a_bug_of_the_caller(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected"):
        write_depth_map(tmp_path / "map.bin", np.zeros((2, 2, 1), np.float32))
