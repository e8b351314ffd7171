"""What the command `train` makes of its options."""

import sys
import types
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from click.testing import CliRunner

from resdepth_colmap.cli.main import main
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.training.config import Preset, TrainConfig


class Call(NamedTuple):
    workspaces: tuple[Path, ...]
    output: Path
    network: NetworkConfig
    config: TrainConfig
    progress: object
    validate_on: tuple[Path, ...]


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """The trainings that were asked for; none of them is done."""
    seen: list[Call] = []

    def fake(*arguments: Any) -> Path:
        seen.append(Call(*arguments))
        return tmp_path / "weights.safetensors"

    loop = types.SimpleNamespace(train=fake)
    monkeypatch.setitem(sys.modules, "resdepth_colmap.training.loop", loop)
    return seen


def run_train(tmp_path: Path, *options: str) -> str:
    arguments = ["train", str(tmp_path), "--output", str(tmp_path), *options]
    result = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_options_are_passed_on_and_the_path_is_printed(
    tmp_path: Path, calls: list[Call]
) -> None:
    text = run_train(tmp_path, "--steps", "7", "--no-gate", "--levels", "3")
    assert text == f"{tmp_path / 'weights.safetensors'}\n"
    (call,) = calls
    assert call.workspaces == (tmp_path,)
    assert call.output == tmp_path
    assert call.validate_on == ()
    assert call.network == NetworkConfig(levels=3, gate=False)
    assert call.config == TrainConfig(steps=7)


def test_the_paper_is_a_preset_that_options_change(
    tmp_path: Path, calls: list[Call]
) -> None:
    run_train(tmp_path, "--preset", "paper", "--variant", "mono", "--batch-size", "20")
    (call,) = calls
    assert call.network == NetworkConfig.paper(call.network.variant)
    assert call.network.variant == "mono"
    assert call.config == TrainConfig.of(Preset.PAPER, {"batch_size": 20})
    assert call.config.learning_rate == 1e-5
    assert call.config.log_weight == 0


def test_an_option_that_is_typed_counts_even_where_it_is_the_default(
    tmp_path: Path, calls: list[Call]
) -> None:
    typed = ["--learning-rate", "1e-3", "--base-channels", "16"]
    run_train(tmp_path, "--preset", "paper", *typed)
    assert calls[0].config.learning_rate == 1e-3
    assert calls[0].network.base_channels == 16


def test_scenes_to_watch_may_be_several(tmp_path: Path, calls: list[Call]) -> None:
    folders = [tmp_path / name for name in ("a", "b")]
    for folder in folders:
        folder.mkdir()
    run_train(tmp_path, *(f"--validate-on={folder}" for folder in folders))
    assert calls[0].validate_on == tuple(folders)
