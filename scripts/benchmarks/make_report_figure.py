"""Make the README's picture of the report from the folder that `make demo` filled.

    make demo && python -m scripts.benchmarks.make_report_figure

Needs a Chromium (scripts/install_chromium.sh) and playwright (pip install .[dev]).
"""

import argparse
import io
import shutil
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

REPOSITORY = Path(__file__).resolve().parents[2]
FIGURE = REPOSITORY / "docs" / "images" / "report.jpg"
WIDTH_PX, HEIGHT_PX = 1280, 900
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--no-sandbox"]


def main() -> None:
    """Read the command line, open the report and write the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", type=Path, default=REPOSITORY / "demo")
    arguments = parser.parse_args()
    (room,) = arguments.demo.resolve().glob("room_*")
    with sync_playwright() as driver:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = driver.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        page = browser.new_page(
            viewport={"width": WIDTH_PX, "height": HEIGHT_PX}, reduced_motion="reduce"
        )
        page.goto((room / "resdepth/report.html").as_uri())
        shot = picture(page)
        browser.close()
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(io.BytesIO(shot)) as image:
        image.convert("RGB").save(FIGURE, quality=80, optimize=True, progressive=True)
    print(FIGURE)


def picture(page: Page) -> bytes:
    """The images of the report, a pixel pointed at."""
    page.wait_for_selector("#right-layer:not([hidden])")
    page.locator("#split").fill("420")
    page.evaluate("document.getElementById('images').scrollIntoView()")
    box = page.locator("#stage").bounding_box()
    if box is None:
        raise SystemExit("the report shows no image")
    page.mouse.move(box["x"] + 0.27 * box["width"], box["y"] + 0.55 * box["height"])
    page.wait_for_timeout(500)
    return page.screenshot()


if __name__ == "__main__":
    main()
