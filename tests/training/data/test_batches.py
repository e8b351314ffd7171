"""Laws of the batches: what is cut, mirrored and given to the network."""

import dataclasses
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import torch
from crop_sets import NETWORK, batch_of_step, crop_set

from resdepth_colmap.network.network_config import InputVariant, NetworkConfig
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.training.data.crop_sampler import CropSampler, Draw
from resdepth_colmap.training.data.crops import CropDataset
from resdepth_colmap.training.data.samples import read_sample
from resdepth_colmap.training.distributed import Ranks


def test_a_step_has_the_same_batch_whenever_it_is_asked_for(
    samples: tuple[Path, ...],
) -> None:
    first, other, again = crop_set(samples, seed=3).batches([5, 6, 5])
    assert first.names == again.names
    assert torch.equal(first.inputs, again.inputs)
    assert not torch.equal(first.inputs, other.inputs)


@pytest.mark.filterwarnings("ignore:This DataLoader will create 2 worker")
@pytest.mark.parametrize("num_workers", [0, 1, 2])
def test_workers_and_processes_share_the_batches_of_one(
    samples: tuple[Path, ...], num_workers: int
) -> None:
    crops = crop_set(samples, vary_light=True)
    steps = range(3, 6)
    whole = list(crops.batches(steps))
    parts = [
        list(crops.batches(steps, Ranks(rank=rank, count=2), num_workers))
        for rank in range(2)
    ]
    for step, batch in enumerate(whole):
        for rank, part in enumerate(parts):
            assert torch.equal(part[step].inputs, batch.inputs[rank::2])
            assert torch.equal(part[step].target, batch.target[rank::2])
            assert part[step].names == batch.names


def test_no_more_crops_are_cut_ahead_than_memory_holds(
    samples: tuple[Path, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    num_drawn = 0
    draw = CropSampler.batch

    def count(sampler: CropSampler, step: int) -> list[Draw]:
        nonlocal num_drawn
        num_drawn += 1
        return draw(sampler, step)

    monkeypatch.setattr(CropSampler, "batch", count)
    for num_workers, most in ((0, 1), (1, 3)):
        num_drawn = 0
        next(crop_set(samples).batches(range(1000), num_workers=num_workers))
        assert num_drawn <= most


def test_a_mirrored_crop_is_that_of_a_mirrored_pair(samples: tuple[Path, ...]) -> None:
    """The warped source still matches: its correlation is that which was stored."""
    batch = batch_of_step(samples, batch_size=16)
    names = NETWORK.channels
    reference, source, stored = (
        batch.inputs[:, [names.index(name)]]
        for name in ("reference", "source_0", "photo_consistency")
    )
    inside = source > 0  # outside it is exactly black
    again = photometric_error(reference, [(source, inside)])
    middle = (..., slice(4, -4), slice(4, -4))  # windows that the crop does not cut
    error = (again - stored)[middle].abs()
    assert float(error.quantile(0.95)) < 0.02
    mirrored = photometric_error(reference, [(source.flip(-1), inside.flip(-1))])
    assert float((mirrored - stored)[middle].abs().mean()) > 0.1


def test_half_of_the_crops_are_mirrored(samples: tuple[Path, ...]) -> None:
    original = read_sample(samples[0]).target
    dataset = CropDataset(NETWORK, vary_light=False)
    num_mirrored = 0
    for seed in range(60):
        draw = Draw(samples[0], (40, 40), np.random.default_rng(seed), ())
        crop = dataset[draw].sample.target
        gradient = np.diff(crop.astype(np.float64), axis=1).mean()
        expected = np.diff(original.astype(np.float64), axis=1).mean()
        num_mirrored += bool(gradient * expected < 0)
    assert 15 < num_mirrored < 45


@pytest.mark.parametrize("variant", InputVariant)
def test_a_variant_sees_its_channels(
    samples: tuple[Path, ...], variant: InputVariant
) -> None:
    config = dataclasses.replace(NetworkConfig.paper(variant), levels=3)
    batch = batch_of_step(samples, network=config)
    assert batch.inputs.shape[1] == len(config.channels)
    if config.residual:
        error = (batch.inputs[:, :1] - batch.target).abs()[batch.known]
        assert float(error.median()) < 1e-4


def test_light_changes_photographs_alone(samples: tuple[Path, ...]) -> None:
    plain = batch_of_step(samples)
    with mock.patch.object(
        CropDataset,
        "_other_light",
        lambda _, c, __: c._replace(guidance=c.guidance * 0),
    ):
        dark = batch_of_step(samples, vary_light=True)
    assert (dark.inputs[:, 1:] == 0).all()
    varied = batch_of_step(samples, vary_light=True)
    for index, name in enumerate(NETWORK.channels):
        is_photo = name in ("reference", "source_0", "red", "blue")
        same = torch.equal(varied.inputs[:, index], plain.inputs[:, index])
        assert same != is_photo


def test_what_was_measured_counts_less_and_the_mean_is_one(
    samples: tuple[Path, ...],
) -> None:
    holes = tuple(path for path in samples if path.stem.endswith("-holes"))
    batch = batch_of_step(holes, valid_importance=0.25)
    torch.testing.assert_close(batch.importance.mean(dim=(1, 2, 3)), torch.ones(4))
    valid = batch.inputs[:, [NETWORK.channels.index("valid")]] > 0
    mixed = [i for i in range(4) if valid[i].any() and not valid[i].all()]
    assert mixed
    for index in mixed:
        measured = batch.importance[index][valid[index]]
        filled = batch.importance[index][~valid[index]]
        torch.testing.assert_close(measured.max(), 0.25 * filled.min())
    assert (batch_of_step(holes).importance == 1).all()


def test_the_source_for_resampling_fits_the_crop(
    samples: tuple[Path, ...],
) -> None:
    """At the true depth it shows what the reference shows, mirrored or not."""
    batch = batch_of_step(samples, batch_size=16)
    names = NETWORK.channels
    reference = batch.inputs[:, [names.index("reference")]]
    there = batch.sample_source(batch.target)
    inside = there > 0
    middle = (..., slice(4, -4), slice(4, -4))
    badness = photometric_error(reference, [(there, inside)])[middle]
    mirrored = photometric_error(reference, [(there.flip(-1), inside.flip(-1))])
    assert float(badness.median()) < 0.1
    assert float(mirrored[middle].median()) > 0.3


def test_light_changes_the_source_alike(samples: tuple[Path, ...]) -> None:
    plain, lit = (
        batch_of_step(samples, vary_light=vary, holes_share=0.0)
        for vary in (False, True)
    )
    index = NETWORK.channels.index("source_0")
    initial = plain.inputs[:, :1]
    for batch in (plain, lit):
        again, stored = batch.sample_source(initial), batch.inputs[:, [index]]
        torch.testing.assert_close(again.mean(), stored.mean(), rtol=0.02, atol=0)
    assert not torch.allclose(
        plain.sample_source(initial), lit.sample_source(initial), atol=0.01
    )
