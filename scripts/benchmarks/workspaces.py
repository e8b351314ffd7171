"""Run `resdepth-colmap refine` on the real workspaces, as a user would, and keep score.

    python -m scripts.benchmarks.workspaces --output /somewhere
        [--only plant-geometric ...]

Each run starts from a fresh copy below --output (links where possible), where its
pictures and cloud can be looked at afterwards. `castle_photos` starts from the photos:
structure from motion and undistortion by pycolmap first. The figures go to
docs/measurements/workspaces.json.
"""

import argparse
import datetime
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
RESULT = REPOSITORY / "docs" / "measurements" / "workspaces.json"
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


def prepare(sample: str, data: Path, output: Path) -> tuple[Path, float]:
    """A fresh copy of the workspace, and the seconds of structure from motion."""
    source, target = data / SAMPLES[sample][0], output / sample
    shutil.rmtree(target, ignore_errors=True)
    if (source / "sparse").is_dir():
        shutil.copytree(source, target)
        return target, 0.0
    return target / "dense", reconstruct(source, target)


def measure(
    sample: str, data: Path, output: Path, before: dict[str, Any] | None
) -> dict[str, Any]:
    """Run the command on the case and collect what its record says.

    Args:
        sample: Which one.
        data: Folder of the real data.
        output: Folder of the copies.
        before: Figures of an earlier run, whose copy is there: its matched maps and
            their seconds are kept, the rest is done again. None = all is done.
    """
    extra = []
    if before is None:
        workspace, sfm_s = prepare(sample, data, output)
    else:
        workspace = output / sample / ("dense" if "castle" in sample else "")
        sfm_s = before["seconds"]["structure_from_motion"]
        extra = ["--overwrite"]
    program = Path(sys.executable).parent / "resdepth-colmap"
    command = [str(program), "refine", str(workspace)]
    start = time.perf_counter()
    subprocess.run([*command, *SAMPLES[sample][1], *extra], check=True)
    wall_s = time.perf_counter() - start
    record = json.loads((workspace / "resdepth" / "run.json").read_text("utf-8"))
    images = record["images"].values()
    if before is not None:
        kept_s = before["seconds"]["stereo"]
        wall_s += kept_s - record["seconds"]["stereo"]
        record["seconds"]["stereo"] = kept_s
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "options": SAMPLES[sample][1],
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
    """Read the command line and measure case by case."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = REPOSITORY.parent / "shared" / "data"
    parser.add_argument(
        "--data", type=Path, default=os.environ.get("RESDEPTH_DATA", default)
    )
    parser.add_argument("--output", type=Path, default=REPOSITORY / "build" / "bench")
    parser.add_argument("--only", nargs="*", choices=SAMPLES, default=list(SAMPLES))
    parser.add_argument(
        "--keep-maps", action="store_true", help="match nothing again; see measure()"
    )
    arguments = parser.parse_args()
    for sample in arguments.only:
        results = json.loads(RESULT.read_text("utf-8")) if RESULT.exists() else {}
        before = results[sample] if arguments.keep_maps else None
        results[sample] = measure(
            sample, Path(arguments.data), arguments.output, before
        )
        RESULT.parent.mkdir(parents=True, exist_ok=True)
        RESULT.write_text(json.dumps(results, indent=2) + "\n", "utf-8")
        print(sample, json.dumps(results[sample]))


if __name__ == "__main__":
    main()
