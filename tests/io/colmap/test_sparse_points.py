"""Sparse points of models, and who saw them."""

from pathlib import Path

import numpy as np
import pytest
from planes import points_on_plane, write_plane_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.model import read_sparse_points


@pytest.mark.parametrize("binary", [True, False])
def test_points_and_tracks_are_those_of_the_model(tmp_path: Path, binary: bool) -> None:
    write_plane_workspace(tmp_path, kinds=(), num_points=30, binary=binary)
    points = read_sparse_points(tmp_path / "sparse")
    np.testing.assert_allclose(points.xyz, points_on_plane(30), atol=1e-12)
    np.testing.assert_array_equal(points.ids, np.arange(1, 31))
    np.testing.assert_array_equal(points.seen_by(3), np.arange(30))
    assert points.seen_by(99).size == 0


def test_a_model_may_have_no_points(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path, kinds=(), num_points=0)
    points = read_sparse_points(tmp_path / "sparse")
    assert points.xyz.shape == (0, 3)
    assert points.seen_by(1).size == 0


def test_a_missing_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match="no COLMAP model"):
        read_sparse_points(tmp_path)
