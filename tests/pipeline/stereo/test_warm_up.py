"""Laws of the word about compiling: said where one waits, and only there."""

import logging
import time

import pytest

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.pipeline.stereo import warm_up as stereo_warm_up


@pytest.mark.parametrize(("patience_s", "num_words"), [(0.01, 1), (30.0, 0)])
def test_a_word_is_said_when_compiling_takes_long(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    patience_s: float,
    num_words: int,
) -> None:
    monkeypatch.setattr(stereo_warm_up, "PATIENCE_S", patience_s)
    monkeypatch.setattr(stereo_warm_up, "_match_little", lambda _: time.sleep(0.3))
    with caplog.at_level(logging.INFO):
        stereo_warm_up.warm_up(StereoConfig())
    words = [record for record in caplog.records if "once" in record.message]
    assert len(words) == num_words


@pytest.mark.parametrize("geom_consistency", [True, False])
def test_what_is_warmed_up_is_what_will_be_called(geom_consistency: bool) -> None:
    stereo_warm_up.warm_up(StereoConfig(geom_consistency=geom_consistency))
