"""What the tests of evaluations share."""

from pathlib import Path

import pytest
from fake_matcher import installed
from planes import write_plane_workspace

from resdepth_colmap.evaluation import matched_workspace
from resdepth_colmap.evaluation.matching_passes import Folders


@pytest.fixture
def plane_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folders:
    """Exact maps of a plane in the place of COLMAP's; ours say 4 everywhere."""
    monkeypatch.setattr(matched_workspace, "warm_up", lambda _: None)
    installed(monkeypatch)
    write_plane_workspace(tmp_path / "meeting_room", kinds=("photometric",))
    return Folders(data=tmp_path, cache=tmp_path / "cache")
