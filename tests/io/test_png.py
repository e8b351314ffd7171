import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from resdepth_colmap.io import png
from resdepth_colmap.io.png import encode_png


@pytest.mark.parametrize("is_sound", [True, False])
@pytest.mark.parametrize("kind", ["rgb", "grey", "grey16"])
def test_what_is_encoded_here_or_elsewhere_is_decoded(
    monkeypatch: pytest.MonkeyPatch, is_sound: bool, kind: str
) -> None:
    monkeypatch.setattr(png, "is_zlib_sound", lambda: is_sound)
    shape = (5, 7, 3) if kind == "rgb" else (5, 7)
    rng = np.random.default_rng(0)
    values = rng.integers(0, 256, shape).astype(np.uint8)
    if kind == "grey16":
        wide = values.astype(np.uint16) * 200
        read = np.asarray(Image.open(io.BytesIO(encode_png(wide))))
        np.testing.assert_array_equal(read, wide)
    else:
        read = np.asarray(Image.open(io.BytesIO(encode_png(values))))
        np.testing.assert_array_equal(read, values)


@pytest.mark.parametrize("order", ["pycolmap, cv2", "cv2, pycolmap", "zlib, pycolmap"])
def test_encoding_survives_each_import_order(order: str) -> None:
    code = (
        f"import {order}\n"
        "import numpy\n"
        "from resdepth_colmap.io.png import encode_png\n"
        "rng = numpy.random.default_rng(0)\n"
        "for _ in range(3):\n"
        "    encode_png(rng.integers(0, 256, (90, 70, 3)).astype(numpy.uint8))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_wrong_shape_is_a_bug_of_the_caller() -> None:
    with pytest.raises(ValueError, match="expected"):
        encode_png(np.zeros((2, 2, 4), np.uint8))
