"""Laws of what a stopped training goes on from."""

import dataclasses
import os
import signal
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest
import torch
from noisy_planes import write_noisy_plane

from resdepth_colmap.errors import TrainingError
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.weights import load_weights, read_facts
from resdepth_colmap.training.config import Preset, Schedule, TrainConfig
from resdepth_colmap.training.data.samples import prepare_samples
from resdepth_colmap.training.loop import train
from resdepth_colmap.training.stop_request import stop_request

NETWORK = NetworkConfig(levels=3, base_channels=4, max_channels=8)
TRAINING = TrainConfig(
    steps=6, batch_size=2, crop_px=32, checkpoint_steps=4, tensorboard=False
)


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_noisy_plane(tmp_path_factory.mktemp("scenes") / "plane")


@pytest.fixture(scope="module")
def training(workspace: Path) -> TrainConfig:
    """How to train, with samples that all tests share."""
    return dataclasses.replace(TRAINING, samples=workspace.parent / "samples")


class SignalAt:
    """A progress that sends this process a signal in a step of the training."""

    def __init__(self, step: int, number: signal.Signals) -> None:
        self.step, self.number = step, number

    def stage(self, title: str, total: int) -> "SignalAt":
        self.done = -1 if title == "Training" else -total - 1000
        return self

    def __enter__(self) -> "SignalAt":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def __call__(self, units: float) -> None:
        self.done += 1
        if self.done == self.step:
            os.kill(os.getpid(), self.number)


def step_of(output: Path) -> int:
    return int(torch.load(output / "state.pt", weights_only=True)["position"]["step"])


def test_a_signal_saves_the_step_it_came_in_and_the_rest_is_as_if_it_had_not(
    workspace: Path, tmp_path: Path, training: TrainConfig
) -> None:
    before = signal.getsignal(signal.SIGTERM)
    output = tmp_path / "stopped"
    with pytest.raises(KeyboardInterrupt):
        train([workspace], output, NETWORK, training, SignalAt(1, signal.SIGTERM))
    assert step_of(output) == 2
    assert signal.getsignal(signal.SIGTERM) == before
    resumed = load_weights(train([workspace], output, NETWORK, training))
    whole = load_weights(train([workspace], tmp_path / "whole", NETWORK, training))
    expected = whole.state_dict()
    assert all(torch.equal(v, expected[n]) for n, v in resumed.state_dict().items())
    logs = [(tmp_path / name / "log.csv").read_text() for name in ("stopped", "whole")]
    cut = [[line.rsplit(",", 1)[0] for line in log.splitlines()] for log in logs]
    assert cut[0] == cut[1]  # all but the seconds


class SignalToAll(SignalAt):
    """Sends the signal to the processes that cut crops too, as a terminal does."""

    def __call__(self, units: float) -> None:
        if self.done + 1 == self.step:
            assert active_children()
            for child in active_children():
                os.kill(child.pid or 0, self.number)
        super().__call__(units)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_all_processes_saves_the_step_it_came_in(
    workspace: Path, tmp_path: Path, training: TrainConfig, number: signal.Signals
) -> None:
    training = dataclasses.replace(training, steps=12, loaders=1)
    with pytest.raises(KeyboardInterrupt):
        train([workspace], tmp_path, NETWORK, training, SignalToAll(4, number))
    assert step_of(tmp_path) == 5
    assert not active_children()
    train([workspace], tmp_path, NETWORK, training)
    assert step_of(tmp_path) == 12


def test_a_second_signal_does_not_wait() -> None:
    with stop_request() as request:
        os.kill(os.getpid(), signal.SIGTERM)
        assert request.is_made
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


def test_a_loss_that_is_no_number_leaves_the_last_good_state(
    workspace: Path, tmp_path: Path
) -> None:
    output = tmp_path / "run"
    first = dataclasses.replace(TRAINING, schedule=Schedule.CONSTANT)
    with pytest.raises(KeyboardInterrupt):
        train([workspace], output, NETWORK, first, SignalAt(1, signal.SIGTERM))
    good = (output / "weights.safetensors").read_bytes()
    for path in prepare_samples([workspace], NETWORK, output / "samples"):
        with np.load(path) as arrays:
            changed = {name: arrays[name] for name in arrays.files}
        changed["guidance"] = np.full_like(changed["guidance"], np.nan)
        np.savez(path, **changed)
    with pytest.raises(TrainingError, match=r"step 2: .*nan.*plane-.*state\.pt is the"):
        train([workspace], output, NETWORK, first)
    assert step_of(output) == 2
    assert (output / "weights.safetensors").read_bytes() == good


def test_other_options_are_refused_by_name_and_harmless_ones_are_not(
    workspace: Path, tmp_path: Path, training: TrainConfig
) -> None:
    output = tmp_path / "run"
    train([workspace], output, NETWORK, training)
    for changes, shown in (
        ({"learning_rate": 2e-3}, "learning_rate was 0.001, not 0.002"),
        ({"steps": 9}, "steps was 6, not 9"),
    ):
        other = dataclasses.replace(training, **changes)
        with pytest.raises(TrainingError, match=rf"{shown}.*--init"):
            train([workspace], output, NETWORK, other)
    with pytest.raises(TrainingError, match="gate was True, not False"):
        gateless = dataclasses.replace(NETWORK, gate=False)
        train([workspace], output, gateless, training)
    harmless = dataclasses.replace(training, checkpoint_steps=1, loaders=0)
    assert train([workspace], output, NETWORK, harmless).is_file()


def test_a_change_of_the_samples_is_logged(
    workspace: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    output = tmp_path / "run"
    train([workspace], output, NETWORK, TRAINING)
    train([workspace], output, NETWORK, TRAINING)
    assert "the samples have changed" not in caplog.text
    other = write_noisy_plane(tmp_path / "other")
    one_sided = dataclasses.replace(TRAINING, validation_share=0.0)
    train([workspace], tmp_path / "second", NETWORK, one_sided)
    train([workspace, other], tmp_path / "second", NETWORK, one_sided)
    assert "the samples have changed" in caplog.text


def test_a_broken_state_names_itself(workspace: Path, tmp_path: Path) -> None:
    (tmp_path / "state.pt").write_bytes(b"half a file")
    with pytest.raises(TrainingError, match=r"state\.pt: not a readable state"):
        train([workspace], tmp_path, NETWORK, TRAINING)


def test_the_number_of_loaders_does_not_change_the_steps(
    workspace: Path, tmp_path: Path, training: TrainConfig
) -> None:
    none, one = (
        load_weights(
            train(
                [workspace],
                tmp_path / str(loaders),
                NETWORK,
                dataclasses.replace(training, loaders=loaders),
            )
        ).state_dict()
        for loaders in (0, 1)
    )
    assert all(torch.equal(none[name], one[name]) for name in none)


def test_the_papers_training_takes_its_steps(workspace: Path, tmp_path: Path) -> None:
    network = dataclasses.replace(
        NetworkConfig.paper(), levels=3, base_channels=4, max_channels=8
    )
    config = TrainConfig.of(
        Preset.PAPER, {"steps": 2, "crop_px": 32, "tensorboard": False}
    )
    path = train([workspace], tmp_path / "run", network, config)
    assert read_facts(path) == {"steps": "2"}
    lines = (tmp_path / "run" / "log.csv").read_text().splitlines()
    assert lines[-1].split(",")[1] == "1e-05"
