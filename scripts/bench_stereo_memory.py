"""Measure the memory of the CPU PatchMatch by the number of views, and its start.

    python scripts/bench_stereo_memory.py [--views 12 100] [--skip-start]

Views of 2 megapixels of noise in a row, six sources each, both passes, filtered; few
sweeps with a small window, as memory depends on neither. Each run is a process of its
own. The start is what passes from the call of the program to the first progress, with
the default options on views of 640 x 480: cold, with nothing compiled, and warm. Writes
docs/measurements/stereo_memory.json; then `python scripts/make_tables.py` puts the
figures into the documents.
"""

import argparse
import datetime
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from PIL import Image

REPOSITORY = Path(__file__).resolve().parents[1]
RESULT = REPOSITORY / "docs" / "measurements" / "stereo_memory.json"
LARGE_PX = (1632, 1224)
SMALL_PX = (640, 480)
NUM_SOURCES = 6
CHEAP = {"num_iterations": 1, "window_radius": 1, "window_step": 1}
DEPTHS = {"depth_min": 2.0, "depth_max": 8.0}


def write_workspace(path: Path, num_views: int, size_px: tuple[int, int]) -> None:
    """Views in a row that all show the same noise; each is a link to one file."""
    width_px, height_px = size_px
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (height_px, width_px), dtype=np.uint8)
    (path / "images").mkdir(parents=True)
    Image.fromarray(noise).save(path / "noise.jpg")
    model = pycolmap.Reconstruction()
    params = [width_px, width_px, width_px / 2, height_px / 2]
    camera = pycolmap.Camera(
        camera_id=1, model="PINHOLE", width=width_px, height=height_px, params=params
    )
    model.add_camera_with_trivial_rig(camera)
    names = [f"{index:03}.jpg" for index in range(num_views)]
    for index, name in enumerate(names):
        os.link(path / "noise.jpg", path / "images" / name)
        pose = np.eye(3, 4)
        pose[0, 3] = -0.1 * index
        image = pycolmap.Image(name=name, camera_id=1, image_id=index + 1)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pose))
    (path / "sparse").mkdir()
    model.write(path / "sparse")
    lines = []
    for index, name in enumerate(names):
        others = sorted(range(num_views), key=lambda other: abs(other - index))
        sources = ", ".join(names[other] for other in others[1 : 1 + NUM_SOURCES])
        lines += [name, sources]
    (path / "stereo").mkdir()
    (path / "stereo" / "patch-match.cfg").write_text("\n".join(lines) + "\n")


class Started(BaseException):
    """The first progress was made."""


def run_child(workspace: Path, options: dict[str, Any], until_progress: bool) -> None:
    """Match a workspace in this process and print its peak of memory, or "started"."""
    import contextlib
    from collections.abc import Iterator

    from resdepth_colmap.config import StereoBackend, StereoConfig
    from resdepth_colmap.io.model import read_scene
    from resdepth_colmap.io.workspace import open_workspace
    from resdepth_colmap.pipeline.progress import Advance, Progress, SilentProgress
    from resdepth_colmap.pipeline.stereo import stereo_workspace
    from resdepth_colmap.pipeline.versions import peak_memory_mb

    class First:
        """Ends all at the first progress."""

        @contextlib.contextmanager
        def stage(self, title: str, total: int) -> Iterator[Advance]:
            def advance(units: float) -> None:
                raise Started

            yield advance

    progress: Progress = First() if until_progress else SilentProgress()
    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    with contextlib.suppress(Started):
        stereo_workspace(
            opened, scene, StereoConfig(**options), StereoBackend.CPU, progress=progress
        )
    print(json.dumps({"peak_memory_mb": peak_memory_mb()}))


def child(
    workspace: Path, options: dict[str, Any], cache: Path | None, until_progress: bool
) -> dict[str, float]:
    """Run `run_child` in a process; its seconds, and what it printed."""
    environment = dict(os.environ)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    words = [sys.executable, __file__, "--child", str(workspace), json.dumps(options)]
    if until_progress:
        words.append("--until-progress")
    start = time.perf_counter()
    done = subprocess.run(
        words, env=environment, stdout=subprocess.PIPE, check=True, text=True
    )
    seconds = time.perf_counter() - start
    return {"seconds": round(seconds, 1), **json.loads(done.stdout)}


def measure_memory(num_views: int) -> dict[str, Any]:
    """The peak of memory of so many views."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = Path(folder) / "dense"
        write_workspace(workspace, num_views, LARGE_PX)
        run = child(workspace, {**CHEAP, **DEPTHS}, None, until_progress=False)
    peak_mb = round(run["peak_memory_mb"])
    return {"views": num_views, "peak_memory_mb": peak_mb, "seconds": run["seconds"]}


def measure_start() -> dict[str, float]:
    """Seconds to the first progress, with nothing compiled and with everything."""
    with tempfile.TemporaryDirectory() as folder:
        workspace, cache = Path(folder) / "dense", Path(folder) / "cache"
        write_workspace(workspace, 1 + NUM_SOURCES, SMALL_PX)
        cold, warm = (
            child(workspace, DEPTHS, cache, until_progress=True)["seconds"]
            for _ in range(2)
        )
    return {"cold_s": cold, "warm_s": warm}


def main() -> None:
    """Read the command line, measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, nargs="*", default=[12, 100])
    parser.add_argument("--skip-start", action="store_true")
    parser.add_argument("--output", type=Path, default=RESULT)
    parser.add_argument("--child", nargs=2, metavar=("WORKSPACE", "OPTIONS"))
    parser.add_argument("--until-progress", action="store_true")
    arguments = parser.parse_args()
    if arguments.child:
        path, options = arguments.child
        run_child(Path(path), json.loads(options), arguments.until_progress)
        return
    from resdepth_colmap.pipeline.versions import versions

    output: Path = arguments.output
    views = ["--views", *map(str, arguments.views)] if arguments.views else []
    measured = json.loads(output.read_text("utf-8")) if output.exists() else {}
    measured |= {
        "command": " ".join(["python", "scripts/bench_stereo_memory.py", *views]),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "versions": versions(),
        "options": {**CHEAP, "num_sources": NUM_SOURCES, "size_px": LARGE_PX},
    }
    if not arguments.skip_start:
        measured["start"] = measure_start()
        keep(measured, output)
    runs: list[dict[str, Any]] = []
    for number in arguments.views:
        runs.append(measure_memory(number))
        keep({**measured, "memory": runs}, output)


def keep(measured: dict[str, Any], output: Path) -> None:
    """Write down what was measured so far, and print it."""
    from resdepth_colmap.evaluation.tables import stereo_memory_table

    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(json.dumps(measured, indent=2) + "\n", "utf-8")
    if "memory" in measured:
        print(stereo_memory_table(measured), flush=True)


if __name__ == "__main__":
    main()
