"""Laws of keeping matched depth."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.evaluation.depth.match_cache import MatchCache, Matching
from resdepth_colmap.matching.patch_match import MatchView

RANGE = (1.0, 2.0)
CONFIG = StereoConfig()


def view(seed: int) -> MatchView:
    gray = np.random.default_rng(seed).random((4, 5), dtype=np.float32)
    return MatchView(gray=gray, K=np.eye(3), cam_from_world=np.eye(3, 4))


def refuse() -> Matching:
    raise AssertionError("matched again")


def test_a_result_is_kept_for_the_same_input_only(tmp_path: Path) -> None:
    cache = MatchCache(folder=tmp_path / "new")
    views = [view(0), view(1)]
    sources = (np.full((4, 5), 2.5, np.float32),)
    matching = Matching(
        depth=np.full((4, 5), 1.5, np.float32), cpu_s=2.5, source_depths=sources
    )
    assert cache.get("a", views, RANGE, CONFIG, lambda: matching) is matching
    found = cache.get("a", views, RANGE, CONFIG, refuse)
    assert found.cpu_s == 2.5
    assert np.array_equal(found.depth, matching.depth)
    assert np.array_equal(found.source_depths, sources)
    moved = dataclasses.replace(views[1], cam_from_world=np.ones((3, 4)))
    for name, other_views, depth_range, config in (
        ("b", views, RANGE, CONFIG),
        ("a", [view(0), view(2)], RANGE, CONFIG),
        ("a", [views[0], moved], RANGE, CONFIG),
        ("a", views, (1.0, 3.0), CONFIG),
        ("a", views, RANGE, StereoConfig(seed=1)),
    ):
        with pytest.raises(AssertionError, match="matched again"):
            cache.get(name, other_views, depth_range, config, refuse)
