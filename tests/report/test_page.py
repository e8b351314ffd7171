"""Laws of the page as text: nothing in it escapes, nothing is fetched."""

import json
import re
import tomllib
from pathlib import Path

import hypothesis
import pytest
from hypothesis import strategies as st
from page_elements import parsed

import resdepth_colmap
from resdepth_colmap.report.page import (
    LIBRARIES,
    SCRIPTS,
    STYLES,
    read_asset,
    render_page,
    safe_json,
)

PACKAGE = Path(resdepth_colmap.__file__).parent
ASSETS = PACKAGE / "report" / "assets"
HOSTILE = (
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "a'b\"c`${x}\\",
    "größe/写真 \u2028.jpg",
    "\udcff not unicode",
    "%s{}$data&amp;",
)


def test_hostile_names_stay_text() -> None:
    plain = parsed(render_page("a", {"names": ["a"]}, {"b": b"1"}))
    for name in HOSTILE[:-2]:
        page = parsed(render_page(name, {"names": [name], name: 1}, {"b": b"1"}))
        assert page.num_scripts == plain.num_scripts
        assert json.loads(page.scripts["report-data"]) == {"names": [name], name: 1}
        assert name.partition("\u2028")[0] in page.text


@pytest.mark.parametrize("name", HOSTILE)
def test_json_comes_back_as_it_was(name: str) -> None:
    text = safe_json({"name": name})
    assert text.isascii() and "<" not in text
    assert json.loads(text) == {"name": name}


@hypothesis.given(st.dictionaries(st.text(), st.text()))
def test_any_text_is_safe_json(data: dict[str, str]) -> None:
    assert "<" not in safe_json(data)
    assert json.loads(safe_json(data)) == data


def test_nothing_is_fetched() -> None:
    page = render_page("a", {}, {})
    assert all(link.startswith(("#", "data:")) for link in parsed(page).links)
    own = "".join(read_asset(name) for name in (*SCRIPTS, *STYLES))
    assert not re.search(r"https?:|@import|url\((?!data:)|fetch\(|XMLHttp", own)
    assert "default-src 'none'" in page


def test_the_licences_of_what_is_embedded_are_in_the_page() -> None:
    text = parsed(render_page("a", {}, {})).text
    for words in ("three.js", "uPlot", "The MIT License", "without restriction"):
        assert words in text


def test_no_script_ends_its_own_element() -> None:
    for name in (*LIBRARIES, *SCRIPTS):
        assert "</script" not in read_asset(name).lower()
        assert "<!--" not in read_asset(name)


def test_every_asset_is_used_shipped_and_small() -> None:
    pyproject = PACKAGE.parent / "pyproject.toml"
    if not pyproject.is_file():
        pytest.skip("no pyproject.toml beside the package")
    setup = tomllib.loads(pyproject.read_text(encoding="utf-8"))
    patterns = setup["tool"]["setuptools"]["package-data"]["resdepth_colmap"]
    shipped = {path for pattern in patterns for path in PACKAGE.glob(pattern)}
    files = {path for path in ASSETS.rglob("*") if path.is_file()}
    assert files and files <= shipped
    assert all(path.stat().st_size < 1 << 20 for path in files)
    used = {*LIBRARIES, *SCRIPTS, *STYLES, "report.html", "vendor/NOTICE.txt"}
    assert {path.relative_to(ASSETS).as_posix() for path in files} == used
