"""What a user reads where open3d cannot be loaded."""

import sys

import pytest

from resdepth_colmap.errors import BackendUnavailableError
from resdepth_colmap.io.open3d_library import load_open3d


def test_a_missing_open3d_is_one_line_with_the_way_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(BackendUnavailableError, match=r"apt install .*libusb"):
        load_open3d()
