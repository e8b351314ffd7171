from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.cfg import (
    SourceKind,
    SourceSpec,
    read_sources,
    write_fusion_cfg,
    write_patch_match_cfg,
)

NAMES = st.sampled_from(["a.png", "b c/d e.jpg", "größe/日本.png", "0\u2028x.png"])
SPECS = st.one_of(
    st.just(SourceSpec(kind=SourceKind.ALL)),
    st.integers(1, 99).map(lambda n: SourceSpec(kind=SourceKind.AUTO, num_auto=n)),
    st.lists(NAMES, min_size=1, max_size=3).map(
        lambda names: SourceSpec(kind=SourceKind.EXPLICIT, names=tuple(names))
    ),
)


@given(sources=st.dictionaries(NAMES, SPECS))
def test_what_is_written_is_read(
    tmp_path: Path, sources: dict[str, SourceSpec]
) -> None:
    path = tmp_path / "patch-match.cfg"
    write_patch_match_cfg(path, sources)
    assert read_sources(path) == sources
    write_fusion_cfg(path, list(sources))
    assert path.read_text("utf-8") == "".join(f"{name}\n" for name in sources)


def test_comments_blank_lines_and_windows_line_ends_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "patch-match.cfg"
    path.write_bytes(b"\xef\xbb\xbf# made by\r\n\r\na.png\r\n#x\r\n b.png , c.png,\r\n")
    explicit = SourceSpec(kind=SourceKind.EXPLICIT, names=("b.png", "c.png"))
    assert read_sources(path) == {"a.png": explicit}


def test_names_are_parted_by_commas_and_semicolons_not_by_blanks(
    tmp_path: Path,
) -> None:
    path = tmp_path / "patch-match.cfg"
    path.write_text("a b.png\n\n  c d.png ;e.png,, f.png;\n", encoding="utf-8")
    names = ("c d.png", "e.png", "f.png")
    explicit = SourceSpec(kind=SourceKind.EXPLICIT, names=names)
    assert read_sources(path) == {"a b.png": explicit}


def test_of_two_lists_for_an_image_the_first_counts(tmp_path: Path) -> None:
    path = tmp_path / "patch-match.cfg"
    path.write_text("a.png\n__all__\na.png\nb.png\n", encoding="utf-8")
    assert read_sources(path) == {"a.png": SourceSpec(kind=SourceKind.ALL)}


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("a.png\n", 1),
        ("# x\na.png\n__all__\nb.png\n", 4),
        ("a.png\n__auto__\n", 2),
        ("a.png\n__auto__, many\n", 2),
        ("a.png\n__auto__, 0\n", 2),
        ("a.png\n__auto__, -1\n", 2),
        ("a.png\n__all__, b.png\n", 2),
        ("a.png\n,\n", 2),
    ],
)
def test_a_malformed_line_is_named(tmp_path: Path, content: str, line: int) -> None:
    path = tmp_path / "patch-match.cfg"
    path.write_text(content)
    with pytest.raises(WorkspaceError, match=rf"patch-match\.cfg, line {line}"):
        read_sources(path)


def test_a_file_that_is_no_text_or_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "patch-match.cfg"
    with pytest.raises(WorkspaceError, match=r"patch-match\.cfg"):
        read_sources(path)
    path.write_bytes(b"a.png\n\xff\xfe\n")
    with pytest.raises(WorkspaceError, match=r"patch-match\.cfg, line 2"):
        read_sources(path)


@pytest.mark.parametrize("name", ["", " a.png", "#a.png", "a\nb.png"])
def test_a_name_that_would_be_read_as_another_is_not_written(
    tmp_path: Path, name: str
) -> None:
    with pytest.raises(WorkspaceError, match="name"):
        write_fusion_cfg(tmp_path / "fusion.cfg", [name])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a,b.png", "a;b.png"])
def test_a_source_with_a_comma_is_not_written(tmp_path: Path, name: str) -> None:
    spec = SourceSpec(kind=SourceKind.EXPLICIT, names=(name,))
    with pytest.raises(WorkspaceError, match=name):
        write_patch_match_cfg(tmp_path / "patch-match.cfg", {"c.png": spec})
