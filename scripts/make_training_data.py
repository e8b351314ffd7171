"""Render and match rooms: training data like that of the shipped weights.

    python -m scripts.make_training_data rooms --num-scenes 300 --workers 2

Most rooms have two views, some three or four: maps are matched with one source or with
several. Finished rooms are kept.
"""

import argparse
import multiprocessing
import os
import shutil
from functools import partial
from pathlib import Path

VIEW_COUNTS = (2, 2, 2, 3, 2, 2, 4)


def make_room(output: Path, seed: int) -> str:
    """Render a room and match its views; returns a line for the log."""
    from resdepth_colmap.config import StereoBackend, StereoConfig, SynthesisConfig
    from resdepth_colmap.errors import WorkspaceError
    from resdepth_colmap.io.colmap.model import read_scene
    from resdepth_colmap.io.colmap.workspace import open_workspace
    from resdepth_colmap.pipeline.stereo.stage import stereo_workspace
    from resdepth_colmap.synthetic.synthesize import synthesize

    config = SynthesisConfig(
        num_views=VIEW_COUNTS[seed % len(VIEW_COUNTS)],
        width_px=544,  # a crop of 512 x 384 has room to move
        height_px=416,
        seed=seed,
    )
    (path,) = synthesize(output, config)
    workspace = open_workspace(path)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    try:
        report = stereo_workspace(
            workspace, scene, StereoConfig(seed=seed, filter=False), StereoBackend.CPU
        )
    except WorkspaceError as error:  # its views do not overlap
        shutil.rmtree(path)
        return f"{path.name}: left out: {error}"
    return f"{path.name}: {len(report.matched)} matched, {len(report.kept)} kept"


def main() -> None:
    """Read the command line and make the rooms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("--num-scenes", type=int, default=300)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    os.environ["NUMBA_NUM_THREADS"] = "1"
    os.environ["OMP_NUM_THREADS"] = "1"
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.num_scenes)
    context = multiprocessing.get_context("spawn")
    with context.Pool(arguments.workers) as pool:
        make = partial(make_room, arguments.output)
        for line in pool.imap_unordered(make, seeds):
            print(line, flush=True)
        pool.close()  # a terminated worker would print a stack (pycolmap)
        pool.join()


if __name__ == "__main__":
    main()
