"""Fetch and unpack ETH3D's scenes for `resdepth-colmap evaluate eth3d`.

    python -m scripts.prepare_eth3d ETH3D/ [SCENE ...] [--part dslr_scan_eval]

Without names the paper's seven scenes. What is there is kept; a download that stopped
goes on. Sizes and checksums are written to ETH3D/eth3d.lock.json at the first download
and compared from then on (ETH3D publishes none that we know of). Needs a network,
py7zr (pip install 'resdepth-colmap[eth3d]'), and some GB a scene.
"""

import argparse
import sys
from pathlib import Path

from resdepth_colmap.errors import ResDepthError
from scripts.eth3d_archives import (
    BASE_URL,
    DEPTH_PARTS,
    PARTS,
    SCENES,
    Fetching,
    prepare_scenes,
)


def main() -> int:
    """Read the command line, fetch, and say what came and what did not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("scenes", nargs="*", help=f"default: {' '.join(SCENES)}")
    parser.add_argument(
        "--part", action="append", choices=PARTS, help=f"default: {DEPTH_PARTS}"
    )
    parser.add_argument("--keep-archives", action="store_true")
    parser.add_argument("--base-url", default=BASE_URL)
    arguments = parser.parse_args()
    fetching = Fetching(
        root=arguments.root,
        base_url=arguments.base_url.rstrip("/"),
        keep_archives=arguments.keep_archives,
        on_bytes=show_bytes,
        on_done=lambda name, size: print(f"\r{name}: {size:,} bytes, unpacked"),
    )
    try:
        failed = prepare_scenes(
            arguments.scenes or SCENES, arguments.part or DEPTH_PARTS, fetching
        )
    except ResDepthError as error:
        failed = {"prepare_eth3d.py": str(error)}
    for name, reason in failed.items():
        print(f"Error: {name}: {reason}", file=sys.stderr)
    return 1 if failed else 0


def show_bytes(there: int, total: int | None) -> None:
    """The progress of a download, on a terminal."""
    if sys.stderr.isatty():
        of = f" of {total:,}" if total else ""
        print(f"\r{there:,}{of} bytes ", end="", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
