import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from resdepth_colmap.network.propagation import (
    EXTREME_RADIUS_PX,
    LARGEST_STEP,
    STEPS_PX,
    Propagation,
    extremes,
)

SIZE_PX = (16, 24)


def built(seed: int = 0) -> Propagation:
    """One with random weights, that adds no residual."""
    torch.manual_seed(seed)
    made = Propagation(num_inputs=3, channels=6, levels=3).eval()
    torch.nn.init.normal_(made.head.weight, std=0.5)
    made.head.weight.data[made.num_candidates * 4 :] = 0.0
    return made


def prefer(made: Propagation, candidate: int) -> None:
    """Give all the weight to one candidate."""
    assert made.head.bias is not None
    made.head.weight.data.zero_()
    made.head.bias.data[candidate * 4 : candidate * 4 + 4] = 60.0


def maps(seed: int) -> tuple[Tensor, Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return (
        torch.randn((2, 3, *SIZE_PX), generator=generator),
        torch.randn((2, 1, *SIZE_PX), generator=generator),
        torch.randn((2, 1, *SIZE_PX), generator=generator),
    )


def test_a_fresh_one_leaves_planes_as_they_are() -> None:
    seen, _, _ = maps(0)
    rows, columns = torch.meshgrid(*map(torch.arange, SIZE_PX), indexing="ij")
    plane = (0.5 + 0.01 * rows - 0.02 * columns).expand(2, 1, *SIZE_PX)
    out = Propagation(num_inputs=3, channels=6, levels=3)(seen, plane, plane)
    inner = (..., slice(5, -5), slice(5, -5))
    torch.testing.assert_close(out.inverse_depth[inner], plane[inner])
    assert not out.log_scale_change.any()


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 1000))
def test_a_mixture_lies_between_what_it_is_mixed_from(seed: int) -> None:
    seen, refined, initial = maps(seed)
    mixed = built(seed)(seen, refined, initial).inverse_depth
    reach = 2 * max(STEPS_PX) + 1
    around = torch.nn.functional.pad(refined, (max(STEPS_PX),) * 4, mode="replicate")
    highest = torch.nn.functional.max_pool2d(around, reach, stride=1)
    lowest = -torch.nn.functional.max_pool2d(-around, reach, stride=1)
    assert (mixed <= torch.maximum(highest, initial) + 1e-5).all()
    assert (mixed >= torch.minimum(lowest, initial) - 1e-5).all()
    assert not torch.allclose(mixed, refined)


@pytest.mark.parametrize(
    ("candidate", "shift"), [(1, (-2, -2)), (5, (0, 2)), (9, (-5, -5)), (15, (5, 0))]
)
def test_a_candidate_is_the_depth_of_the_pixel_at_its_offset(
    candidate: int, shift: tuple[int, int]
) -> None:
    seen, refined, initial = maps(1)
    made = built()
    prefer(made, candidate)
    moved = torch.roll(refined, (-shift[0], -shift[1]), dims=(-2, -1))
    out = made(seen, refined, initial).inverse_depth
    inner = (..., slice(5, -5), slice(5, -5))
    torch.testing.assert_close(out[inner], moved[inner])


def test_the_last_candidate_is_the_initial_depth() -> None:
    seen, refined, initial = maps(2)
    made = built()
    prefer(made, made.num_candidates - 1)
    torch.testing.assert_close(made(seen, refined, initial).inverse_depth, initial)


def test_a_further_depth_is_mixed_too() -> None:
    seen, refined, initial = maps(4)
    made = Propagation(num_inputs=3, channels=6, levels=3, num_more=2).eval()
    more = extremes(refined)
    for place, expected in enumerate(more):
        made.head.bias.data.zero_()  # type: ignore[union-attr] # it has one
        prefer(made, made.num_candidates - 2 + place)
        actual = made(seen, refined, initial, more).inverse_depth
        torch.testing.assert_close(actual, expected.clamp(refined - 16, refined + 16))
    with pytest.raises(ValueError, match="shorter"):
        made(seen, refined, initial)


def test_extremes_are_those_of_the_square_around_each_pixel() -> None:
    values = maps(5)[1]
    side = 2 * EXTREME_RADIUS_PX + 1
    pool = torch.nn.functional.max_pool2d
    nearest, farthest = extremes(values)
    assert torch.equal(nearest, pool(values, side, 1, EXTREME_RADIUS_PX))
    assert torch.equal(farthest, -pool(-values, side, 1, EXTREME_RADIUS_PX))


def test_an_outlier_pulls_on_others_by_a_bounded_step() -> None:
    seen, refined, initial = maps(3)
    made = built()
    before = made(seen, refined, initial).inverse_depth
    refined[..., 8, 12] = 1e6
    after = made(seen, refined, initial).inverse_depth
    others = torch.ones_like(refined, dtype=torch.bool)
    others[..., 8, 12] = False
    assert (after - before)[others].abs().max() <= LARGEST_STEP + 10.0


def test_a_blurred_edge_becomes_a_step_where_the_photo_has_one() -> None:
    torch.manual_seed(0)
    made = Propagation(num_inputs=2, channels=12, levels=3)
    optimiser = torch.optim.Adam(made.parameters(), lr=1e-2)
    generator = torch.Generator().manual_seed(0)

    def batch() -> tuple[Tensor, Tensor, Tensor]:
        edge_px = torch.randint(8, 24, (8, 1, 1, 1), generator=generator)
        columns = torch.arange(32.0).expand(8, 1, 16, 32)
        truth = (columns >= edge_px).float()
        blurred = ((columns - edge_px + 3.0) / 6.0).clamp(0.0, 1.0)
        return torch.cat([blurred, truth], dim=1), blurred, truth

    for _ in range(80):
        seen, blurred, truth = batch()
        loss = (made(seen, blurred, blurred).inverse_depth - truth).abs().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    seen, blurred, truth = batch()
    before = (blurred - truth).abs().mean()
    after = (made(seen, blurred, blurred).inverse_depth - truth).abs().mean()
    assert after < 0.3 * before
