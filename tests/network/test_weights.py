import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from resdepth_colmap.errors import WeightsError
from resdepth_colmap.network import weights
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import (
    load_weights,
    read_config,
    read_facts,
    save_weights,
    weights_hash,
)

CONFIG = NetworkConfig(levels=2, base_channels=4, max_channels=8)


def trained() -> ResDepthNet:
    torch.manual_seed(0)
    network = ResDepthNet(CONFIG)
    torch.nn.init.normal_(network.head.weight, std=0.1)
    for _ in range(3):  # moves the statistics of the batch norms
        network(torch.randn(2, len(CONFIG.channels), 16, 16))
    return network.eval()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "net.safetensors"
    save_weights(path, trained(), {"steps": 12})
    return path


def test_what_is_saved_is_loaded(file: Path) -> None:
    network = load_weights(file)
    stack = torch.randn(1, len(CONFIG.channels), 16, 16)
    assert network.config == CONFIG
    assert not network.training
    assert all(p.dtype == torch.float32 for p in network.parameters())
    assert all(p.requires_grad for p in network.parameters())
    expected, actual = trained()(stack), network(stack)
    torch.testing.assert_close(actual, expected, rtol=5e-3, atol=5e-3)


def test_saving_what_was_loaded_gives_the_same_file(file: Path) -> None:
    again = file.with_name("again.safetensors")
    save_weights(again, load_weights(file), {"steps": 12})
    assert weights_hash(again) == weights_hash(file)


def test_kernels_are_halved_and_statistics_are_not(file: Path) -> None:
    network = trained()
    network.bottleneck[1].running_var.fill_(1e6)  # type: ignore[operator]
    network.encoder[0][1].running_var.fill_(1e-12)  # type: ignore[index]
    save_weights(file, network)
    stored = load_file(file)
    assert stored["head.weight"].dtype == torch.float16
    assert stored["bottleneck.1.running_var"].dtype == torch.float32
    loaded = load_weights(file).state_dict()
    for name in ("bottleneck.1.running_var", "encoder.0.1.running_var"):
        assert torch.equal(loaded[name], network.state_dict()[name])
    assert loaded["bottleneck.1.num_batches_tracked"] == 3


def test_the_facts_of_the_training_come_back(file: Path) -> None:
    assert read_facts(file) == {"steps": 12}


def test_loading_draws_no_random_numbers(file: Path) -> None:
    torch.manual_seed(5)
    before = torch.get_rng_state()
    load_weights(file)
    assert torch.equal(torch.get_rng_state(), before)


def test_weights_that_are_not_numbers_are_not_saved(tmp_path: Path) -> None:
    network = trained()
    torch.nn.init.constant_(network.head.weight, float("nan"))
    path = tmp_path / "net.safetensors"
    with pytest.raises(WeightsError, match=r"net\.safetensors.*head\.weight"):
        save_weights(path, network)
    assert not path.exists()


def _truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _flipped_header(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[0:8] = b"\xff" * 8
    path.write_bytes(data)


def _pickle(path: Path) -> None:
    torch.save({"weight": torch.zeros(3)}, path)


def _foreign(path: Path) -> None:
    save_file({"weight": torch.zeros(3)}, path)


def _empty(path: Path) -> None:
    path.write_bytes(b"")


def _missing(path: Path) -> None:
    path.unlink()


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _with_header(**changes: object) -> Callable[[Path], None]:
    header = {"format_version": 1, "network": CONFIG.to_mapping(), "facts": {}}
    return _with_text(json.dumps(header | changes))


def _with_text(text: str) -> Callable[[Path], None]:
    return lambda path: save_file(load_file(path), path, {weights.FORMAT: text})


def _network(**changes: object) -> dict[str, object]:
    return CONFIG.to_mapping() | changes


BREAKAGES = [
    _truncated,
    _flipped_header,
    _pickle,
    _foreign,
    _empty,
    _missing,
    _folder,
    _with_header(format_version=2),
    _with_text("{"),
    _with_text("[1]"),
    _with_header(network=[1]),
    _with_header(facts=None),
    _with_header(network=_network(levels="two")),
    _with_header(network=_network(colour=1)),
    _with_header(network=_network(base_channels=8)),
    _with_header(network=_network(levels=3)),
    _with_header(network=_network(base_channels=1024, max_channels=1024, levels=9)),
]


@pytest.mark.parametrize("break_it", BREAKAGES)
def test_a_file_that_does_not_fit_names_itself(
    file: Path, break_it: Callable[[Path], None]
) -> None:
    break_it(file)
    with pytest.raises(WeightsError, match=r"net\.safetensors: .{10}"):
        load_weights(file)


def test_numbers_that_are_not_finite_are_refused(file: Path) -> None:
    tensors: dict[str, Tensor] = load_file(file)
    tensors["head.weight"][0] = float("inf")
    header = json.dumps(weights._header(file))
    save_file(tensors, file, {weights.FORMAT: header})
    with pytest.raises(WeightsError, match=r"head\.weight is not finite"):
        load_weights(file)


def test_without_a_file_the_packages_own_weights_are_meant(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weights, "default_weights_path", lambda: file)
    assert load_weights().config == CONFIG
    assert read_facts() == {"steps": 12}
    assert weights_hash() == weights_hash(file)


def test_the_packages_own_weights_lie_in_the_package() -> None:
    path = weights.default_weights_path()
    assert path.parts[-3:] == ("resdepth_colmap", "weights", "resdepth.safetensors")


def _rewritten(path: Path, change: Callable[[dict[str, object]], object]) -> None:
    """Change the options of the network in the header of a file."""
    with safe_open(path, framework="pt") as opened:
        header = json.loads(opened.metadata()[weights.FORMAT])
    change(header["network"])
    save_file(load_file(path), path, {weights.FORMAT: json.dumps(header)})


def test_a_file_from_before_an_option_is_of_a_network_without_it(file: Path) -> None:
    before = ResDepthNet(dataclasses.replace(CONFIG, source_depth=False))
    save_weights(file, before)
    _rewritten(file, lambda options: options.pop("source_depth"))
    assert load_weights(file).config == before.config


@pytest.mark.parametrize("value", [True, False])
def test_a_file_with_the_old_name_of_an_option_is_loaded(
    file: Path, value: bool
) -> None:
    network = ResDepthNet(dataclasses.replace(CONFIG, source_resampling=value))
    save_weights(file, network)

    def rename(options: dict[str, object]) -> None:
        options["second_look"] = options.pop("source_resampling")

    _rewritten(file, rename)
    assert load_weights(file).config == network.config
    assert read_config(file) == network.config
