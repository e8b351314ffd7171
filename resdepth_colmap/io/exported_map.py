"""Maps in formats of other programs: NPY, PFM, 16-bit PNG.

WorkspaceError if a file cannot be written.
"""

import io
from pathlib import Path

import numpy as np
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import whole_file, write_whole
from resdepth_colmap.io.images import open_image
from resdepth_colmap.scene import DepthMap, FloatMap

MAX_PNG_VALUE = 65535


def write_npy(path: Path, depth: DepthMap) -> None:
    """Write a depth map as float32, shape (H, W), for `numpy.load`."""
    buffer = io.BytesIO()
    np.save(buffer, depth.astype("<f4"))
    write_whole(path, buffer.getvalue())


def write_pfm(path: Path, depth: DepthMap) -> None:
    """Write a depth map as PFM: grey, little-endian float32, bottom row first."""
    with whole_file(path) as partial:
        Image.fromarray(depth.astype(np.float32)).save(partial, format="PPM")


def write_png16(path: Path, depth: DepthMap, unit: float) -> None:
    """Write a depth map as 16-bit grey PNG: value = depth / unit, rounded.

    A depth beyond the range becomes the largest value; one that would round to 0, which
    means "no depth", becomes 1.

    Args:
        path: The file to write.
        depth: Shape (H, W), in workspace units; 0 = no depth.
        unit: Depth of one step of the value, in workspace units.
    """
    scaled = np.clip(np.rint(depth.astype(np.float64) / unit), 1, MAX_PNG_VALUE)
    values = np.where(depth > 0, scaled, 0).astype(np.uint16)
    with whole_file(path) as partial:
        Image.fromarray(values).save(partial, format="PNG")


def read_pfm(path: Path) -> FloatMap:
    """Read a grey PFM file, of either byte order.

    The values are taken as stored: the size of the header's scale has no meaning, as in
    Middlebury's own reader. (OpenCV divides by it: 1/255 in Middlebury's files.)

    Returns:
        Shape (H, W), float32, the top row first; infinite values are left as they are.

    Raises:
        WorkspaceError: If the file is not there, no grey PFM, or truncated.
    """
    with open_image(path) as image:
        if image.format != "PPM" or image.mode != "F":
            raise WorkspaceError(f"{path}: not a grey PFM file ('Pf').")
        width_px, height_px = image.size
        num_present = path.stat().st_size
        # Before anything is allocated: the header may claim terabytes.
        if num_present < 4 * width_px * height_px:
            raise WorkspaceError(
                f"{path}: the header says {width_px} x {height_px}, but the file has "
                f"{num_present} bytes; it is truncated, copy it again."
            )
        return np.array(image, np.float32)
