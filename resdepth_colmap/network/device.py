"""The device that the network runs on."""

import torch

from resdepth_colmap.config import Device
from resdepth_colmap.errors import BackendUnavailableError


def resolve_device(device: Device) -> torch.device:
    """The device to use; `auto` takes CUDA, else Apple's MPS, else the CPU.

    Args:
        device: The requested device.

    Returns:
        A device that this machine has.

    Raises:
        BackendUnavailableError: If that device is not on this machine.
    """
    available = available_devices()
    if device is Device.AUTO:
        return torch.device(available[0])
    if device not in available:
        names = ", ".join(available)
        raise BackendUnavailableError(
            f"no device {str(device)!r} on this machine (torch {torch.__version__}); "
            f"available: {names}. Choose one of these, or auto."
        )
    return torch.device(str(device))


def available_devices() -> list[str]:
    """Names of this machine's devices, the fastest first."""
    names = ["cuda"] if torch.cuda.is_available() else []
    if torch.backends.mps.is_available():
        names.append("mps")
    return [*names, "cpu"]
