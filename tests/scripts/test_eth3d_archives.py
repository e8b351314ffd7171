"""Laws of preparing ETH3D, against a server on this machine, with small archives."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import py7zr
import pytest
from eth3d_scene import write_eth3d_scene
from range_server import RangeServer

from resdepth_colmap.io.eth3d import Eth3dScene, find_eth3d_scenes
from scripts.eth3d_archives import (
    DEPTH_PARTS,
    LOCK_NAME,
    Fetching,
    prepare_scenes,
)

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = {
    "dslr_undistorted": (
        "dslr_calibration_undistorted",
        "images/dslr_images_undistorted",
    ),
    "dslr_jpg": ("dslr_calibration_jpg", "images/dslr_images", "masks_for_images"),
    "dslr_depth": ("ground_truth_depth",),
}


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archives of a rendered scene, as ETH3D packs its own."""
    folder = tmp_path_factory.mktemp("served")
    scene = write_eth3d_scene(tmp_path_factory.mktemp("rendered") / "office").path
    for part, members in FOLDERS.items():
        with py7zr.SevenZipFile(folder / f"office_{part}.7z", "w") as archive:
            for member in members:
                archive.writeall(scene / member, f"office/{member}")
    return folder


@pytest.fixture
def server(archives: Path) -> Iterator[RangeServer]:
    with RangeServer(archives) as running:
        yield running


def fetching(tmp_path: Path, server: RangeServer, *, keep: bool = False) -> Fetching:
    return Fetching(root=tmp_path / "ETH3D", base_url=server.url, keep_archives=keep)


def files_of(root: Path) -> set[str]:
    return {str(it.relative_to(root)) for it in root.rglob("*") if it.is_file()}


def test_what_was_fetched_is_a_scene(tmp_path: Path, server: RangeServer) -> None:
    how = fetching(tmp_path, server)
    assert prepare_scenes(["office"], DEPTH_PARTS, how) == {}
    (scene,) = find_eth3d_scenes(how.root)
    scene.check_parts()
    assert scene == Eth3dScene(path=how.root / "office")
    lock = json.loads((how.root / LOCK_NAME).read_text())
    assert set(lock) == {f"office_{part}.7z" for part in DEPTH_PARTS}
    assert lock["office_dslr_depth.7z"]["bytes"] > 1000
    assert not list(how.root.rglob("*.7z"))


def test_a_second_time_fetches_nothing(tmp_path: Path, server: RangeServer) -> None:
    how = fetching(tmp_path, server)
    prepare_scenes(["office"], ["dslr_depth"], how)
    before, num_requests = files_of(how.root), len(server.requests)
    prepare_scenes(["office"], ["dslr_depth"], how)
    assert (files_of(how.root), len(server.requests)) == (before, num_requests)


def test_an_interrupted_download_goes_on(tmp_path: Path, server: RangeServer) -> None:
    how = fetching(tmp_path, server)
    server.break_after = 1000
    failed = prepare_scenes(["office"], ["dslr_depth"], how)
    assert "run the same again to go on" in failed["office_dslr_depth.7z"]
    server.break_after = None
    assert prepare_scenes(["office"], ["dslr_depth"], how) == {}
    assert server.requests[-1][1] == "bytes=1000-"


def test_one_failure_stops_nothing_else(tmp_path: Path, server: RangeServer) -> None:
    how = fetching(tmp_path, server)
    failed = prepare_scenes(["pipes", "office"], ["dslr_depth"], how)
    assert list(failed) == ["pipes_dslr_depth.7z"]
    assert "Not Found" in failed["pipes_dslr_depth.7z"]
    assert (how.root / "office/ground_truth_depth").is_dir()


def test_an_archive_that_differs_from_the_lock_is_refused(
    tmp_path: Path, server: RangeServer
) -> None:
    how = fetching(tmp_path, server, keep=True)
    prepare_scenes(["office"], ["dslr_depth"], how)
    path = how.root / "archives" / "office_dslr_depth.7z"
    assert path.is_file()
    path.with_name(f"{path.name}.unpacked").unlink()
    path.write_bytes(path.read_bytes() + b"x")
    failed = prepare_scenes(["office"], ["dslr_depth"], how)
    assert "but eth3d.lock.json says" in failed[path.name]


def test_a_broken_archive_leaves_nothing_half_unpacked(
    tmp_path: Path, server: RangeServer
) -> None:
    how = fetching(tmp_path, server)
    whole = (server.folder / "office_dslr_jpg.7z").read_bytes()
    path = how.root / "archives" / "office_dslr_jpg.7z"
    path.parent.mkdir(parents=True)
    path.write_bytes(whole[:40] + bytes(200) + whole[240:])
    failed = prepare_scenes(["office"], ["dslr_jpg"], how)
    assert "cannot be unpacked" in failed[path.name]
    assert not (how.root / "office").exists()
    assert not list(path.parent.glob(".unpacking*"))
    path.unlink()
    assert prepare_scenes(["office"], ["dslr_jpg"], how) == {}


def test_an_archive_without_the_scenes_folder_goes_into_it(
    tmp_path: Path, archives: Path
) -> None:
    (tmp_path / "served").mkdir()
    (tmp_path / "note.txt").write_text("hello")
    with py7zr.SevenZipFile(tmp_path / "served/relief_dslr_depth.7z", "w") as archive:
        archive.write(tmp_path / "note.txt", "ground_truth_depth/note.txt")
    with RangeServer(tmp_path / "served") as server:
        how = fetching(tmp_path, server)
        assert prepare_scenes(["relief"], ["dslr_depth"], how) == {}
    assert (how.root / "relief/ground_truth_depth/note.txt").read_text() == "hello"


def test_the_script_says_what_came_and_what_did_not(
    tmp_path: Path, server: RangeServer
) -> None:
    command = [sys.executable, "-m", "scripts.prepare_eth3d"]
    options = ["office", "pipes", "--part", "dslr_depth", "--base-url", server.url]
    done = subprocess.run(
        [*command, str(tmp_path / "ETH3D"), *options],
        capture_output=True,
        text=True,
        cwd=REPOSITORY,
    )
    assert done.returncode == 1
    assert "office_dslr_depth.7z: " in done.stdout and "unpacked" in done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith("Error: pipes_dslr_depth.7z: ")
