"""Measure the memory of the CPU PatchMatch by the number of views, and its start.

    python -m scripts.benchmarks.matching.stereo_memory
        [--size 1632 1224] [--views 12] [--skip-start]

Views of noise in a row, six sources each, both passes, filtered; few sweeps with a
small window, as memory depends on neither. Each run is a separate process. For views of
another size than 2 megapixels `cache_size` is scaled with the pixels, so that it holds
as many images and maps as there: a hundred views of 2 megapixels take more than an hour
of a processor, and small ones show as well whether memory grows with the number of
views. The start is the time from the call of the program to the first progress, with
the default options on views of 640 x 480: cold, with nothing compiled, and warm.

Writes docs/measurements/stereo_memory.json; the figures of other sizes stay in it.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
from PIL import Image

from scripts.benchmarks.record import REPOSITORY, parser, read, stamp, write

NAME = "matching.stereo_memory"
LARGE_PX = (1632, 1224)
START_PX = (640, 480)
NUM_SOURCES = 6
CHEAP = {"num_iterations": 1, "window_radius": 1, "window_step": 1}
Keep = Callable[[dict[str, Any]], None]
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


class MemoryPeaks:
    """The progress of a run, which records the peak of memory in each tenth of it.

    The peak of the process before the first progress, when compiled kernels are loaded,
    hides what comes after it, so it is reset at each step (Linux only).

    Attributes:
        ends_at_once: Whether to raise `Started` at the first progress.
        whole_mb: The peak in MiB of all steps, and of what came before them.
        tenths_mb: Peaks in MiB, shape (10,); those of the first step are left out.
    """

    def __init__(self, ends_at_once: bool) -> None:
        """Start without any peak."""
        self.ends_at_once = ends_at_once
        self.whole_mb = 0.0
        self.tenths_mb = [0.0] * 10

    @contextlib.contextmanager
    def stage(self, title: str, total: int) -> Iterator[Callable[[float], None]]:
        """See `pipeline.progress.Progress`."""
        done = 0.0

        def advance(units: float) -> None:
            nonlocal done
            if self.ends_at_once:
                raise Started
            tenth, peak_mb = min(int(10 * done / total), 9), step_peak_mb()
            self.whole_mb = max(self.whole_mb, peak_mb)
            if done > 0:
                self.tenths_mb[tenth] = max(self.tenths_mb[tenth], peak_mb)
            Path("/proc/self/clear_refs").write_text("5")
            done += units

        yield advance


def step_peak_mb() -> float:
    """The peak of this process since /proc/self/clear_refs was written, in MiB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    raise OSError("/proc/self/status has no VmHWM: this needs Linux")


def run_child(workspace: Path, options: dict[str, Any], ends_at_once: bool) -> None:
    """Match a workspace in this process and print its peaks of memory."""
    from resdepth_colmap.config import StereoBackend, StereoConfig
    from resdepth_colmap.io.colmap.model import read_scene
    from resdepth_colmap.io.colmap.workspace import open_workspace
    from resdepth_colmap.pipeline.stereo.stage import stereo_workspace

    peaks = MemoryPeaks(ends_at_once)
    opened = open_workspace(workspace)
    scene = read_scene(opened.sparse_path, opened.images_path, opened.path)
    with contextlib.suppress(Started):
        stereo_workspace(
            opened, scene, StereoConfig(**options), StereoBackend.CPU, progress=peaks
        )
    whole_mb = max(peaks.whole_mb, step_peak_mb())
    found = {"whole_memory_mb": whole_mb, "tenths_mb": peaks.tenths_mb}
    print(json.dumps(found))


def child(
    workspace: Path, options: dict[str, Any], cache: Path | None, ends_at_once: bool
) -> dict[str, Any]:
    """Run `run_child` in a process; its seconds, and what it printed."""
    environment = dict(os.environ)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    module = [sys.executable, "-m", f"scripts.benchmarks.{NAME}"]
    words = [*module, "--child", str(workspace), json.dumps(options)]
    if ends_at_once:
        words.append("--end-at-once")
    start = time.perf_counter()
    done = subprocess.run(
        words,
        cwd=REPOSITORY,
        env=environment,
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    seconds = time.perf_counter() - start
    return {"seconds": round(seconds, 1), **json.loads(done.stdout)}


def measure_memory(
    num_views: int, size_px: tuple[int, int], options: dict[str, Any]
) -> dict[str, Any]:
    """The peaks of memory of so many views of a size."""
    with tempfile.TemporaryDirectory() as folder:
        workspace = Path(folder) / "dense"
        write_workspace(workspace, num_views, size_px)
        run = child(workspace, {**CHEAP, **DEPTHS, **options}, None, False)
    return {
        "views": num_views,
        "peak_memory_mb": round(run["whole_memory_mb"], 1),
        "tenths_mb": [round(peak, 1) for peak in run["tenths_mb"]],
        "seconds": run["seconds"],
    }


def scaled_cache(size_px: tuple[int, int]) -> float:
    """The `cache_size` that keeps as many images of a size as the default of 2 MP."""
    from resdepth_colmap.config import StereoConfig

    num_pixels, num_large = (width * height for width, height in (size_px, LARGE_PX))
    return StereoConfig().cache_size * num_pixels / num_large


def measure_start() -> dict[str, float]:
    """Seconds to the first progress, with nothing compiled and with everything."""
    with tempfile.TemporaryDirectory() as folder:
        workspace, cache = Path(folder) / "dense", Path(folder) / "cache"
        write_workspace(workspace, 1 + NUM_SOURCES, START_PX)
        cold, warm = (
            child(workspace, DEPTHS, cache, ends_at_once=True)["seconds"]
            for _ in range(2)
        )
    return {"cold_s": cold, "warm_s": warm}


def measure_series(arguments: argparse.Namespace, keep: Keep) -> None:
    """Run after run of a size; each is kept when it is done."""
    width_px, height_px = arguments.size
    words = ["--size", *map(str, arguments.size), "--views", *map(str, arguments.views)]
    options = {"cache_size": scaled_cache((width_px, height_px))}
    head = stamp(" ".join([NAME, *words]))
    series: dict[str, Any] = {
        **head,
        "options": {**CHEAP, "num_sources": NUM_SOURCES, **options},
        "runs": [],
    }
    for num_views in arguments.views:
        run = measure_memory(num_views, (width_px, height_px), options)
        series["runs"].append(run)
        keep({**head, "sizes": {f"{width_px} x {height_px}": series}})


def parsed() -> argparse.Namespace:
    """The command line."""
    options = parser(__doc__, "stereo_memory", reads_data=False)
    options.add_argument("--size", type=int, nargs=2, default=LARGE_PX)
    options.add_argument("--views", type=int, nargs="*", default=[12])
    options.add_argument("--skip-start", action="store_true")
    options.add_argument("--child", nargs=2, metavar=("WORKSPACE", "OPTIONS"))
    options.add_argument("--end-at-once", action="store_true")
    return options.parse_args()


def main() -> None:
    """Read the command line, measure and write."""
    arguments = parsed()
    if arguments.child:
        path, options = arguments.child
        run_child(Path(path), json.loads(options), arguments.end_at_once)
        return
    output: Path = arguments.output

    def keep(part: dict[str, Any]) -> None:
        kept = read(output)
        sizes = {**kept.get("sizes", {}), **part.get("sizes", {})}
        write(output, {**kept, **part, "sizes": sizes})

    if not arguments.skip_start:
        keep({"start": measure_start()})
    measure_series(arguments, keep)


if __name__ == "__main__":
    main()
