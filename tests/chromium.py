"""A headless Chromium for the tests of the report; they skip where there is none."""

import contextlib
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
_SOFTWARE_GL = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
_TIMEOUT_S = 120  # a busy machine draws slowly


@contextlib.contextmanager
def launched() -> Iterator[Any]:
    """A browser of playwright's; the test is skipped where there is none."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed (pip install .[dev])"
    )
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium on this machine (Debian: apt install chromium)")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=path, args=[*_SOFTWARE_GL, "--no-sandbox"]
        )
        yield browser
        browser.close()


class OpenPage:
    """A report in a browser, and all it complained about or asked a network for."""

    def __init__(self, browser: Any, path: Path, **options: Any) -> None:
        """Open the page and wait until its first image is drawn."""
        options.setdefault("viewport", {"width": 1200, "height": 800})
        self.context = browser.new_context(reduced_motion="reduce", **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(1000 * _TIMEOUT_S)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("#right-layer:not([hidden])")
        self.wait_until("document.getElementById('right-layer').width > 1")

    def wait_until(self, condition: str) -> None:
        """Wait for a JavaScript condition; playwright's own way needs `eval`."""
        end = time.monotonic() + _TIMEOUT_S
        while not self.page.evaluate(condition):
            assert time.monotonic() < end, f"never came true: {condition}"
            self.page.wait_for_timeout(20)

    def place(self, selector: str, x: float, y: float) -> tuple[float, float]:
        """Where on the screen a place of an element is, in shares of its size."""
        self.page.locator(selector).scroll_into_view_if_needed()
        box = self.page.locator(selector).bounding_box()
        return box["x"] + x * box["width"], box["y"] + y * box["height"]

    def picture(self, selector: str) -> bytes:
        """What an element looks like now, as PNG."""
        self.page.locator(selector).scroll_into_view_if_needed()
        shot: bytes = self.page.locator(selector).screenshot()
        return shot

    def picture_once(self, selector: str, is_right: Callable[[bytes], bool]) -> bytes:
        """What an element looks like once it looks right: drawing takes a while."""
        end = time.monotonic() + _TIMEOUT_S
        while not is_right(shot := self.picture(selector)):
            assert time.monotonic() < end, f"{selector} never looked right"
            self.page.wait_for_timeout(50)
        return shot

    def values(self) -> dict[str, str]:
        """What is said of the pixel under the cursor."""
        terms = self.page.locator("#values dt").all_text_contents()
        return dict(
            zip(terms, self.page.locator("#values dd").all_text_contents(), strict=True)
        )

    def close(self) -> None:
        """Close it; it must not have complained, nor asked for anything."""
        self.context.close()
        asked = [url for url in self.requests if not url.startswith(("file:", "data:"))]
        assert not self.complaints and not asked, (self.complaints, asked)
