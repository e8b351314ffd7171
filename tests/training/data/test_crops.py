"""Laws of the crops: what is cut, mirrored and dealt out."""

import dataclasses
from collections import Counter
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import torch
from noisy_planes import write_noisy_plane

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import InputVariant, NetworkConfig
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.training.data import crops
from resdepth_colmap.training.data.crops import CropSampler
from resdepth_colmap.training.data.samples import prepare_samples, read_sample

NETWORK = NetworkConfig(levels=3, base_channels=4, max_channels=8, color=True)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("crops")
    scene = write_noisy_plane(folder / "plane")
    return tuple(prepare_samples([scene], NETWORK, folder / "cache"))


def sampler_of(samples: tuple[Path, ...], **changes: object) -> CropSampler:
    sampler = CropSampler(
        paths=samples,
        config=NETWORK,
        batch_size=4,
        crop_px=40,
        seed=1,
        vary_light=False,
    )
    return dataclasses.replace(sampler, **changes)  # type: ignore[arg-type]


def test_the_processes_share_the_batch_of_one(samples: tuple[Path, ...]) -> None:
    sampler = sampler_of(samples, vary_light=True)
    whole = sampler.batch(3)
    parts = [sampler.batch(3, rank, 2) for rank in range(2)]
    for rank, part in enumerate(parts):
        assert torch.equal(part.inputs, whole.inputs[rank::2])
        assert torch.equal(part.target, whole.target[rank::2])
        assert part.names == whole.names


def test_a_mirrored_crop_is_that_of_a_mirrored_pair(samples: tuple[Path, ...]) -> None:
    """The warped source still matches: its correlation is that which was stored."""
    batch = sampler_of(samples, batch_size=16).batch(0)
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
    one = (samples[0],)
    original = read_sample(samples[0]).target
    sampler = sampler_of(one, batch_size=60, crop_px=40)
    num_mirrored = 0
    for item in range(60):
        _, rng = sampler._draw(0, item)
        crop = sampler._crop(samples[0], np.array(original.shape), rng).target
        gradient = np.diff(crop.astype(np.float64), axis=1).mean()
        expected = np.diff(original.astype(np.float64), axis=1).mean()
        num_mirrored += bool(gradient * expected < 0)
    assert 15 < num_mirrored < 45


def test_images_of_different_sizes_share_a_batch(tmp_path: Path) -> None:
    paths = []
    for name, size_px in {"a": (80, 60), "b": (56, 96)}.items():
        scene = write_noisy_plane(tmp_path / name, size_px=size_px)
        paths += prepare_samples([scene], NETWORK, tmp_path / "cache")
    sampler = sampler_of(tuple(paths), batch_size=8, crop_px=512)
    assert sampler.batch(0).inputs.shape == (8, len(NETWORK.channels), 56, 56)


def test_too_small_an_image_is_named(samples: tuple[Path, ...]) -> None:
    config = NetworkConfig(levels=7)
    with pytest.raises(TrainingError, match=r"plane-.*a side of 60 px.*7 levels"):
        sampler_of(samples, config=config).batch(0)


@pytest.mark.parametrize("variant", InputVariant)
def test_a_variant_sees_its_channels(
    samples: tuple[Path, ...], variant: InputVariant
) -> None:
    config = dataclasses.replace(NetworkConfig.paper(variant), levels=3)
    batch = sampler_of(samples, config=config).batch(0)
    assert batch.inputs.shape[1] == len(config.channels)
    if config.residual:
        error = (batch.inputs[:, :1] - batch.target).abs()[batch.known]
        assert float(error.median()) < 1e-4


def test_the_share_of_maps_with_holes_is_as_asked(samples: tuple[Path, ...]) -> None:
    for share in (0.0, 1.0):
        names = sampler_of(samples, holes_share=share, batch_size=12).batch(0).names
        assert all(name.endswith("-holes") == bool(share) for name in names)
    holes = tuple(path for path in samples if path.stem.endswith("-holes"))
    assert sampler_of(holes, holes_share=0.0).batch(0).names


def test_light_changes_photographs_alone(samples: tuple[Path, ...]) -> None:
    plain = sampler_of(samples).batch(0)
    with mock.patch.object(
        crops.CropSampler,
        "_other_light",
        lambda _, c, __: c._replace(guidance=c.guidance * 0),
    ):
        dark = sampler_of(samples, vary_light=True).batch(0)
    assert (dark.inputs[:, 1:] == 0).all()
    varied = sampler_of(samples, vary_light=True).batch(0)
    for index, name in enumerate(NETWORK.channels):
        is_photo = name in ("reference", "source_0", "red", "blue")
        same = torch.equal(varied.inputs[:, index], plain.inputs[:, index])
        assert same != is_photo


def test_what_was_measured_counts_less_and_the_mean_is_one(
    samples: tuple[Path, ...],
) -> None:
    holes = tuple(path for path in samples if path.stem.endswith("-holes"))
    batch = sampler_of(holes, valid_importance=0.25).batch(0)
    torch.testing.assert_close(batch.importance.mean(dim=(1, 2, 3)), torch.ones(4))
    valid = batch.inputs[:, [NETWORK.channels.index("valid")]] > 0
    mixed = [i for i in range(4) if valid[i].any() and not valid[i].all()]
    assert mixed
    for index in mixed:
        measured = batch.importance[index][valid[index]]
        filled = batch.importance[index][~valid[index]]
        torch.testing.assert_close(measured.max(), 0.25 * filled.min())
    assert (sampler_of(holes).batch(0).importance == 1).all()


def test_a_network_that_looks_at_other_maps_is_mostly_shown_them(
    samples: tuple[Path, ...],
) -> None:
    blind = dataclasses.replace(NETWORK, source_depth=False)
    ends = {}
    for config in (NETWORK, blind):
        sampler = sampler_of(samples, config=config, holes_share=0.3, batch_size=300)
        names = [sampler._draw(0, item)[0].stem for item in range(300)]
        ends[config] = Counter(name.rsplit("-", 1)[1] for name in names)
    assert set(ends[NETWORK]) == {"completed", "dense", "holes"}
    assert ends[NETWORK]["completed"] > 150 > 60 > ends[NETWORK]["dense"] > 10
    assert set(ends[blind]) == {"dense", "holes"}
    assert ends[blind]["holes"] == ends[NETWORK]["holes"]


def test_the_source_that_is_looked_at_again_fits_the_crop(
    samples: tuple[Path, ...],
) -> None:
    """At the true depth it shows what the reference shows, mirrored or not."""
    batch = sampler_of(samples, batch_size=16).batch(0)
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
        sampler_of(samples, vary_light=vary, holes_share=0.0).batch(0)
        for vary in (False, True)
    )
    place = NETWORK.channels.index("source_0")
    initial = plain.inputs[:, :1]
    for batch in (plain, lit):
        again, stored = batch.sample_source(initial), batch.inputs[:, [place]]
        torch.testing.assert_close(again.mean(), stored.mean(), rtol=0.02, atol=0)
    assert not torch.allclose(
        plain.sample_source(initial), lit.sample_source(initial), atol=0.01
    )
