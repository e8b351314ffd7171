import pytest
import torch

from resdepth_colmap.config import Device
from resdepth_colmap.errors import BackendUnavailableError
from resdepth_colmap.network.device import available_devices, resolve_device


def test_the_cpu_is_always_there() -> None:
    assert resolve_device(Device.CPU) == torch.device("cpu")
    assert available_devices()[-1] == "cpu"


def test_auto_takes_the_fastest_device() -> None:
    assert resolve_device(Device.AUTO).type == available_devices()[0]


def test_a_missing_device_names_those_that_are_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(BackendUnavailableError, match=r"'cuda'.*available:.*cpu"):
        resolve_device(Device.CUDA)


def test_cuda_goes_before_mps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.backends.mps, "is_available", lambda: True)
    assert resolve_device(Device.AUTO).type == "cuda"
    assert resolve_device(Device.MPS).type == "mps"
