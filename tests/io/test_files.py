import os
from pathlib import Path

import pytest

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import link_or_copy, safe_name, whole_file, write_whole


def test_a_file_is_written_with_its_folders(tmp_path: Path) -> None:
    target = tmp_path / "a b" / "ü" / "map.bin"
    write_whole(target, b"content")
    assert target.read_bytes() == b"content"
    assert [path.name for path in target.parent.iterdir()] == ["map.bin"]


def test_an_interrupted_write_leaves_the_old_file_and_no_rest(tmp_path: Path) -> None:
    target = tmp_path / "map.bin"
    target.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), whole_file(target) as partial:
        partial.write_bytes(b"half")
        raise KeyboardInterrupt
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_write_that_cannot_be_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "folder").write_bytes(b"a file in the place of a folder")
    with pytest.raises(WorkspaceError, match=r"map\.bin: cannot write"):
        write_whole(tmp_path / "folder" / "map.bin", b"")


def test_a_write_without_permission_names_its_file(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    tmp_path.chmod(0o500)
    with pytest.raises(WorkspaceError, match=r"map\.bin.*permission"):
        write_whole(tmp_path / "map.bin", b"")


def test_writing_over_a_link_leaves_the_linked_file_alone(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.write_bytes(b"source")
    link_or_copy(source, target)
    write_whole(target, b"new")
    assert source.read_bytes() == b"source"


def _refuse(*_: object, **__: object) -> None:
    raise OSError("no links here")


@pytest.mark.parametrize("refused", [(), ("link",), ("link", "symlink")])
def test_a_link_or_copy_shows_the_source_and_can_be_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: tuple[str, ...]
) -> None:
    for name in refused:
        monkeypatch.setattr(os, name, _refuse)
    source, target = tmp_path / "source.png", tmp_path / "sub" / "target.png"
    source.write_bytes(b"first")
    for _ in range(2):
        link_or_copy(source, target)
        assert target.read_bytes() == b"first"
    source.unlink()
    source.write_bytes(b"second one")
    link_or_copy(source, target)
    assert target.read_bytes() == b"second one"
    assert target.is_symlink() == (refused == ("link",))
    assert len(list(target.parent.iterdir())) == 1


def test_a_source_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(WorkspaceError, match=r"gone\.png"):
        link_or_copy(tmp_path / "gone.png", tmp_path / "target.png")


@pytest.mark.parametrize("name", ["a.png", "sub/a b.png", "größe/日本.jpg", "..a/b..c"])
def test_a_name_below_its_folder_is_kept(name: str) -> None:
    assert safe_name(name) == name


@pytest.mark.parametrize(
    "name",
    [
        *("", ".", "..", "a/", "/a", "../../evil.png", "a/../../b"),
        *("\\a", "..\\evil.png", "a\\..\\..\\b", "C:\\a", "C:a", "a\0b", "a\nb"),
    ],
)
def test_a_name_that_leads_out_is_refused(name: str) -> None:
    with pytest.raises(WorkspaceError, match="image name"):
        safe_name(name)
