"""Run `resdepth-colmap refine` on the real workspaces, as a user does.

    python -m scripts.benchmarks.workspaces [--work FOLDER] [--only plant-geometric ...]

Each run starts from a fresh copy below --work, where its pictures and cloud stay.
`castle_photos` starts from the photos: structure from motion and undistortion by
pycolmap first. Writes docs/measurements/workspaces.json after each workspace.
"""

import json
import shutil
import time
from pathlib import Path
from typing import Any

from scripts.benchmarks.program import run
from scripts.benchmarks.record import BUILD, hardware, parser, read, stamp, today, write

SAMPLES: dict[str, tuple[str, list[str]]] = {
    "meeting_room": ("meeting_room", []),
    "plant-photometric": ("plant", ["--input", "photometric"]),
    "plant-geometric": ("plant", ["--input", "geometric"]),
    "walnut": ("walnut", ["--stereo", "cpu", "--max-image-size", "800"]),
    "castle_photos": ("castle_photos", ["--max-image-size", "1000"]),
}


def reconstruct(photos: Path, workspace: Path) -> float:
    """From photos to a dense workspace, by pycolmap; returns the seconds it took."""
    import pycolmap

    start = time.perf_counter()
    workspace.mkdir(parents=True)
    database = workspace / "database.db"
    pycolmap.extract_features(database, photos)
    pycolmap.match_exhaustive(database)
    models = pycolmap.incremental_mapping(database, photos, workspace / "sfm")
    largest = max(models, key=lambda index: models[index].num_reg_images())
    pycolmap.undistort_images(
        workspace / "dense", workspace / "sfm" / str(largest), photos
    )
    return time.perf_counter() - start


def prepare(sample: str, data: Path, work: Path) -> tuple[Path, float]:
    """A fresh copy of the workspace, and the seconds of structure from motion."""
    source, target = data / SAMPLES[sample][0], work / sample
    shutil.rmtree(target, ignore_errors=True)
    if (source / "sparse").is_dir():
        shutil.copytree(source, target)
        return target, 0.0
    return target / "dense", reconstruct(source, target)


def measure(
    sample: str, data: Path, work: Path, before: dict[str, Any] | None
) -> dict[str, Any]:
    """Run the command on a workspace and collect the figures of its run.json.

    Args:
        sample: Name of the workspace and its options.
        data: Folder of the real data.
        work: Folder of the copies.
        before: Figures of an earlier run whose copy exists: its matched maps and their
            seconds are kept, the rest is done again. None = all is done.
    """
    options, extra = SAMPLES[sample][1], []
    if before is None:
        workspace, sfm_s = prepare(sample, data, work)
    else:
        workspace = work / sample / ("dense" if "castle" in sample else "")
        sfm_s = before["seconds"]["structure_from_motion"]
        extra = ["--overwrite"]
    wall_s = run("refine", workspace, *options, *extra)["seconds"]
    record = json.loads((workspace / "resdepth" / "run.json").read_text("utf-8"))
    images = record["images"].values()
    if before is not None:
        kept_s = before["seconds"]["stereo"]
        wall_s += kept_s - record["seconds"]["stereo"]
        record["seconds"]["stereo"] = kept_s
    return {
        "date": today(),
        "hardware": hardware(),
        "options": options,
        "num_images": len(images),
        "seconds": {"structure_from_motion": round(sfm_s, 1), **record["seconds"]},
        "seconds_in_all": round(wall_s, 1),
        "peak_memory_mb": record["peak_memory_mb"],
        "points_before": record["fuse"]["points_before_refinement"],
        "points_after": record["fuse"]["points"],
        "filled_before": _mean([image["filled_before"] for image in images]),
        "filled_after": _mean([image["filled_after"] for image in images]),
    }


def _mean(values: list[float]) -> float:
    return round(sum(values) / len(values), 4)


def main() -> None:
    """Read the command line, measure and write workspace by workspace."""
    options = parser(__doc__, "workspaces")
    options.add_argument("--work", type=Path, default=BUILD / "workspaces")
    options.add_argument("--only", nargs="*", choices=SAMPLES, default=list(SAMPLES))
    options.add_argument(
        "--keep-maps", action="store_true", help="keep the maps matched earlier"
    )
    arguments = options.parse_args()
    for sample in arguments.only:
        results = read(arguments.output).get("workspaces", {})
        before = results[sample] if arguments.keep_maps else None
        results[sample] = measure(sample, arguments.data, arguments.work, before)
        write(arguments.output, {**stamp("workspaces"), "workspaces": results})


if __name__ == "__main__":
    main()
