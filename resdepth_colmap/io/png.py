"""PNG data, encoded where that is safe.

pycolmap 4.2.1 brings its own zlib. If it is imported before the system's libz is
loaded, the two are mixed, and whatever compresses (cv2, Pillow, even `zlib.compress`)
corrupts memory, aborts or hangs. Our own imports load zlib first (see `io/__init__`);
for a user's script that did not, a fresh process compresses.
"""

import io
import subprocess
import sys

import numpy as np
import numpy.typing as npt
from PIL import Image

from resdepth_colmap.errors import BackendUnavailableError

_ENCODE = """
import io, sys, zlib
from PIL import Image
mode, width, height = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
image = Image.frombytes(mode, (width, height), sys.stdin.buffer.read())
image.save(sys.stdout.buffer, format="PNG")
"""
_MODES = {(3, "uint8"): "RGB", (2, "uint8"): "L", (2, "uint16"): "I;16"}
_TIMEOUT_S = 120


def encode_png(values: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> bytes:
    """The bytes of a PNG file.

    Args:
        values: RGB, shape (H, W, 3), uint8; or grey, shape (H, W), uint8 or uint16.

    Raises:
        BackendUnavailableError: If no process can be started where one is needed.
    """
    mode = _MODES.get((values.ndim, values.dtype.name))
    if mode is None or (mode == "RGB" and values.shape[2] != 3):
        raise ValueError(f"{values.shape=}, {values.dtype=} but expected RGB or grey.")
    if not is_zlib_sound():
        return _encode_elsewhere(values, mode)
    memory = io.BytesIO()
    Image.fromarray(values).save(memory, format="PNG")
    return memory.getvalue()


def is_zlib_sound() -> bool:
    """Whether zlib was loaded before pycolmap: modules are listed as they came."""
    modules = list(sys.modules)
    if "pycolmap._core" not in modules:
        return True
    loaded_before = modules[: modules.index("pycolmap._core")]
    return "zlib" in loaded_before


def _encode_elsewhere(
    values: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], mode: str
) -> bytes:
    height, width = values.shape[:2]
    command = [sys.executable, "-c", _ENCODE, mode, str(width), str(height)]
    little_endian = values.astype(values.dtype.newbyteorder("<"), order="C")
    try:
        done = subprocess.run(
            command,
            input=little_endian.tobytes(),
            capture_output=True,
            check=True,
            timeout=_TIMEOUT_S,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise BackendUnavailableError(
            f"cannot encode a PNG file ({error}); "
            "import resdepth_colmap (or zlib) before pycolmap."
        ) from error
    return done.stdout
