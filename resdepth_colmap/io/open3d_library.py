"""The one door to open3d, which needs libraries of the system that may be missing."""

from types import ModuleType

from resdepth_colmap.errors import BackendUnavailableError

PACKAGES = "libegl1 libgl1 libgomp1 libusb-1.0-0 libx11-6"


def load_open3d() -> ModuleType:
    """Import open3d: seconds the first time.

    Raises:
        BackendUnavailableError: If it, or a library that it needs, is not installed.
    """
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise BackendUnavailableError(
            f"open3d cannot be loaded ({error}); pip install open3d, and on Debian or "
            f"Ubuntu: apt install {PACKAGES}."
        ) from error
    module: ModuleType = open3d
    return module
