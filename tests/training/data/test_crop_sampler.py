"""Laws of the draws: which samples a batch is cut from."""

import dataclasses
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from crop_sets import NETWORK, batch_of_step, crop_set
from noisy_planes import write_noisy_plane

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.training.data.crop_sampler import CropSampler, Draw
from resdepth_colmap.training.data.samples import prepare_samples
from resdepth_colmap.training.distributed import Ranks


def draws_of(
    samples: tuple[Path, ...],
    steps: range,
    network: NetworkConfig = NETWORK,
    ranks: Ranks | None = None,
    **options: Any,
) -> list[list[Draw]]:
    config = crop_set(samples, **options).config
    return list(CropSampler(samples, network, config, steps, ranks or Ranks()))


def facts(draw: Draw) -> tuple[object, ...]:
    return draw.path, draw.shape, draw.batch_names, draw.rng.bit_generator.state


def test_a_later_start_draws_what_an_uninterrupted_run_draws(
    samples: tuple[Path, ...],
) -> None:
    whole, rest = (draws_of(samples, range(start, 7)) for start in (0, 4))
    assert len(whole) == 7
    for batch, expected in zip(rest, whole[4:], strict=True):
        assert list(map(facts, batch)) == list(map(facts, expected))
    assert whole[0][0].batch_names != whole[1][0].batch_names


def test_the_processes_share_the_draws_of_one(samples: tuple[Path, ...]) -> None:
    whole = draws_of(samples, range(3), batch_size=6)
    parts = [
        draws_of(samples, range(3), batch_size=6, ranks=Ranks(rank=rank, count=3))
        for rank in range(3)
    ]
    for step, batch in enumerate(whole):
        for rank, part in enumerate(parts):
            expected = batch[rank::3]
            assert list(map(facts, part[step])) == list(map(facts, expected))


def test_images_of_different_sizes_share_a_batch(tmp_path: Path) -> None:
    paths = []
    for name, size_px in {"a": (80, 60), "b": (56, 96)}.items():
        scene = write_noisy_plane(tmp_path / name, size_px=size_px)
        paths += prepare_samples([scene], NETWORK, tmp_path / "cache")
    batch = batch_of_step(paths, batch_size=8, crop_px=512)
    assert batch.inputs.shape == (8, len(NETWORK.channels), 56, 56)


def test_too_small_an_image_is_named(samples: tuple[Path, ...]) -> None:
    config = NetworkConfig(levels=7)
    with pytest.raises(TrainingError, match=r"plane-.*a side of 60 px.*7 levels"):
        draws_of(samples, range(1), config)


def test_the_share_of_maps_with_holes_is_as_asked(samples: tuple[Path, ...]) -> None:
    for share in (0.0, 1.0):
        (draws,) = draws_of(samples, range(1), holes_share=share, batch_size=12)
        names = draws[0].batch_names
        assert all(name.endswith("-holes") == bool(share) for name in names)
    holes = tuple(path for path in samples if path.stem.endswith("-holes"))
    assert draws_of(holes, range(1), holes_share=0.0)


def test_a_network_that_sees_other_maps_is_mostly_shown_them(
    samples: tuple[Path, ...],
) -> None:
    blind = dataclasses.replace(NETWORK, source_depth=False)
    ends = {}
    for network in (NETWORK, blind):
        (draws,) = draws_of(samples, range(1), network, holes_share=0.3, batch_size=300)
        names = draws[0].batch_names
        ends[network] = Counter(name.rsplit("-", 1)[1] for name in names)
    assert set(ends[NETWORK]) == {"filled", "dense", "holes"}
    assert ends[NETWORK]["filled"] > 150 > 60 > ends[NETWORK]["dense"] > 10
    assert set(ends[blind]) == {"dense", "holes"}
    assert ends[blind]["holes"] == ends[NETWORK]["holes"]
