"""Laws of the consistency graphs, by a reader that does as COLMAP's does."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.io.colmap.maps import write_consistency_graph


def as_colmap_reads(
    path: Path,
) -> tuple[tuple[int, int], dict[tuple[int, int], list[int]]]:
    """Shape, and image indices by (row, column), as InitializeMap finds them."""
    width, height, channels, content = path.read_bytes().split(b"&", 3)
    assert channels == b"1"
    data = np.frombuffer(content, "<i4").tolist()
    images, start = {}, 0
    while start < len(data):
        column, row, count = data[start : start + 3]
        images[row, column] = data[start + 3 : start + 3 + count]
        start += 3 + count
    assert start == len(data)
    return (int(height), int(width)), images


@given(
    num_sources=st.integers(0, 4),
    height=st.integers(1, 5),
    width=st.integers(1, 7),
    seed=st.integers(0, 99),
)
def test_colmap_reads_who_agrees_with_each_pixel(
    tmp_path: Path, num_sources: int, height: int, width: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    agrees: npt.NDArray[np.bool_] = rng.random((num_sources, height, width)) < 0.4
    indices = rng.permutation(20)[:num_sources].tolist()
    path = tmp_path / "consistency_graphs" / "a.png.geometric.bin"
    write_consistency_graph(path, agrees, indices)
    shape, images = as_colmap_reads(path)
    assert shape == (height, width)
    assert all(images.values())
    for row, column in np.ndindex(height, width):
        expected = [
            i for i, own in zip(indices, agrees, strict=True) if own[row, column]
        ]
        assert images.get((row, column), []) == expected
