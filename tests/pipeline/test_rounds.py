"""Laws of refining all views more than once, each time from the others' new maps."""

import contextlib
import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from planes import NAMES
from refined_plane import network
from workspaces import plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.network.weights import load_weights, save_weights
from resdepth_colmap.pipeline.refine.load_view import view_inputs
from resdepth_colmap.pipeline.refine.stage import RefineReport, refine_workspace
from resdepth_colmap.pipeline.refine.view import refine_view
from resdepth_colmap.pipeline.view_images import ViewImages
from resdepth_colmap.progress import Advance
from resdepth_colmap.scene import DepthMap

CONFIG = RefineConfig(tile_px=64, overlap_px=16, update_gating=False)


class Watcher:
    """Remembers the stages and how many images each had; may press Ctrl-C."""

    def __init__(self, stop_after: int = 0) -> None:
        self.stages: list[tuple[str, int]] = []
        self.left = stop_after

    @contextlib.contextmanager
    def stage(self, title: str, total: int) -> Iterator[Advance]:
        self.stages.append((title, total))

        def advance(units: float) -> None:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt

        yield advance


def moving_weights(path: Path, source_depth: bool = True) -> Path:
    """Of a network that changes depths, and looks at the maps of other views."""
    file = path / f"moving-{source_depth}.safetensors"
    save_weights(file, network(seed=2, source_depth=source_depth))
    return file


def refine(
    folder: Path,
    rounds: int,
    weights: Path,
    watcher: Watcher | None = None,
    overwrite: bool = False,
) -> RefineReport:
    config = dataclasses.replace(CONFIG, outer_iterations=rounds, weights=weights)
    return refine_workspace(
        open_workspace(folder), config, overwrite=overwrite, progress=watcher
    )


def noisy_folder(path: Path) -> Path:
    """The plane, one pixel in five of each map off by up to a fifth."""
    folder, rng = plane_folder(path), np.random.default_rng(0)
    for name in NAMES:
        map_path = folder / "stereo" / "depth_maps" / f"{name}.geometric.bin"
        depth = read_depth_map(map_path)
        factor = rng.uniform(0.8, 1.2, depth.shape)
        is_off = rng.random(depth.shape) < 0.2
        write_depth_map(map_path, np.where(is_off, factor * depth, depth))
    return folder


def refined_maps(folder: Path) -> dict[str, DepthMap]:
    maps = folder / "resdepth" / "stereo" / "depth_maps"
    return {name: read_depth_map(maps / f"{name}.geometric.bin") for name in NAMES}


def test_a_second_round_sees_what_the_first_made_of_the_others(tmp_path: Path) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path)
    report = refine(folder, 1, weights)
    first = refined_maps(folder)
    assert set(refine(folder, 2, weights).refined) == set(NAMES)
    second = refined_maps(folder)
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    for name in NAMES:
        facts = report.images[name]
        inputs = view_inputs(
            scene,
            scene.index(name),
            [scene.index(source["name"]) for source in facts["sources"]],
            read_depth_map(workspace.depth_map_path(name, "geometric")),
            ViewImages(workspace, 1 << 24),
            {scene.index(other): first[other] for other in facts["source_maps"]},
        )
        expected = refine_view(inputs, load_weights(weights), CONFIG).depth
        np.testing.assert_allclose(second[name], expected, rtol=1e-4)
        assert np.abs(second[name] / first[name] - 1).max() > 1e-3


def test_without_a_look_at_other_maps_a_second_round_is_not_run(tmp_path: Path) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path, False)
    refine(folder, 1, weights)
    watcher = Watcher()
    assert refine(folder, 2, weights, watcher).refined == ()
    assert watcher.stages == [("Refining", 0)]


@pytest.mark.parametrize("stop_after", [2, 7])
def test_an_interrupted_round_goes_on_where_it_stopped(
    tmp_path: Path, stop_after: int
) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path)
    refine(folder, 2, weights)
    whole = refined_maps(folder)
    other = noisy_folder(tmp_path / "other")
    with pytest.raises(KeyboardInterrupt):
        refine(other, 2, weights, Watcher(stop_after))
    watcher = Watcher()
    refine(other, 2, weights, watcher)
    titles, left = zip(*watcher.stages, strict=True)
    assert titles == ("Refining, round 1", "Refining, round 2")
    assert sum(left) == 2 * len(NAMES) - stop_after
    for name, depth in refined_maps(other).items():
        np.testing.assert_array_equal(depth, whole[name])
    assert not (other / "resdepth" / "earlier_rounds").exists()


def test_who_wants_all_of_it_again_gets_the_first_round_too(tmp_path: Path) -> None:
    folder, weights = plane_folder(tmp_path), moving_weights(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        refine(folder, 2, weights, Watcher(stop_after=7))
    watcher = Watcher()
    refine(folder, 2, weights, watcher, overwrite=True)
    assert [total for _, total in watcher.stages] == [len(NAMES)] * 2


def test_a_changed_map_reaches_those_who_look_at_its_lookers(tmp_path: Path) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path)
    images = refine(folder, 3, weights).images
    path = folder / "stereo" / "depth_maps" / f"{NAMES[0]}.geometric.bin"
    write_depth_map(path, np.float32(1.01) * read_depth_map(path))
    reached = {NAMES[0]}
    for _ in range(3):
        reached |= {n for n, it in images.items() if reached & {*it["source_maps"]}}
    assert set(refine(folder, 3, weights).refined) == reached
    assert refine(folder, 3, weights).refined == ()


def test_other_rounds_mean_again(tmp_path: Path) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path)
    refine(folder, 1, weights)
    assert set(refine(folder, 2, weights).refined) == set(NAMES)
    assert set(refine(folder, 1, weights).refined) == set(NAMES)


@pytest.mark.parametrize("rounds", [1, 2])
def test_in_place_gives_what_a_run_beside_gives(tmp_path: Path, rounds: int) -> None:
    folder, weights = noisy_folder(tmp_path), moving_weights(tmp_path)
    refine(folder, rounds, weights)
    config = dataclasses.replace(CONFIG, outer_iterations=rounds, weights=weights)
    other = noisy_folder(tmp_path / "other")
    refine_workspace(open_workspace(other), config, in_place=True)
    for name, depth in refined_maps(folder).items():
        path = other / "stereo" / "depth_maps" / f"{name}.geometric.bin"
        np.testing.assert_array_equal(read_depth_map(path), depth)
