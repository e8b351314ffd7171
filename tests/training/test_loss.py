"""Laws of the loss."""

import dataclasses

import pytest
import torch
from torch import Tensor

from resdepth_colmap.network.unet import Refinement
from resdepth_colmap.pipeline.refine.network_inputs import Scaling
from resdepth_colmap.pipeline.refine.source_sampler import SourceSampler
from resdepth_colmap.training.config import Preset, TrainConfig
from resdepth_colmap.training.data.batches import Batch
from resdepth_colmap.training.loss import refinement_loss

SHAPE = (2, 1, 6, 8)
DEFAULT, PAPER = TrainConfig(), TrainConfig.of(Preset.PAPER)


def random(seed: int) -> Tensor:
    return torch.randn(SHAPE, generator=torch.Generator().manual_seed(seed))


@pytest.fixture
def batch() -> Batch:
    return Batch(
        inputs=torch.zeros(SHAPE),
        target=random(0),
        known=random(1) > 0,
        scaling=Scaling(*torch.tensor([[1.0, 2.0], [0.2, 0.8]])[..., None, None, None]),
        source_sampler=SourceSampler((None, None)),
        importance=torch.ones(SHAPE),
        names=("a", "b"),
    )


def refined_of(depth: Tensor, log_scale: Tensor | None = None) -> Refinement:
    return Refinement(depth, log_scale)


def test_the_papers_loss_is_the_mean_absolute_error(batch: Batch) -> None:
    depth = random(3)
    total, num_known = refinement_loss(refined_of(depth, random(4)), batch, PAPER)
    expected = (depth - batch.target).abs()[batch.known].mean()
    torch.testing.assert_close(total / num_known, expected)


def test_the_truth_itself_costs_nothing(batch: Batch) -> None:
    assert refinement_loss(refined_of(batch.target), batch, DEFAULT).total == 0


@pytest.mark.parametrize("config", [DEFAULT, PAPER])
def test_what_is_not_known_does_not_matter(batch: Batch, config: TrainConfig) -> None:
    depth, log_scale = random(3), random(4)
    loss = refinement_loss(refined_of(depth, log_scale), batch, config)
    other = batch._replace(target=torch.where(batch.known, batch.target, torch.nan))
    elsewhere = torch.where(batch.known, depth, depth + 5)
    again = refinement_loss(refined_of(elsewhere, log_scale), other, config)
    torch.testing.assert_close(again.total, loss.total)
    assert again.num_known == loss.num_known == batch.known.sum()


def test_a_batch_without_truth_has_no_loss_and_no_gradient(batch: Batch) -> None:
    depth = random(3).requires_grad_()
    nothing = batch._replace(known=torch.zeros(SHAPE, dtype=torch.bool))
    loss = refinement_loss(refined_of(depth), nothing, DEFAULT)
    loss.total.backward()  # type: ignore[no-untyped-call] # torch's own
    assert loss.total == loss.num_known == 0
    assert depth.grad is not None
    assert (depth.grad == 0).all()


def test_the_confidence_does_not_pull_at_the_depth(batch: Batch) -> None:
    gradients = []
    for log_scale in (random(4), random(5)):
        depth = random(3).requires_grad_()
        loss = refinement_loss(refined_of(depth, log_scale), batch, DEFAULT)
        loss.total.backward()  # type: ignore[no-untyped-call] # torch's own
        gradients.append(depth.grad)
    assert gradients[0] is not None
    torch.testing.assert_close(gradients[0], gradients[1])


def test_the_best_scale_is_the_error(batch: Batch) -> None:
    batch = batch._replace(target=torch.zeros(SHAPE))
    depth = torch.full(SHAPE, 0.5)
    losses = {
        scale: float(
            refinement_loss(
                refined_of(depth, torch.full(SHAPE, scale).log()), batch, DEFAULT
            ).total
        )
        for scale in (0.25, 0.4, 0.5, 0.6, 1.0)
    }
    assert min(losses, key=lambda scale: losses[scale]) == 0.5


def test_the_logarithm_weighs_small_errors_more(batch: Batch) -> None:
    """Halving a small error gains more, by its size, than halving a large one."""
    flat = torch.full_like(batch.scaling.scale, 1e-9)
    batch = batch._replace(scaling=batch.scaling._replace(scale=flat))
    plain = dataclasses.replace(DEFAULT, log_weight=0.0)

    def gain(error: float, config: TrainConfig) -> float:
        whole, half = (
            float(refinement_loss(refined_of(batch.target + e), batch, config).total)
            for e in (error, error / 2)
        )
        return (whole - half) / error

    assert gain(0.02, plain) == pytest.approx(gain(2.0, plain), rel=1e-2)
    assert gain(0.02, DEFAULT) > 2 * gain(2.0, DEFAULT)


def test_a_pixel_counts_as_much_as_it_is_important(batch: Batch) -> None:
    refined = refined_of(random(3), random(4))
    halves = []
    for part in (random(5) > 0, random(5) <= 0):
        important = batch._replace(importance=part.float())
        halves.append(refinement_loss(refined, important, DEFAULT).total)
    whole = refinement_loss(refined, batch, DEFAULT).total
    torch.testing.assert_close(halves[0] + halves[1], whole)


@pytest.mark.parametrize("num_far", [1, 3, 5, 7])
def test_a_pixel_of_two_surfaces_is_drawn_to_the_likelier(num_far: int) -> None:
    """However much farther one of them is: the mean would be drawn to the farther."""
    far, near = -2.0, 1.0
    target = torch.tensor([far] * num_far + [near] * (8 - num_far))[None, None, None]
    batch = Batch(
        inputs=target,
        target=target,
        known=torch.ones_like(target, dtype=torch.bool),
        scaling=Scaling(torch.full((1, 1, 1, 1), 2.0), torch.full((1, 1, 1, 1), 0.6)),
        source_sampler=SourceSampler((None,)),
        importance=torch.ones_like(target),
        names=("a",),
    )
    between = torch.zeros_like(target).requires_grad_()
    config = dataclasses.replace(DEFAULT, log_weight=0.0)
    loss = refinement_loss(refined_of(between), batch, config)
    loss.total.backward()  # type: ignore[no-untyped-call] # torch's own
    assert between.grad is not None
    assert (between.grad.sum() > 0) == (num_far > 4)


def test_errors_count_in_units_of_length(batch: Batch) -> None:
    """A small error of inverse depth, times the square of the depth."""
    refined = random(6) * 0.5
    offset, scale = batch.scaling
    depths = [offset / (offset + scale * x) for x in (refined, refined + 1e-4)]
    config = dataclasses.replace(DEFAULT, log_weight=0.0)
    batch = batch._replace(target=refined + 1e-4)
    loss = refinement_loss(refined_of(refined), batch, config)
    lengths = (depths[0] - depths[1]).abs() * offset / scale
    torch.testing.assert_close(
        loss.total, lengths[batch.known].sum(), rtol=1e-2, atol=0.0
    )
