import numpy as np
import pytest
from analytic_scene import CAMERA, turned, view_at

from resdepth_colmap.geometry.overlap import overlap

REFERENCE = view_at((0.0, 0.0, 0.0), CAMERA)


def test_a_view_sees_all_that_it_sees_itself() -> None:
    seen = overlap(REFERENCE, REFERENCE, [1.0, 100.0])
    assert seen.inside.all()
    assert seen.disparity_px.max() < 1e-6
    assert seen.angle_deg.max() < 1e-3


def test_a_parallel_view_sees_more_the_farther_away_it_is() -> None:
    aside = view_at((1.0, 0.0, 0.0), CAMERA)
    seen = overlap(REFERENCE, aside, [0.5, 2.0, 10.0, 1000.0])
    shares = seen.inside.mean(axis=1)
    assert (np.diff(shares) >= 0).all()
    assert shares[0] == 0
    assert shares[-1] == 1
    expected = CAMERA.fx / np.array([0.5, 2.0, 10.0, 1000.0])
    np.testing.assert_allclose(seen.disparity_px[:, 40], expected, rtol=1e-6)


def test_rays_meet_at_the_angle_that_trigonometry_says() -> None:
    aside = view_at((1.0, 0.0, 0.0), CAMERA)
    center = 40  # of 9 x 9; the principal point is half a pixel off
    angle = overlap(REFERENCE, aside, [2.0]).angle_deg[0, center]
    assert angle == pytest.approx(np.degrees(np.arctan(0.5)), abs=0.3)


def test_what_lies_behind_a_view_is_not_seen_by_it() -> None:
    away = view_at((0.5, 0.0, 0.0), CAMERA, turned(0.0, np.pi))
    assert not overlap(REFERENCE, away, [1.0, 10.0]).inside.any()
