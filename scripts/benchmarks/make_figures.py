"""Make the README's picture from the folder that `make demo` filled.

    make demo && python -m scripts.benchmarks.make_figures

The picture is one of the demo's own strips.
"""

import argparse
from pathlib import Path

from PIL import Image

REPOSITORY = Path(__file__).resolve().parents[2]
FIGURE = REPOSITORY / "docs" / "images" / "demo_strip.png"


def main() -> None:
    """Read the command line and write the figure, in few colours to keep it small."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--demo", type=Path, default=REPOSITORY / "demo")
    parser.add_argument("--image", default="0002.png")
    arguments = parser.parse_args()
    (room,) = arguments.demo.glob("room_*")
    strip = room / "resdepth" / "pictures" / f"{arguments.image}.png"
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(strip) as picture:
        small = picture.convert("RGB").quantize(256)
        small.save(FIGURE, optimize=True)
    print(FIGURE)


if __name__ == "__main__":
    main()
