"""What a run ran on: versions, and the memory it took."""

import importlib.metadata
import platform
import sys

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
    """Most memory that this process has used so far, in MiB; None on Windows."""
    if sys.platform == "win32":
        return None
    import resource  # not on Windows

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts in KiB, macOS in bytes.
    return peak / 1024 if sys.platform != "darwin" else peak / 1024**2


def _version(package: str) -> str:
    for name in (package, *_INSTEAD.get(package, ())):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "not installed"
