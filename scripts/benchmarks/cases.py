"""Run the failing cases of real users and keep what they say.

    python -m scripts.benchmarks.cases [--cases FOLDER] [--work FOLDER] [--output FILE]

Each case is a program of its own (shared/cases/NAME.py FOLDER) that makes an exact
workspace, runs `resdepth-colmap` from the PATH and exits with 0 if the right thing
happened; its last line says what happened. The results go to
docs/measurements/cases.json.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from scripts.benchmarks.record import BUILD, REPOSITORY, parser, stamp

CASES = Path(os.environ.get("RESDEPTH_CASES", REPOSITORY.parent / "shared" / "cases"))
SCENE_NAME = "scene.py"


def main() -> int:
    """Run all cases; the number that went wrong."""
    options = parser(__doc__, "cases", reads_data=False)
    options.add_argument("--cases", type=Path, default=CASES)
    options.add_argument("--work", type=Path, default=BUILD / "cases")
    arguments = options.parse_args()
    paths = sorted(arguments.cases.glob("*.py")) if arguments.cases.is_dir() else []
    results = {
        path.stem: run(path, arguments.work / path.stem)
        for path in paths
        if path.name != SCENE_NAME
    }
    if not results:
        print(f"{arguments.cases}: no cases there; set RESDEPTH_CASES.")
        return 0
    record = {**stamp("cases"), "cases": results}
    arguments.output.write_text(json.dumps(record, indent=2) + "\n", "utf-8")
    return sum(not result["right"] for result in results.values())


def run(path: Path, folder: Path) -> dict[str, str | bool]:
    """Run one case in a folder and print what it says."""
    folder.mkdir(parents=True, exist_ok=True)
    commands = Path(sys.executable).parent
    environment = {**os.environ, "PATH": f"{commands}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        [sys.executable, str(path), str(folder)],
        capture_output=True,
        text=True,
        env=environment,
    )
    said = (done.stdout.strip().splitlines() or [done.stderr.strip()[-200:]])[-1]
    print(f"{path.stem}: {said}", flush=True)
    return {"right": done.returncode == 0, "said": said}


if __name__ == "__main__":
    sys.exit(main())
