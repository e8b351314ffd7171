"""Laws of the manifest, and of maps that the user puts over results in place."""

import json
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.pipeline.manifest import MANIFEST_NAME, Manifest, Task
from resdepth_colmap.pipeline.refine.stage import RefineReport, refine_workspace


def task(folder: Path, key: str = "k") -> Task:
    return Task(stage="s", name="n", key=key, writes=(folder / "file",))


def made(folder: Path) -> Manifest:
    (folder / "file").write_bytes(b"result")
    manifest = Manifest(folder)
    manifest.start(task(folder))
    manifest.finish(task(folder), {"fact": 1})
    return Manifest(folder)


def test_a_result_is_fresh_until_its_key_or_its_file_changes(tmp_path: Path) -> None:
    manifest = made(tmp_path)
    assert manifest.is_fresh(task(tmp_path))
    assert manifest.facts(task(tmp_path)) == {"fact": 1}
    assert not manifest.is_fresh(task(tmp_path, "other"))
    (tmp_path / "file").write_bytes(b"theirs")
    assert not Manifest(tmp_path).is_fresh(task(tmp_path))
    assert not Manifest(tmp_path).is_ours(task(tmp_path))


def test_what_was_begun_is_ours_but_not_fresh(tmp_path: Path) -> None:
    manifest = made(tmp_path)
    manifest.start(task(tmp_path))
    again = Manifest(tmp_path)
    assert not again.is_fresh(task(tmp_path))
    assert again.is_ours(task(tmp_path))


@pytest.mark.parametrize("damage", ["cut", "facts", "files", "garbage", "types"])
def test_a_damaged_line_is_as_if_it_was_not_there(tmp_path: Path, damage: str) -> None:
    made(tmp_path)
    path = tmp_path / MANIFEST_NAME
    lines = path.read_text(encoding="utf-8").splitlines()
    last = json.loads(lines[-1])
    if damage == "cut":
        lines[-1] = lines[-1][:-9]
    elif damage == "garbage":
        lines = ["{oops", "[]", "null", "\0"]
    else:
        name = {"facts": "facts", "files": "files", "types": "key"}[damage]
        lines[-1] = json.dumps({**last, name: {}})
    path.write_text("\n".join(lines), encoding="utf-8")
    manifest = Manifest(tmp_path)
    assert not manifest.is_fresh(task(tmp_path))
    manifest.finish(task(tmp_path))
    assert Manifest(tmp_path).is_fresh(task(tmp_path))


def refine(folder: Path, in_place: bool) -> RefineReport:
    weights = identity_weights(folder.parent)
    config = RefineConfig(tile_px=64, overlap_px=16, weights=weights)
    return refine_workspace(open_workspace(folder), config, in_place=in_place)


@pytest.mark.parametrize("in_place", [True, False])
def test_a_map_put_over_a_result_in_place_is_used_and_not_lost(
    tmp_path: Path, in_place: bool
) -> None:
    folder = plane_folder(tmp_path)
    path = folder / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin"
    oldest = path.read_bytes()
    refine(folder, in_place=True)
    write_depth_map(path, np.float32(1.02) * read_depth_map(path))
    theirs = path.read_bytes()
    expected = read_depth_map(path)
    assert NAMES[0] in refine(folder, in_place).refined
    results = folder if in_place else folder / "resdepth"
    refined = results / "stereo/depth_maps" / f"{NAMES[0]}.geometric.bin"
    np.testing.assert_allclose(read_depth_map(refined), expected, rtol=1e-5)
    contents = [file.read_bytes() for file in path.parent.iterdir()]
    assert oldest in contents and theirs in contents
    assert refine(folder, in_place).refined == ()
