"""Samples that the tests of crops and batches share."""

from pathlib import Path

import pytest
from crop_sets import NETWORK
from noisy_planes import write_noisy_plane

from resdepth_colmap.training.data.samples import prepare_samples


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("crops")
    scene = write_noisy_plane(folder / "plane")
    return tuple(prepare_samples([scene], NETWORK, folder / "cache"))
