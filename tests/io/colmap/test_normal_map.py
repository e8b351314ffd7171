from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_normal_map, write_normal_map


def _f32(values: object) -> npt.NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


@given(height=st.integers(1, 30), width=st.integers(1, 30), seed=st.integers(0, 999))
def test_what_is_written_is_read(
    tmp_path: Path, height: int, width: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.standard_normal((height, width, 3)).astype(np.float32)
    path = tmp_path / "map.bin"
    write_normal_map(path, normals)
    np.testing.assert_array_equal(read_normal_map(path), normals)


def test_the_file_is_planar(tmp_path: Path) -> None:
    normals = _f32([[[1, 2, 3], [4, 5, 6]]])
    write_normal_map(tmp_path / "map.bin", normals)
    planes = _f32([1, 4, 2, 5, 3, 6])
    assert (tmp_path / "map.bin").read_bytes() == b"2&1&3&" + planes.tobytes()


def test_a_normal_with_one_bad_component_is_none(tmp_path: Path) -> None:
    normals = _f32([[[0, np.nan, -1], [0, 0, -1]]])
    path = tmp_path / "map.bin"
    write_normal_map(path, normals)
    assert np.isfinite(np.frombuffer(path.read_bytes()[6:], "<f4")).all()
    path.write_bytes(b"2&1&3&" + _f32([0, 0, np.inf, 0, -1, -1]).tobytes())
    np.testing.assert_array_equal(read_normal_map(path), [[[0, 0, 0], [0, 0, -1]]])


@pytest.mark.parametrize(
    "content",
    [
        b"1&1&3&12345678901",
        b"1&1&1&1234",
        b"1&1&3&" + _f32([np.nan] * 3).tobytes(),
    ],
)
def test_a_broken_file_names_itself(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.bin"
    path.write_bytes(content)
    with pytest.raises(WorkspaceError, match=r"broken\.bin"):
        read_normal_map(path)


def test_a_wrong_shape_is_a_bug_of_the_caller(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected"):
        write_normal_map(tmp_path / "map.bin", np.zeros((3, 2, 2), np.float32))
