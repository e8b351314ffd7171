"""Versions, hardware and memory of a run."""

import importlib.metadata
import os
import platform
import sys
from pathlib import Path

PACKAGES = ("resdepth-colmap", "torch", "pycolmap", "open3d", "numpy")
_INSTEAD = {"pycolmap": ("pycolmap-cuda12",), "open3d": ("open3d-cpu",)}


def versions() -> dict[str, str]:
    """Version of Python and of each package that a result depends on.

    Packages with variants of other names (`pycolmap-cuda12`) are found under these,
    too; "not installed" where there is none.
    """
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        found[package] = _version(package)
    return found


def hardware() -> str:
    """This machine, as "AMD EPYC 7B13, 2 cores, no GPU".

    The cores are those that this process may use; the GPU is the one that PyTorch uses
    by default. Imports torch, which takes seconds.
    """
    num_cores = _num_usable_cores()
    cores = "1 core" if num_cores == 1 else f"{num_cores} cores"
    return f"{_processor()}, {cores}, {_gpu() or 'no GPU'}"


def peak_memory_mb() -> float | None:
    """Peak resident memory of this process, in MiB; None where unknown.

    Linux counts VmHWM from the start of the program; the value of getrusage is
    inherited from the parent process.
    """
    status = Path("/proc/self/status")
    if status.exists():
        for line in status.read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    return peak / (1024**2 if sys.platform == "darwin" else 1024)


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text("utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _num_usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _gpu() -> str | None:
    import torch  # slow, and not needed for the rest

    if torch.cuda.is_available():
        return torch.cuda.get_device_name()
    return "Apple GPU" if torch.backends.mps.is_available() else None


def _version(package: str) -> str:
    for name in (package, *_INSTEAD.get(package, ())):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "not installed"
