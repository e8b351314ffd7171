"""The exact plane as a scene to train on: maps that are wrong here and there."""

from pathlib import Path

import numpy as np
from planes import write_plane_workspace

from resdepth_colmap.io.colmap.maps import write_depth_map


def write_noisy_plane(
    path: Path,
    *,
    kinds: tuple[str, ...] = ("photometric",),
    unknown_share: float = 0.0,
    wrong_share: float = 0.1,
    size_px: tuple[int, int] = (80, 60),
    seed: int = 0,
) -> Path:
    """Write the workspace of the plane, with its truth and with mistaken maps.

    Args:
        path: Its folder.
        kinds: The kinds of maps; "geometric" ones are exact and have holes instead.
        unknown_share: Share of pixels whose truth is not known, in 0..1.
        wrong_share: Share of pixels whose depth is 1.3 times the true one, in 0..1.
        size_px: Width and height of the images.
        seed: Of the mistakes.

    Returns:
        The folder.
    """
    rng = np.random.default_rng(seed)
    for view in write_plane_workspace(path, kinds=kinds, size_px=size_px):
        name, depth = view.view.name, view.depth
        is_wrong = rng.random(depth.shape) < wrong_share
        maps = {
            "photometric": np.where(is_wrong, 1.3 * depth, depth),
            "geometric": np.where(is_wrong, 0.0, depth),
        }
        for kind in kinds:
            file_path = path / "stereo" / "depth_maps" / f"{name}.{kind}.bin"
            write_depth_map(file_path, maps[kind].astype(np.float32))
        is_unknown = rng.random(depth.shape) < unknown_share
        truth = np.where(is_unknown, 0.0, depth).astype(np.float32)
        write_depth_map(path / "ground_truth" / f"{name}.bin", truth)
    return path
