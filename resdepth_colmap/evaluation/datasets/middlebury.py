"""Middlebury's stereo scenes as distributed: calib.txt, two images, disparity.

Middlebury Stereo Evaluation v3 (MiddEval3) and the 2014 data sets; Scharstein et al.,
GCPR 2014. Depth = baseline * f / (disparity + doffs), here in metres.
"""

import functools
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.evaluation.datasets.sample import (
    DepthSample,
    LazySample,
    SampleOptions,
)
from resdepth_colmap.io.exported_map import read_pfm
from resdepth_colmap.io.files import read_text
from resdepth_colmap.io.images import read_gray, read_unit_colors
from resdepth_colmap.matching.patch_match import MatchView
from resdepth_colmap.scene import DepthMap, FloatMap, Matrix

CALIBRATION_NAME = "calib.txt"
IMAGE_NAMES = ("im0.png", "im1.png")
TRUTH_NAMES = ("disp0.pfm", "disp0GT.pfm")
SEEN_NAMES = ("mask0nocc.png", "mask0-nocc.png")

Calibration = Mapping[str, tuple[float, ...]]
"""The numbers of calib.txt, by name."""

_MM = 1e-3
_LEAST_DISPARITY_PX = 1.0  # with doffs; keeps the depth range finite
_LINE = re.compile(r"\s*(\w+)\s*=\s*(.+?)\s*")
_NEEDED = ("cam0", "cam1", "doffs", "baseline", "ndisp")


def is_middlebury_scene(path: Path) -> bool:
    """Whether a folder looks like a scene as distributed."""
    return (path / CALIBRATION_NAME).is_file() and not (path / "sparse").is_dir()


def read_middlebury_samples(path: Path, options: SampleOptions) -> list[LazySample]:
    """The one sample of a scene; see `read_middlebury_sample`."""
    return [functools.partial(read_middlebury_sample, path, options)]


def read_middlebury_sample(path: Path, options: SampleOptions) -> DepthSample:
    """Read a scene as distributed: im0 against im1. `options` may have a depth range.

    Raises:
        WorkspaceError: If a file is missing or broken, or sizes differ.
    """
    calibration = read_calibration(path / CALIBRATION_NAME)
    disparity_path = _first_of(path, TRUTH_NAMES)
    if disparity_path is None:
        raise WorkspaceError(
            f"{path}: no {' or '.join(TRUTH_NAMES)}; unpack the ground truth there, "
            "too."
        )
    images = [read_gray(path / name) for name in IMAGE_NAMES]
    disparity = read_pfm(disparity_path)
    seen_path = _first_of(path, SEEN_NAMES)  # 255; occluded are grey
    seen = None if seen_path is None else np.asarray(read_gray(seen_path) == 1)
    shapes = {(path / IMAGE_NAMES[0]): images[0].shape, disparity_path: disparity.shape}
    if seen is not None:
        shapes[path / SEEN_NAMES[0]] = seen.shape
    if len(set(shapes.values())) > 1:
        sizes = ", ".join(f"{p.name} {s[1]} x {s[0]}" for p, s in shapes.items())
        raise WorkspaceError(
            f"{path}: the files differ in size ({sizes}); take images and truth of one "
            "resolution (F, H or Q)."
        )
    poses = np.eye(3, 4), np.eye(3, 4)
    poses[1][0, 3] = -_MM * calibration["baseline"][0]
    views = [
        MatchView(gray=gray, K=_matrix(calibration, camera), cam_from_world=pose)
        for gray, camera, pose in zip(images, ("cam0", "cam1"), poses, strict=True)
    ]
    near, far = options.stereo.depth_min, options.stereo.depth_max
    return DepthSample(
        name=IMAGE_NAMES[0],
        reference=views[0],
        sources=(views[1],),
        depth_range=(near, far) if near > 0 else _depth_range(calibration),
        truth=depth_from_disparity(disparity, calibration),
        seen=seen,
        colors=read_unit_colors(path / IMAGE_NAMES[0]),
        source_colors=(read_unit_colors(path / IMAGE_NAMES[1]),),
    )


def read_calibration(path: Path) -> dict[str, tuple[float, ...]]:
    """Read a calib.txt: each line "name=number" or "name=[a b c; d e f; g h i]".

    Raises:
        WorkspaceError: If it cannot be read, or a required entry is missing.
    """
    entries = {}
    for line_number, line in enumerate(read_text(path).splitlines(), 1):
        match = _LINE.fullmatch(line)
        if match is None:
            continue
        try:
            values = tuple(float(it) for it in re.findall(r"[^\s;\[\]]+", match[2]))
        except ValueError as error:
            raise WorkspaceError(
                f"{path}, line {line_number}: {match[2]!r} is not a number."
            ) from error
        entries[match[1]] = values
    for name in _NEEDED:
        expected = 9 if name.startswith("cam") else 1
        if len(entries.get(name, ())) != expected:
            raise WorkspaceError(
                f"{path}: no {name} with {expected} numbers; Middlebury's calib.txt "
                f"has {', '.join(_NEEDED)}."
            )
    return entries


def depth_from_disparity(disparity: FloatMap, calibration: Calibration) -> DepthMap:
    """Depth in metres, same shape, float32; 0 where the disparity is unknown."""
    shifted = disparity + calibration["doffs"][0]
    known = np.isfinite(shifted) & (shifted > 0) & (disparity > 0)
    safe = np.where(known, shifted, 1.0)
    depth = np.where(known, _focal_baseline(calibration) / safe, 0)
    return depth.astype(np.float32)


def _depth_range(calibration: Calibration) -> tuple[float, float]:
    """From the largest disparity, ndisp, to 0; vmin and vmax come from the truth."""
    doffs, ndisp = calibration["doffs"][0], calibration["ndisp"][0]
    scale = _focal_baseline(calibration)
    far = scale / max(doffs, _LEAST_DISPARITY_PX)
    return scale / max(doffs + ndisp, 2 * _LEAST_DISPARITY_PX), far


def _focal_baseline(calibration: Calibration) -> float:
    return _MM * calibration["baseline"][0] * calibration["cam0"][0]


def _matrix(calibration: Calibration, name: str) -> Matrix:
    return np.array(calibration[name], dtype=np.float64).reshape(3, 3)


def _first_of(path: Path, names: tuple[str, ...]) -> Path | None:
    return next((path / name for name in names if (path / name).is_file()), None)
