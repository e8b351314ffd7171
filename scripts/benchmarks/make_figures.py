"""Make the README's pictures from the folder that `make demo` fills.

    make demo && python -m scripts.benchmarks.make_figures [--only strip]

One is a strip of the demo, the other a screenshot of its report, which needs a Chromium
(scripts/install_chromium.sh) and playwright (pip install .[dev]).
"""

import argparse
import io
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from scripts.benchmarks.record import REPOSITORY

if TYPE_CHECKING:
    from playwright.sync_api import Page

IMAGES = REPOSITORY / "docs" / "images"
WEBP_QUALITY = 66
WIDTH_PX, HEIGHT_PX = 1280, 900
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--no-sandbox"]


def write_strip(room: Path, image_name: str) -> Path:
    """Write a strip of the demo, compressed to about 150 kB."""
    target = IMAGES / "demo_strip.webp"
    with Image.open(room / "resdepth" / "pictures" / f"{image_name}.png") as picture:
        picture.save(target, quality=WEBP_QUALITY, method=6)
    return target


def write_report_figure(room: Path) -> Path:
    """Open the report in a browser and write what it shows."""
    from playwright.sync_api import sync_playwright

    target = IMAGES / "report.jpg"
    with sync_playwright() as driver:
        path = shutil.which("chromium") or shutil.which("google-chrome")
        browser = driver.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        page = browser.new_page(
            viewport={"width": WIDTH_PX, "height": HEIGHT_PX}, reduced_motion="reduce"
        )
        page.goto((room / "resdepth/report.html").as_uri())
        shot = picture(page)
        browser.close()
    with Image.open(io.BytesIO(shot)) as image:
        image.convert("RGB").save(target, quality=80, optimize=True, progressive=True)
    return target


def picture(page: "Page") -> bytes:
    """A screenshot of the report's images, with the pointer on a pixel."""
    page.wait_for_selector("#right-layer:not([hidden])")
    page.locator("#split").fill("420")
    page.evaluate("document.getElementById('images').scrollIntoView()")
    box = page.locator("#stage").bounding_box()
    if box is None:
        raise SystemExit("the report shows no image")
    page.mouse.move(box["x"] + 0.27 * box["width"], box["y"] + 0.55 * box["height"])
    page.wait_for_timeout(500)
    return page.screenshot()


def main() -> None:
    """Read the command line and write the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    figures = ("strip", "report")
    parser.add_argument("--demo", type=Path, default=REPOSITORY / "demo")
    parser.add_argument("--image", default="0002.png", help="whose strip")
    parser.add_argument("--only", choices=figures, nargs="*", default=figures)
    arguments = parser.parse_args()
    (room,) = arguments.demo.resolve().glob("room_*")
    IMAGES.mkdir(parents=True, exist_ok=True)
    if "strip" in arguments.only:
        print(write_strip(room, arguments.image))
    if "report" in arguments.only:
        print(write_report_figure(room))


if __name__ == "__main__":
    main()
