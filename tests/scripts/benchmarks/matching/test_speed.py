"""Laws of the noise that the matcher is timed on, and of its bounds."""

import numpy as np
import pytest

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.geometry.projection import project, transform
from scripts.benchmarks.matching.speed import (
    DEPTH,
    DEPTH_RANGE,
    noise_views,
)


@pytest.mark.parametrize("num_sources", [1, 4])
def test_each_source_shows_the_noise_of_the_plane_where_it_is_seen(
    num_sources: int,
) -> None:
    reference, *sources = noise_views(0.005, num_sources)
    height_px, width_px = reference.gray.shape
    assert height_px * width_px == pytest.approx(5000, rel=0.05)
    assert len(sources) == num_sources
    column, row = width_px // 2, height_px // 2
    ray = np.linalg.inv(reference.K) @ [column, row, 1]
    columns_seen = set()
    for source in sources:
        xy, z = project(transform(source.cam_from_world, DEPTH * ray), source.K)
        x, y = np.rint(xy).astype(int)
        np.testing.assert_allclose(xy, [x, y], atol=1e-9)
        assert float(z) == DEPTH
        assert int(y) == row
        assert source.gray[y, x] == reference.gray[row, column]
        columns_seen.add(x)
    assert len(columns_seen) == num_sources


@pytest.mark.slow
def test_window_costs_take_time_wherever_the_data_lie() -> None:
    from scripts.benchmarks.matching.bounds import seconds_in_cache

    assert all(0 < seconds < 1e-4 for seconds in seconds_in_cache(StereoConfig()))


@pytest.mark.slow
def test_no_more_planes_are_counted_than_the_method_can_look_at() -> None:
    from resdepth_colmap.matching.propagation import NUM_PROPAGATED
    from resdepth_colmap.matching.random_planes import NUM_PERTURBED
    from scripts.benchmarks.matching.bounds import count_evaluations

    views = noise_views(0.002, 2)
    counts = [
        count_evaluations(views, DEPTH_RANGE, StereoConfig(num_iterations=count))
        for count in (1, 2)
    ]
    units = views[0].gray.size * 2
    assert units * 2 < counts[0] < counts[1]
    assert counts[1] <= units * (2 + 2 * (NUM_PROPAGATED + NUM_PERTURBED))
