"""Laws of the report of a workspace: what it holds, what is left out, what fails."""

import json
import logging
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from page_elements import parsed
from planes import NAMES, write_plane_workspace
from report_workspaces import NUM_HOLE_ROWS, refined_workspace

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.report.content import MOST_BYTES
from resdepth_colmap.report.write_report import write_report


def data_of(path: Path) -> Any:
    return json.loads(parsed(path.read_text(encoding="utf-8")).scripts["report-data"])


def after_map(folder: Path, name: str) -> Path:
    return folder / f"resdepth/stereo/depth_maps/{name}.geometric.bin"


def test_the_page_holds_the_summary_and_every_image(tmp_path: Path) -> None:
    path = write_report(refined_workspace(tmp_path / "scene"))
    assert path == tmp_path / "scene/resdepth/report.html"
    elements = parsed(path.read_text(encoding="utf-8"))
    data = json.loads(elements.scripts["report-data"])
    assert [image["name"] for image in data["images"]] == list(NAMES)
    summary = data["summary"]
    assert summary["coverage"] == [1 - NUM_HOLE_ROWS / 60, 1]
    assert summary["agreement"] == [0.5, 0.9]
    assert summary["points"] == [500, 900]
    assert summary["seconds"] == {"stereo": 3, "refine": 1}
    before, after = summary["metrics"]
    assert after["mae"] < 1e-6 < before["mae"]
    assert before["bad_2"] > 0.5 and after["bad_2"] == 0
    assert set(data["cloud"]["clouds"]) == {"before", "after"}
    for index, image in enumerate(data["images"]):
        assert image["blocks"] == ["photo", "before", "after", "confidence", "truth"]
        for block in image["blocks"]:
            assert elements.scripts[f"image-{index}-{block}"]


def test_without_truth_and_cloud_the_page_has_neither(tmp_path: Path) -> None:
    folder = refined_workspace(tmp_path / "scene", truth=False)
    (folder / "resdepth/fused.ply").unlink()
    data = data_of(write_report(folder))
    assert data["cloud"] is None
    assert data["summary"]["metrics"] is None
    assert all("truth" not in image["blocks"] for image in data["images"])


def test_a_map_that_vanished_is_left_out_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = refined_workspace(tmp_path / "scene")
    after_map(folder, NAMES[1]).unlink()
    write_depth_map(after_map(folder, NAMES[3]), np.ones((5, 5), np.float32))
    with caplog.at_level(logging.WARNING):
        data = data_of(write_report(folder))
    shown = [image["name"] for image in data["images"]]
    assert shown == [NAMES[0], NAMES[2], NAMES[4]]
    assert {name for group in data["leftOut"] for name in group["names"]} == {
        NAMES[1],
        NAMES[3],
    }
    assert len(caplog.records) == 2
    assert NAMES[1] in caplog.messages[0]


def _remove_record(folder: Path) -> None:
    (folder / "resdepth/run.json").unlink()


def _remove_images_from_record(folder: Path) -> None:
    (folder / "resdepth/run.json").write_text('{"images": {}}', encoding="utf-8")


def _remove_maps(folder: Path) -> None:
    shutil.rmtree(folder / "resdepth/stereo")


@pytest.mark.parametrize(
    "spoil", [_remove_record, _remove_images_from_record, _remove_maps]
)
def test_without_refined_maps_it_says_to_run_refine_and_keeps_the_old_page(
    tmp_path: Path, spoil: Any
) -> None:
    folder = refined_workspace(tmp_path / "scene")
    path = write_report(folder)
    old = path.read_bytes()
    spoil(folder)
    with pytest.raises(WorkspaceError, match="run `resdepth-colmap refine") as caught:
        write_report(folder)
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == old
    assert not list(path.parent.glob(".partial*"))


def test_a_workspace_that_was_never_refined_gets_no_folder(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path)
    with pytest.raises(WorkspaceError, match="run `resdepth-colmap refine"):
        write_report(tmp_path)
    assert not (tmp_path / "resdepth").exists()


def test_a_record_of_odd_values_is_survived(tmp_path: Path) -> None:
    folder = refined_workspace(tmp_path / "scene")
    path = folder / "resdepth/run.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    record.update(seconds=None, options=3, fuse="x", versions=[], skipped={"a": 1})
    record["images"][NAMES[0]] = {"input": "photometric", "sources": [1, {}]}
    record["images"][NAMES[1]] = "?"
    record["images"]["../../x"] = {"input": "photometric"}
    path.write_text(json.dumps(record), encoding="utf-8")
    data = data_of(write_report(folder))
    assert len(data["images"]) == len(NAMES) - 1
    assert data["summary"]["points"] == [None, None]


@pytest.mark.slow
def test_many_noisy_images_stay_below_the_limit(tmp_path: Path) -> None:
    names = tuple(f"{number:04d}.png" for number in range(60))
    folder = refined_workspace(tmp_path, names, size_px=(400, 300), noise=0.3)
    path = write_report(folder)
    assert 0.6 * MOST_BYTES < path.stat().st_size <= MOST_BYTES
    assert len(data_of(path)["images"]) == 60
