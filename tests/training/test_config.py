"""Laws of the options of a training."""

from typing import Any

import pytest

from resdepth_colmap.errors import ConfigError
from resdepth_colmap.training.config import (
    Optimiser,
    Preset,
    Schedule,
    TrainConfig,
)


def test_the_paper_trains_with_plain_l1_and_adam() -> None:
    config = TrainConfig.of(Preset.PAPER)
    assert config.optimiser is Optimiser.ADAM
    assert config.schedule is Schedule.CONSTANT
    assert (config.learning_rate, config.weight_decay) == (1e-5, 1e-5)
    assert (config.batch_size, config.crop_px) == (4, 512)
    assert config.distance_power == 0
    assert not config.vary_light
    assert config.log_weight == config.confidence_weight == config.largest_gradient == 0


def test_the_default_preset_is_the_default() -> None:
    assert TrainConfig.of(Preset.DEFAULT) == TrainConfig()
    assert TrainConfig.of(Preset.DEFAULT, {"steps": 9}) == TrainConfig(steps=9)


def test_a_mapping_makes_the_same_configuration_again() -> None:
    config = TrainConfig.of(Preset.PAPER)
    again = TrainConfig.from_mapping(config.to_mapping())
    assert again == config
    assert again.schedule is Schedule.CONSTANT


@pytest.mark.parametrize(
    "options",
    [
        {"steps": 0},
        {"batch_size": 0},
        {"crop_px": 100},
        {"learning_rate": 0.0},
        {"weight_decay": -1.0},
        {"validation_share": 0.6},
        {"holes_share": 1.5},
        {"log_weight": -0.1},
        {"loaders": -1},
        {"pace": 1},
        {"schedule": "slow"},
        {"optimiser": "sgd"},
    ],
)
def test_a_value_out_of_range_is_refused_by_name(options: dict[str, Any]) -> None:
    (name,) = options
    with pytest.raises(ConfigError, match=name):
        TrainConfig.of(Preset.DEFAULT, options)
