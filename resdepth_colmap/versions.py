"""What a run ran on: versions, and the memory it took."""

import importlib.metadata
import platform
import sys
from pathlib import Path

PACKAGES = ("resdepth-colmap", "torch", "pycolmap", "open3d", "numpy")
_INSTEAD = {"pycolmap": ("pycolmap-cuda12",), "open3d": ("open3d-cpu",)}


def versions() -> dict[str, str]:
    """Version of Python and of each package that a result depends on.

    A package that goes by another name on this machine is looked for under that, too;
    "not installed" where it is not there.
    """
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        found[package] = _version(package)
    return found


def peak_memory_mb() -> float | None:
    """Most memory that this process had at once, in MiB; None where unknown.

    Linux's own count begins with the program; that of getrusage is inherited from the
    process that started it.
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


def _version(package: str) -> str:
    for name in (package, *_INSTEAD.get(package, ())):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "not installed"
