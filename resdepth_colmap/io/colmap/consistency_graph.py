"""Consistency graphs: which sources agree with each pixel, in COLMAP's files.

They lie in `stereo/consistency_graphs`. After `W&H&1&` come little-endian int32, a
record for each pixel that any source agrees with: column, row, number of sources, their
indices. (COLMAP's documentation has row and column the other way round; this is what
its consistency_graph.cc reads.)
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from resdepth_colmap.io.files import write_whole

_NUM_LEADING = 3  # column, row, number of sources


def write_consistency_graph(
    path: Path, agrees: npt.NDArray[np.bool_], image_indices: Sequence[int]
) -> None:
    """Write a consistency graph, whole or not at all; its folder is made.

    Args:
        path: The file to write.
        agrees: Whether source s agrees with a pixel, shape (S, H, W).
        image_indices: Index of each source among the images of the model, as COLMAP
            counts them, shape (S,).

    Raises:
        WorkspaceError: If the file cannot be written.
    """
    _, height, width = agrees.shape
    header = f"{width}&{height}&1&".encode("ascii")
    records = _records(agrees, np.asarray(image_indices, "<i4"))
    write_whole(path, header + records.tobytes())


def _records(
    agrees: npt.NDArray[np.bool_], image_indices: npt.NDArray[np.int32]
) -> npt.NDArray[np.int32]:
    """All records one after the other, pixels row by row."""
    num_sources, height, width = agrees.shape
    by_pixel = agrees.reshape(num_sources, height * width)
    counts = by_pixel.sum(axis=0)
    pixels = np.flatnonzero(counts)
    counts = counts[pixels]
    lengths = _NUM_LEADING + counts
    starts = np.cumsum(lengths) - lengths
    records = np.empty(int(lengths.sum()), "<i4")
    records[starts] = pixels % width
    records[starts + 1] = pixels // width
    records[starts + 2] = counts
    _, sources = np.nonzero(by_pixel[:, pixels].T)
    is_index = np.ones(records.size, np.bool_)
    for place in range(_NUM_LEADING):
        is_index[starts + place] = False
    records[is_index] = image_indices[sources]
    return records
