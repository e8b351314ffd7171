"""Laws of the maps that a report shows."""

from pathlib import Path

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from planes import NAMES, plane_views
from report_workspaces import initial_depth, refined_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.report.image_maps import load_maps, smaller_size

SIZES = st.integers(1, 300)


@hypothesis.given(height=SIZES, width=SIZES, most=st.floats(1, 1e5))
def test_a_smaller_size_keeps_to_the_limit_and_grows_nothing(
    height: int, width: int, most: float
) -> None:
    small = smaller_size((height, width), most)
    assert 1 <= small[0] <= height and 1 <= small[1] <= width
    assert small[0] * small[1] <= max(most, height, width)


def _output(path: Path) -> OutputWorkspace:
    return OutputWorkspace(source=open_workspace(refined_workspace(path)))


def test_the_maps_are_those_of_the_files(tmp_path: Path) -> None:
    maps = load_maps(_output(tmp_path), NAMES[2], "photometric")
    depth = plane_views()[2].depth
    np.testing.assert_array_equal(maps.after, depth)
    np.testing.assert_array_equal(maps.before, initial_depth(depth))
    assert maps.truth is not None and maps.confidence is not None
    np.testing.assert_array_equal(maps.truth, depth)
    assert maps.sampled(100).confidence.shape == maps.sampled(100).after.shape  # type: ignore[union-attr] # above


@pytest.mark.parametrize("folder", ["depth_maps", "confidence_maps"])
def test_maps_that_do_not_belong_together_are_refused_by_name(
    tmp_path: Path, folder: str
) -> None:
    output = _output(tmp_path)
    path = output.path / "stereo" / folder / f"{NAMES[0]}.geometric.bin"
    write_depth_map(path, np.ones((5, 7), np.float32))
    with pytest.raises(WorkspaceError, match=rf"{NAMES[0]}.*7 x 5 .*80 x 60"):
        load_maps(output, NAMES[0], "photometric")
