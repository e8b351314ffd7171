"""Laws of fetching files, against a server on this machine."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from range_server import RangeServer

from resdepth_colmap.errors import WorkspaceError
from scripts.download import download, file_hash

DATA = np.random.default_rng(0).bytes(5000)


@pytest.fixture
def server(tmp_path: Path) -> Iterator[RangeServer]:
    (tmp_path / "served").mkdir()
    (tmp_path / "served" / "a.7z").write_bytes(DATA)
    with RangeServer(tmp_path / "served") as running:
        yield running


def test_what_is_served_is_fetched(tmp_path: Path, server: RangeServer) -> None:
    told = []
    path = tmp_path / "there" / "a.7z"
    download(f"{server.url}/a.7z", path, lambda *numbers: told.append(numbers))
    assert path.read_bytes() == DATA
    assert told[0] == (0, 5000) and told[-1] == (5000, 5000)
    assert list(path.parent.iterdir()) == [path]
    assert len(file_hash(path)) == 64


def test_an_interrupted_download_goes_on(tmp_path: Path, server: RangeServer) -> None:
    path = tmp_path / "a.7z"
    server.break_after = 1800
    for there in (1800, 3600):
        with pytest.raises(WorkspaceError, match=f"{there:,} of 5,000 bytes came"):
            download(f"{server.url}/a.7z", path)
        assert not path.exists()
    download(f"{server.url}/a.7z", path)
    assert path.read_bytes() == DATA
    assert server.num_bytes == len(DATA)  # nothing was sent twice
    assert [asked for _, asked in server.requests] == [
        "",
        "bytes=1800-",
        "bytes=3600-",
    ]


def test_a_file_that_has_changed_is_fetched_anew(
    tmp_path: Path, server: RangeServer
) -> None:
    path = tmp_path / "a.7z"
    server.break_after = 1800
    with pytest.raises(WorkspaceError):
        download(f"{server.url}/a.7z", path)
    server.break_after = None
    (server.folder / "a.7z").write_bytes(DATA[::-1])
    download(f"{server.url}/a.7z", path)
    assert path.read_bytes() == DATA[::-1]


def test_without_a_tag_nothing_is_trusted(tmp_path: Path, server: RangeServer) -> None:
    server.has_tags = False
    server.break_after = 1800
    with pytest.raises(WorkspaceError):
        download(f"{server.url}/a.7z", tmp_path / "a.7z")
    server.break_after = None
    download(f"{server.url}/a.7z", tmp_path / "a.7z")
    assert (tmp_path / "a.7z").read_bytes() == DATA
    assert server.requests[-1][1] == ""


@pytest.mark.parametrize("num_there", [5000, 6000])
def test_a_part_that_is_all_there_is_taken_if_it_fits(
    tmp_path: Path, server: RangeServer, num_there: int
) -> None:
    path, part = tmp_path / "a.7z", tmp_path / "a.7z.part"
    server.break_after = 1800
    with pytest.raises(WorkspaceError):
        download(f"{server.url}/a.7z", path)
    part.write_bytes((DATA + bytes(1000))[:num_there])
    server.break_after, server.num_bytes = None, 0
    download(f"{server.url}/a.7z", path)
    assert path.read_bytes() == DATA
    assert server.num_bytes == (0 if num_there == 5000 else 5000)


def test_what_is_not_there_is_one_line(tmp_path: Path, server: RangeServer) -> None:
    with pytest.raises(WorkspaceError, match=r"b\.7z: cannot be fetched \(Not Found\)"):
        download(f"{server.url}/b.7z", tmp_path / "b.7z")
    assert not list(tmp_path.glob("b.7z*"))


def test_no_network_is_one_line(tmp_path: Path, server: RangeServer) -> None:
    url = server.url.replace("127.0.0.1", "nowhere.invalid")
    with pytest.raises(WorkspaceError, match="cannot be fetched"):
        download(f"{url}/a.7z", tmp_path / "a.7z")


class _Usage(NamedTuple):
    free: int


def test_a_disk_that_is_too_small_is_named(
    tmp_path: Path, server: RangeServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: _Usage(free=4999))
    with pytest.raises(WorkspaceError, match="4,999 bytes are free, but 5,000 more"):
        download(f"{server.url}/a.7z", tmp_path / "a.7z")
