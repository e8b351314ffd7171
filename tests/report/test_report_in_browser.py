"""The report in a real browser: what people see, point at and press."""

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from chromium import OpenPage, launched
from PIL import Image
from planes import plane_views
from report_workspaces import (
    AFTER_COLOR,
    BEFORE_COLOR,
    CONFIDENCE,
    TOO_FAR,
    initial_depth,
    refined_workspace,
)

from resdepth_colmap.report.write_report import write_report

HOSTILE = "a/</script><b>x</b> 'größe\" & 写.png"
NAMES = ("0.png", HOSTILE, "2.png")
OPEN = "#stage"
MINUS, NOT_KNOWN = "\N{MINUS SIGN}", "\N{EN DASH}"

pytestmark = pytest.mark.slow

Opener = Callable[..., OpenPage]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched() as found:
        yield found


@pytest.fixture(scope="module")
def report_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "scene"
    return write_report(refined_workspace(folder, NAMES))


@pytest.fixture
def opened(browser: Any, report_path: Path) -> Iterator[Opener]:
    """Opens the report; after the test it is closed, without a complaint."""
    pages = []

    def open_page(path: Path = report_path, **options: Any) -> OpenPage:
        pages.append(OpenPage(browser, path, **options))
        return pages[-1]

    yield open_page
    for page in pages:
        page.close()


def pixels(png: bytes) -> npt.NDArray[np.int64]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(np.int64)


def shares_of(png: bytes) -> tuple[float, float]:
    """Shares of pixels that have about the colours of the initial and refined cloud."""
    picture = pixels(png)
    first, second = (
        float((np.abs(picture - color).max(axis=2) < 30).mean())
        for color in (BEFORE_COLOR, AFTER_COLOR)
    )
    return first, second


def test_the_slider_shows_more_or_less_of_either_depth(opened: Opener) -> None:
    report = opened()
    middle = pixels(report.picture(OPEN))
    report.page.locator("#split").focus()
    for _ in range(3):
        report.page.keyboard.press("PageUp")
    moved = pixels(report.picture(OPEN))
    changed = (np.abs(moved - middle).max(axis=2) > 40).mean(axis=0)
    half = changed.size // 2
    assert changed[half:].max() > 0.5  # whole columns that the slider uncovered
    assert changed[: half - 30].max() < 0.1
    report.page.keyboard.press("End")
    whole = pixels(report.picture(OPEN))
    assert (np.abs(whole - middle).max(axis=2) > 40)[:, half + 30 :].mean() > 0.1


def test_the_slider_follows_the_mouse(opened: Opener) -> None:
    report = opened()
    report.page.mouse.move(*report.place(OPEN, 0.5, 0.7))
    report.page.mouse.down()
    report.page.mouse.move(*report.place(OPEN, 0.2, 0.7), steps=4)
    report.page.mouse.up()
    value = report.page.locator("#split").input_value()
    assert int(value) == pytest.approx(200, abs=30)


def test_the_pixel_under_the_cursor_has_the_values_of_the_maps(opened: Opener) -> None:
    report = opened()
    depth = plane_views()[0].depth
    height, width = depth.shape
    row, column = height - 5, 10
    place = ((column + 0.5) / width, (row + 0.5) / height)
    report.page.mouse.move(*report.place(OPEN, *place))
    values = report.values()
    assert f"Column {column}, row {row} " in report.page.locator("#where").inner_text()
    initial = initial_depth(depth)[row, column]
    assert float(values["Initial"]) == pytest.approx(initial, rel=1e-3)
    assert float(values["Refined"]) == pytest.approx(depth[row, column], rel=1e-3)
    change = float(values["Change"].rstrip(" %").replace(MINUS, "-"))
    assert change == pytest.approx(100 / TOO_FAR - 100, abs=0.1)
    assert float(values["Confidence"]) == pytest.approx(CONFIDENCE, abs=0.01)


def test_the_keyboard_alone_reads_pixels_and_changes_layer_and_image(
    opened: Opener,
) -> None:
    report = opened()
    page = report.page
    page.locator(OPEN).focus()
    for _ in range(3):
        page.keyboard.press("Shift+ArrowUp")
    assert report.values()["Initial"] == "none"  # the hole rows at the top
    assert "row 0 " in page.locator("#where").inner_text()
    page.locator("#modes input:checked").focus()
    seen = {report.picture(OPEN)}
    for _ in range(6):
        page.keyboard.press("ArrowRight")
        seen.add(report.picture(OPEN))
    assert len(seen) == 7
    page.locator("#strip button").first.focus()
    page.keyboard.press("ArrowRight")
    report.wait_until("location.hash === '#image-2'")
    assert page.locator("#image-name").inner_text() == HOSTILE


def test_names_are_shown_as_they_are_everywhere(opened: Opener) -> None:
    page = opened().page
    assert HOSTILE in page.locator("#image-table").inner_text()
    assert HOSTILE in page.locator("#strip").inner_text()
    assert page.locator("#image-table b:text-is('x')").count() == 0


def test_the_histograms_are_drawn(opened: Opener) -> None:
    report = opened()
    for chart in ("#depth-chart", "#change-chart"):
        picture = pixels(report.picture(f"{chart} canvas"))
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 5


def test_the_cloud_is_drawn_turned_and_switched(opened: Opener) -> None:
    report = opened()
    canvas = "#cloud-canvas"
    report.page.locator(canvas).scroll_into_view_if_needed()
    report.wait_until(
        "document.getElementById('cloud-hint').textContent.includes('points are')"
    )
    first = report.picture_once(canvas, lambda shot: shares_of(shot)[1] > 0.02)
    assert shares_of(first)[0] < 0.001
    report.page.locator(canvas).focus()
    report.page.keyboard.press("ArrowLeft")
    report.page.keyboard.press("ArrowLeft")
    report.picture_once(canvas, lambda shot: shot != first)
    report.page.keyboard.press("b")
    switched = report.picture_once(canvas, lambda shot: shares_of(shot)[0] > 0.02)
    assert shares_of(switched)[1] < 0.001


def test_it_is_dark_where_the_system_is_and_as_the_button_says(opened: Opener) -> None:
    def brightness(report: OpenPage) -> float:
        return float(pixels(report.page.screenshot())[-50:, :30].mean())

    light, dark = opened(color_scheme="light"), opened(color_scheme="dark")
    assert brightness(light) > 200 and brightness(dark) < 60
    dark.page.locator("#theme").click()
    assert brightness(dark) > 200


@pytest.mark.parametrize("width_px", [320, 390, 768])
def test_on_a_phone_nothing_hangs_over_the_edge(opened: Opener, width_px: int) -> None:
    viewport = {"width": width_px, "height": 700}
    report = opened(viewport=viewport, has_touch=True, is_mobile=True)
    width = report.page.evaluate("document.documentElement.scrollWidth")
    assert width == width_px
    box = report.page.locator(OPEN).bounding_box()
    assert box["width"] > 0.7 * width_px
    report.page.locator(OPEN).scroll_into_view_if_needed()
    report.page.locator(OPEN).tap()
    assert report.values()["Refined"] != NOT_KNOWN


def test_two_hundred_images_stay_usable(
    opened: Opener, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    names = tuple(f"folder {number % 7}/{number:04d}.png" for number in range(200))
    folder = refined_workspace(tmp_path, names, size_px=(320, 240), noise=0.1)
    path = write_report(folder)
    assert path.stat().st_size < 10_000_000
    report = opened(path)
    page = report.page
    assert page.locator("#strip li").count() == 200
    # Only what is in sight was decoded.
    assert page.locator("#strip img[src]").count() < 40
    ready = "performance.timing.domComplete - performance.timing.navigationStart"
    record_property("ready_ms", page.evaluate(ready))
    page.locator("#find-text").fill("0123")
    assert page.locator("#strip li:visible").count() == 1
    page.locator("#strip li:visible button").click()
    report.wait_until("location.hash === '#image-124'")
    assert page.locator("#image-name").inner_text() == "folder 4/0123.png"
