"""Laws of the training: the same steps whatever the stops; what a bad batch does."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from crop_sets import batch_of_step
from noisy_planes import write_noisy_plane
from planes import write_plane_workspace

from resdepth_colmap.errors import TrainingError, WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.weights import load_weights, save_weights
from resdepth_colmap.training.config import Precision, TrainConfig
from resdepth_colmap.training.data.samples import prepare_samples
from resdepth_colmap.training.initialisation import fresh_network
from resdepth_colmap.training.loop import train

NETWORK = NetworkConfig(levels=3, base_channels=4, max_channels=8)
TRAINING = TrainConfig(
    steps=4, batch_size=2, crop_px=32, checkpoint_steps=2, tensorboard=False
)


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    return write_noisy_plane(tmp_path / "plane")


def _parameters(path: Path) -> dict[str, torch.Tensor]:
    return dict(load_weights(path).state_dict())


def test_a_stopped_training_ends_with_the_same_weights(
    workspace: Path, tmp_path: Path
) -> None:
    whole = train([workspace], tmp_path / "whole", NETWORK, TRAINING)
    interrupted = tmp_path / "interrupted"

    class Stop(Exception):  # noqa: N818
        pass

    class StoppingProgress:
        """Stops the training in its third step."""

        def stage(self, title: str, total: int) -> "StoppingProgress":
            self.done, self.stops = 0, title == "Training"
            return self

        def __enter__(self) -> "StoppingProgress":
            return self

        def __exit__(self, *_: object) -> None:
            return None

        def __call__(self, units: float) -> None:
            self.done += 1
            if self.stops and self.done == 4:  # the first call says where it starts
                raise Stop

    with pytest.raises(Stop):
        train([workspace], interrupted, NETWORK, TRAINING, StoppingProgress())
    resumed = train([workspace], interrupted, NETWORK, TRAINING)
    first, second = _parameters(whole), _parameters(resumed)
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_with_the_unet_frozen_the_propagation_alone_learns(
    workspace: Path, tmp_path: Path
) -> None:
    before = fresh_network(NETWORK, TRAINING)
    torch.nn.init.normal_(before.head.weight, std=0.1)
    save_weights(tmp_path / "first.safetensors", before)
    config = dataclasses.replace(
        TRAINING, init=tmp_path / "first.safetensors", freeze_unet=True
    )
    output = tmp_path / "run"
    train([workspace], output, NETWORK, config)
    begun = load_weights(tmp_path / "first.safetensors").state_dict()
    ended = load_weights(output / "weights.safetensors").state_dict()
    for name, value in begun.items():
        same = torch.equal(ended[name], value)
        assert same != name.startswith("propagation.") or not value.ndim, name


def test_frozen_norms_keep_their_statistics_while_weights_change(
    workspace: Path, tmp_path: Path
) -> None:
    first = tmp_path / "first.safetensors"
    before = fresh_network(NETWORK, TRAINING)
    torch.nn.init.normal_(before.head.weight, std=0.1)
    save_weights(first, before)
    config = dataclasses.replace(TRAINING, init=first, freeze_norms=True)
    train([workspace], tmp_path / "run", NETWORK, config)
    begun = load_weights(first).state_dict()
    ended = load_weights(tmp_path / "run" / "weights.safetensors").state_dict()
    for name, value in begun.items():
        is_statistic = "running_" in name or not value.ndim
        assert torch.equal(ended[name], value) == is_statistic, name


def test_the_log_has_a_line_for_each_checkpoint(
    workspace: Path, tmp_path: Path
) -> None:
    train([workspace], tmp_path / "run", NETWORK, TRAINING)
    lines = (tmp_path / "run" / "log.csv").read_text().splitlines()
    assert lines[0].startswith("step,learning_rate,loss,held_out_loss,")
    assert [line.split(",")[0] for line in lines[1:]] == ["2", "4"]


@pytest.mark.slow
def test_training_on_one_scene_lowers_its_loss(workspace: Path, tmp_path: Path) -> None:
    config = TrainConfig(
        steps=200, batch_size=4, crop_px=32, checkpoint_steps=20, learning_rate=5e-3
    )
    network = NetworkConfig(levels=3, base_channels=16, max_channels=32)
    train([workspace], tmp_path / "run", network, config)
    lines = (tmp_path / "run" / "log.csv").read_text().splitlines()[1:]
    losses = [float(line.split(",")[2]) for line in lines]
    assert losses[-1] < 0.6 * losses[0]


def test_a_loss_that_is_no_number_names_its_batch(
    workspace: Path, tmp_path: Path
) -> None:
    output = tmp_path / "run"
    for path in prepare_samples([workspace], NETWORK, output / "samples"):
        with np.load(path) as arrays:
            changed = {name: arrays[name] for name in arrays.files}
        changed["inverse_depth"] = np.full_like(changed["inverse_depth"], np.nan)
        np.savez(path, **changed)
    with pytest.raises(
        TrainingError, match=r"step 0: the loss is nan.*plane-.*not saved"
    ):
        train([workspace], output, NETWORK, TRAINING)


def test_a_workspace_without_truth_says_what_is_missing(tmp_path: Path) -> None:
    write_plane_workspace(tmp_path / "plane", kinds=())
    with pytest.raises(WorkspaceError, match="plane: no ground_truth"):
        train([tmp_path / "plane"], tmp_path / "run", NETWORK, TRAINING)


def test_where_the_map_is_right_input_and_target_are_the_same(
    workspace: Path, tmp_path: Path
) -> None:
    paths = tuple(prepare_samples([workspace], NETWORK, tmp_path))
    paths = tuple(path for path in paths if path.stem.endswith("-dense"))
    batch = batch_of_step(paths, network=NETWORK, seed=0, vary_light=True)
    error = (batch.inputs[:, :1] - batch.target).abs()[batch.known]
    assert (error < 1e-3).float().mean() > 0.8


def test_the_copy_with_holes_is_told_so(workspace: Path, tmp_path: Path) -> None:
    paths = prepare_samples([workspace], NETWORK, tmp_path)
    shares = {}
    for path in paths:
        with np.load(path) as arrays:
            shares[path.stem.rsplit("-", 1)[1]] = float(arrays["valid"].mean())
    assert shares["dense"] == 1.0
    assert shares["holes"] < 1.0
    name = sorted((workspace / "ground_truth").rglob("*.bin"))[0]
    assert read_depth_map(name).min() > 0


def test_half_the_precision_trains_nearly_the_same(
    workspace: Path, tmp_path: Path
) -> None:
    found = {}
    for precision in Precision:
        config = dataclasses.replace(TRAINING, precision=precision)
        path = train([workspace], tmp_path / precision, NETWORK, config)
        found[precision] = _parameters(path)
        log = (tmp_path / precision / "log.csv").read_text().splitlines()
        found[precision]["loss"] = torch.tensor(float(log[-1].split(",")[2]))
    single, halved = found[Precision.SINGLE], found[Precision.BFLOAT16]
    assert any(not torch.equal(single[name], halved[name]) for name in single)
    torch.testing.assert_close(halved["loss"], single["loss"], rtol=0.05, atol=0)
