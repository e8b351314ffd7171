"""A matcher that takes no time: the same depth everywhere, whatever it is asked for."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.matching.patch_match import MatchResult, MatchView, Surface
from resdepth_colmap.pipeline.stereo import stage as stereo
from resdepth_colmap.pipeline.stereo import view as stereo_view
from resdepth_colmap.scene import DepthMap

DEPTH = 4.0


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Call:
    """What the matcher was asked for."""

    reference: MatchView
    sources: Sequence[MatchView]
    depth_range: tuple[float, float]
    start: Surface | None
    source_depths: Sequence[DepthMap] | None


class FakeMatcher:
    """Takes the place of `match_view`; every pixel gets the same depth."""

    def __init__(self) -> None:
        self.calls: list[Call] = []

    def __call__(  # noqa: PLR0913 (as many as match_view has)
        self,
        reference: MatchView,
        sources: Sequence[MatchView],
        depth_range: tuple[float, float],
        config: StereoConfig,
        *,
        start: Surface | None = None,
        source_depths: Sequence[DepthMap] | None = None,
        on_step: Callable[[int, int], None] | None = None,
    ) -> MatchResult:
        call = Call(
            reference=reference,
            sources=sources,
            depth_range=depth_range,
            start=start,
            source_depths=source_depths,
        )
        self.calls.append(call)
        for number in range(1, config.num_iterations + 1):
            if on_step:
                on_step(number, config.num_iterations)
        shape = reference.gray.shape
        normals = np.zeros((*shape, 3), np.float32)
        normals[..., 2] = -1
        return MatchResult(
            depth=np.full(shape, DEPTH, np.float32),
            normals=normals,
            source_costs=np.zeros((len(sources), *shape), np.float32),
        )


def installed(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    """The stage "stereo" matches with a fake; nothing is compiled for it."""
    fake = FakeMatcher()
    monkeypatch.setattr(stereo_view, "match_view", fake)
    monkeypatch.setattr(stereo, "warm_up", lambda _: None)
    return fake
