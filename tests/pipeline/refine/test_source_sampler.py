"""Laws of the look through the source at any depth."""

import torch
from analytic_scene import Pair, plane_pair, sphere_pair

from resdepth_colmap.pipeline.refine.source_sampler import (
    Sight,
    SourceSampler,
    SourceTensors,
)


def sight_of(pair: Pair) -> Sight:
    source = SourceTensors(pair.source_gray, pair.source_K, pair.source_from_reference)
    return Sight(pair.reference_K[0], source)


def test_at_the_true_depth_the_source_shows_what_the_reference_shows() -> None:
    for pair in (plane_pair(), sphere_pair()):
        truth = pair.inverse_depth[0]
        depths = torch.cat([truth, truth * 1.2, truth * 0.0])
        right, wrong, nothing = sight_of(pair).gray_at(depths)
        seen = (right > 0) & (truth[0] > 0)
        reference = pair.reference_gray[0, 0]
        error = (right - reference)[seen].abs().median()
        assert error < 0.1 * (wrong - reference)[seen].abs().median()
        assert not nothing.any()


def test_a_window_shows_the_same_as_the_whole() -> None:
    pair = plane_pair()
    depths = pair.inverse_depth
    sample_source = SourceSampler((sight_of(pair),))
    whole = sample_source.gray_at(depths)
    window = (..., slice(7, 30), slice(11, 50))
    part = sample_source.crop(7, 11).gray_at(depths[window])
    torch.testing.assert_close(part, whole[window], rtol=0, atol=1e-6)


def test_each_tile_has_its_own_source_or_none() -> None:
    plane, sphere = plane_pair(), sphere_pair()
    depths = torch.cat([pair.inverse_depth for pair in (plane, plane, sphere)])
    sample_source = SourceSampler((sight_of(plane), None, sight_of(sphere)))
    both = sample_source.gray_at(depths)
    assert torch.equal(both[0], sight_of(plane).gray_at(depths[0]))
    assert not both[1].any()
    assert torch.equal(both[2], sight_of(sphere).gray_at(depths[2]))
