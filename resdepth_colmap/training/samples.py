"""Training samples from workspaces with ground truth.

What does not depend on the crop (warping, filling, correlation) is done once for each
view and kept in a cache folder: the network's inputs are then only read and cut.
"""

import hashlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.geometry.pixels import index_K
from resdepth_colmap.geometry.view_selection import choose_sources
from resdepth_colmap.io.depth_map import read_depth_map
from resdepth_colmap.io.files import write_whole
from resdepth_colmap.io.images import read_gray
from resdepth_colmap.io.model import read_scene
from resdepth_colmap.io.workspace import Workspace, open_workspace
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.pipeline.inputs import (
    SourceTensors,
    ViewTensors,
    build_inputs,
    initial_tensors,
)
from resdepth_colmap.pipeline.progress import Progress, SilentProgress
from resdepth_colmap.scene import DepthMap, Scene, View, cam_from_cam

HOLES_CONSISTENCY = 0.25
"""Photo-consistency above which the copy "with holes" of a map has none."""

LEAST_RIGHT_SHARE = 0.3
"""A map with fewer pixels within 5 % of the truth is of a failed pair: not used."""


class Sample(NamedTuple):
    """One view with its initial and its true inverse depth, ready to be cut.

    Attributes:
        inverse_depth: Initial, holes filled, shape (H, W), float32, 1/unit.
        target: True inverse depth, shape (H, W), float32, 1/unit; 0 = unknown.
        valid: Where the initial depth was real, shape (H, W), bool.
        guidance: The other channels, shape (C, H, W), float16.
        baseline: Distance to the first source, shape (1,), float32, units.
    """

    inverse_depth: NDArray[np.float32]
    target: NDArray[np.float32]
    valid: NDArray[np.bool_]
    guidance: NDArray[np.float16]
    baseline: NDArray[np.float32]


def prepare_samples(
    workspaces: Sequence[Path],
    config: NetworkConfig,
    cache: Path,
    progress: Progress | None = None,
) -> list[Path]:
    """Build the samples of all views that have a depth map and a ground truth.

    Each view gives two: its map as it is, and with holes where the photographs
    contradict it, as a filter would leave it.

    Args:
        workspaces: Dense workspaces with `ground_truth/<image>.bin`.
        config: The network that will be trained.
        cache: Folder of the samples; those that are there are kept.
        progress: Is told of each workspace.

    Returns:
        Paths of all samples, in the order of the workspaces.

    Raises:
        TrainingError: If no view has both.
    """
    progress = progress or SilentProgress()
    key = json.dumps(config.channels)  # no other option changes a sample
    folder = cache / hashlib.sha256(key.encode()).hexdigest()[:12]
    paths: list[Path] = []
    with progress.stage("Preparing samples", len(workspaces)) as advance:
        for path in workspaces:
            paths += _prepare_workspace(open_workspace(path), config, folder)
            advance(1.0)
    if not paths:
        raise TrainingError(
            f"{workspaces[0].parent}: no view has a depth map in stereo/depth_maps and "
            "a ground_truth/<image>.bin; run `resdepth-colmap stereo` on each."
        )
    return paths


def _prepare_workspace(
    workspace: Workspace, config: NetworkConfig, folder: Path
) -> list[Path]:
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    paths = []
    for index, view in enumerate(scene.views):
        truth_path = workspace.truth_path(view.name)
        kinds = workspace.map_kinds(view.name)
        if not kinds or not truth_path.exists():
            continue
        stem = f"{workspace.path.name}-{view.name.replace('/', '-')}"
        targets = [folder / f"{stem}-{kind}.npz" for kind in ("dense", "holes")]
        if not all(target.exists() for target in targets):
            depth = read_depth_map(workspace.depth_map_path(view.name, kinds[0]))
            truth = read_depth_map(truth_path)
            right = np.abs(depth - truth) < 0.05 * truth
            if right.sum() < LEAST_RIGHT_SHARE * max(1, (truth > 0).sum()):
                continue
            for target in targets:
                sample = build_sample(workspace, scene, index, depth, truth, config)
                _write_sample(target, sample)
                depth = _with_holes(depth, sample, config)
        paths += targets
    return paths


def build_sample(
    workspace: Workspace,
    scene: Scene,
    index: int,
    depth: DepthMap,
    truth: DepthMap,
    config: NetworkConfig,
) -> Sample:
    """The sample of one view, from its initial and its true depth."""
    view = scene.views[index]
    inverse_depth, valid = initial_tensors(depth)
    choices = choose_sources(scene, index, config.num_sources)
    sources = tuple(
        _source_tensors(workspace, view, scene.views[choice.index])
        for choice in choices
    )
    tensors = ViewTensors(
        inverse_depth=inverse_depth,
        valid=valid,
        gray=_gray_tensor(workspace, view),
        K=torch.from_numpy(index_K(view.camera))[None],
        sources=sources,
    )
    stack = build_inputs(tensors, config)
    known = truth > 0
    target = np.where(known, 1.0 / np.where(known, truth, 1.0), 0.0)
    return Sample(
        inverse_depth=stack.inverse_depth[0, 0].numpy(),
        target=target.astype(np.float32),
        valid=stack.valid[0, 0].numpy(),
        guidance=stack.guidance[0].half().numpy(),
        baseline=stack.baseline.reshape(1).float().numpy(),
    )


def _gray_tensor(workspace: Workspace, view: View) -> Tensor:
    return torch.from_numpy(read_gray(workspace.image_path(view.name)))[None, None]


def _source_tensors(
    workspace: Workspace, reference: View, source: View
) -> SourceTensors:
    return SourceTensors(
        gray=_gray_tensor(workspace, source),
        K=torch.from_numpy(index_K(source.camera))[None],
        source_from_reference=torch.from_numpy(cam_from_cam(source, reference))[None],
    )


def _with_holes(depth: DepthMap, sample: Sample, config: NetworkConfig) -> DepthMap:
    names = [name for name in config.channels if name != "inverse_depth"]
    if "photo_consistency" not in names:
        return depth
    consistency = sample.guidance[names.index("photo_consistency")]
    kept = np.where(consistency < HOLES_CONSISTENCY, depth, 0.0).astype(np.float32)
    return kept if (kept > 0).mean() > 0.05 else depth


def _write_sample(path: Path, sample: Sample) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, **sample._asdict())
    write_whole(path, buffer.getvalue())


def read_sample(path: Path) -> Sample:
    """Read what `prepare_samples` wrote."""
    with np.load(path) as arrays:
        return Sample(**{name: arrays[name] for name in Sample._fields})
