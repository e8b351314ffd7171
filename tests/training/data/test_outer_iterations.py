"""Laws of the samples of later outer iterations: the maps of other views in them."""

from pathlib import Path

import numpy as np
import pytest
import torch
from crop_sets import batch_of_step
from noisy_planes import write_noisy_plane
from planes import NAMES
from refined_plane import network
from workspaces import identity_weights

from resdepth_colmap.network.network_config import REPROJECTED_CHANGE, NetworkConfig
from resdepth_colmap.network.weights import save_weights
from resdepth_colmap.training.data.outer_iterations import prepare_later_iterations
from resdepth_colmap.training.data.samples import (
    FILLED,
    LATER,
    guidance_names,
    prepare_samples,
    read_sample,
)

CONFIG = NetworkConfig(levels=3, base_channels=4, max_channels=8)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return write_noisy_plane(tmp_path / "room", kinds=("photometric", "geometric"))


def prepared(scene: Path, weights: Path, num_iterations: int = 2) -> list[Path]:
    cache = scene.parent / "cache"
    return prepare_later_iterations([scene], CONFIG, cache, weights, num_iterations)


def farther_weights(path: Path, source_depth: bool = False) -> Path:
    """Of a network that moves everything away."""
    net = network(source_depth=source_depth, confidence=False, gate=False)
    with torch.no_grad():
        assert net.head.bias is not None
        net.head.bias.fill_(-0.2)
    save_weights(path / "farther.safetensors", net)
    return path / "farther.safetensors"


def test_a_network_that_changes_nothing_makes_the_samples_of_the_first_iteration(
    scene: Path, tmp_path: Path
) -> None:
    firsts = prepare_samples([scene], CONFIG, tmp_path / "cache")
    filled_in = [path for path in firsts if path.stem.endswith(FILLED)]
    again = prepared(scene, identity_weights(tmp_path))
    assert len(again) == len(filled_in) == len(NAMES)
    for path, expected_path in zip(again, filled_in, strict=True):
        assert path.stem.endswith(LATER) and "-photometric-" in path.stem
        sample, expected = read_sample(path), read_sample(expected_path)
        np.testing.assert_array_equal(sample.target, expected.target)
        assert np.mean(sample.valid == expected.valid) > 0.999
        same = np.isclose(sample.guidance, expected.guidance, rtol=0.01, atol=0.01)
        assert same.mean() > 0.995


def test_what_the_others_say_is_what_the_network_made_of_it(
    scene: Path, tmp_path: Path
) -> None:
    index = guidance_names(CONFIG.num_sources).index(REPROJECTED_CHANGE)
    first, second = (
        [read_sample(path).guidance[index] for path in prepared(scene, weights)]
        for weights in (identity_weights(tmp_path), farther_weights(tmp_path))
    )
    for same, farther in zip(first, second, strict=True):
        assert np.median(farther[farther != 0]) < np.median(same[same != 0]) - 0.005


def test_what_a_third_iteration_sees_was_refined_twice(
    scene: Path, tmp_path: Path
) -> None:
    weights = farther_weights(tmp_path, source_depth=True)
    seconds, both = prepared(scene, weights), prepared(scene, weights, num_iterations=3)
    thirds = [path for path in both if path not in seconds]
    assert len(both) == 2 * len(thirds) == 2 * len(NAMES)
    index = guidance_names(CONFIG.num_sources).index(REPROJECTED_CHANGE)
    for second, third in zip(seconds, thirds, strict=True):
        before, after = read_sample(second), read_sample(third)
        np.testing.assert_array_equal(before.target, after.target)
        assert np.any(before.guidance[index] != after.guidance[index])


def test_samples_are_kept_until_maps_or_weights_change(
    scene: Path, tmp_path: Path
) -> None:
    weights = identity_weights(tmp_path)
    paths = prepared(scene, weights)
    times = [path.stat().st_mtime_ns for path in paths]
    assert prepared(scene, weights) == paths
    assert [path.stat().st_mtime_ns for path in paths] == times
    assert not {*prepared(scene, identity_weights(tmp_path, seed=1))} & {*paths}


def test_more_than_half_of_the_crops_with_other_maps_are_of_later_iterations(
    scene: Path, tmp_path: Path
) -> None:
    paths = prepare_samples([scene], CONFIG, tmp_path / "cache")
    paths += prepared(scene, identity_weights(tmp_path))
    names = batch_of_step(paths, network=CONFIG, batch_size=200, seed=0).names
    counts = [sum(name.endswith(end) for name in names) for end in (FILLED, LATER)]
    assert sum(counts) == pytest.approx(136, abs=20)
    assert counts[1] == pytest.approx(0.6 * sum(counts), abs=20)
