"""Laws of the validation: what is measured, and which weights are best."""

import csv
import dataclasses
import math
from pathlib import Path

import pytest
from noisy_planes import write_noisy_plane
from PIL import Image

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, read_facts, save_weights
from resdepth_colmap.training.config import Schedule, TrainConfig
from resdepth_colmap.training.data.scenes import split_scenes
from resdepth_colmap.training.loop import train
from resdepth_colmap.training.validation import Scores, ValidationSet

NETWORK = NetworkConfig(
    levels=3, base_channels=4, max_channels=8, propagation_channels=0
)
TRAINING = TrainConfig(
    steps=4,
    batch_size=2,
    crop_px=32,
    checkpoint_steps=2,
    validation_steps=2,
    validation_share=0.3,
    validation_views=1,
    tensorboard=False,
)


def test_a_network_that_changes_nothing_has_ratios_of_one(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "plane", wrong_share=0.6)
    views = ValidationSet.of("held_out", [scene], most=4)
    blind = dataclasses.replace(NETWORK, source_depth=False)
    scores, pictures = views.measure(ResDepthNet(blind))
    assert scores == pytest.approx((1.0, 1.0, 1.0), abs=1e-5)
    assert len(views.views) == 4
    assert len(pictures) == 2
    assert pictures[0].truth is not None


def test_the_score_leaves_out_what_is_not_known() -> None:
    assert Scores(0.4, 0.8, 1.0).score == pytest.approx(0.6)
    assert Scores(0.4, math.nan, 1.0).score == 0.4
    assert math.isnan(Scores(math.nan, math.nan, 1.0).score)


@pytest.mark.slow
def test_held_out_and_watched_scenes_are_measured_and_drawn(tmp_path: Path) -> None:
    scenes = [write_noisy_plane(tmp_path / "in" / name) for name in ("a", "b", "c")]
    watched = write_noisy_plane(tmp_path / "watched", wrong_share=0.6)
    output = tmp_path / "run"
    best = train(scenes, output, NETWORK, TRAINING, validate_on=[watched])
    assert best == output / "best.safetensors"
    with (output / "log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["2", "4"]
    for row in rows:
        for name in ("held_out_loss", "held_out_mae_ratio", "watched_medae_ratio"):
            assert float(row[name]) > 0
    best_row = min(
        rows,
        key=lambda row: (
            float(row["watched_mae_ratio"]) + float(row["watched_medae_ratio"])
        ),
    )
    facts = read_facts(best)
    assert facts["steps"] == best_row["step"]
    assert facts["watched_mae_ratio"] == pytest.approx(
        float(best_row["watched_mae_ratio"]), rel=1e-4
    )
    held_out = split_scenes(scenes, TRAINING.validation_share).held_out
    names = [path.stem for path in (output / "samples").rglob("*.npz")]
    assert not any("watched" in name for name in names)
    assert held_out
    for name in ("curves", "predictions/held_out_0", "predictions/watched_0"):
        with Image.open(output / f"{name}.png") as picture:
            assert picture.mode == "RGB"


@pytest.mark.slow
def test_what_a_training_starts_from_is_what_it_has_to_beat(tmp_path: Path) -> None:
    scenes = [write_noisy_plane(tmp_path / "in" / name) for name in ("a", "b")]
    weights = tmp_path / "first.safetensors"
    save_weights(weights, ResDepthNet(NETWORK))
    # Steps this large only do harm.
    config = dataclasses.replace(
        TRAINING, init=weights, learning_rate=10.0, schedule=Schedule.CONSTANT
    )
    best = train(scenes, tmp_path / "run", NETWORK, config)
    assert read_facts(best)["steps"] == "0"
    expected = load_weights(weights).state_dict()
    actual = load_weights(best).state_dict()
    assert all((actual[name] == expected[name]).all() for name in expected)


def test_a_scene_to_train_on_and_to_watch_is_refused(tmp_path: Path) -> None:
    scenes = [write_noisy_plane(tmp_path / name) for name in ("a", "b")]
    with pytest.raises(TrainingError, match="both for training and for validation"):
        train(scenes, tmp_path / "run", NETWORK, TRAINING, validate_on=scenes[1:])
