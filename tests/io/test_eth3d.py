"""Laws of reading ETH3D's raw depth and masks."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.eth3d import Eth3dScene, read_evaluated, read_raw_depth


def test_what_is_not_known_becomes_nothing(tmp_path: Path) -> None:
    given = np.array([[1.5, np.inf, np.nan], [-1.0, 0.0, 2.5]], "<f4")
    (tmp_path / "x.JPG").write_bytes(given.tobytes())
    depth = read_raw_depth(tmp_path / "x.JPG", 3, 2)
    assert depth.tolist() == [[1.5, 0, 0], [0, 0, 2.5]]
    assert depth.dtype == np.float32


@pytest.mark.parametrize("num_bytes", [0, 23, 25])
def test_another_number_of_bytes_is_refused(tmp_path: Path, num_bytes: int) -> None:
    (tmp_path / "x.JPG").write_bytes(bytes(num_bytes))
    with pytest.raises(
        WorkspaceError, match=rf"x\.JPG: expected 24 bytes .*, found {num_bytes};"
    ):
        read_raw_depth(tmp_path / "x.JPG", 3, 2)


@pytest.mark.parametrize("mode", ["L", "P"])
def test_the_second_bit_of_a_mask_excludes(tmp_path: Path, mode: str) -> None:
    values = np.array([[0, 1, 2, 3]], np.uint8)
    image = Image.fromarray(values)
    if mode == "P":
        image = Image.frombytes("P", image.size, values.tobytes())
        image.putpalette([255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 9, 9])
    image.save(tmp_path / "mask.png")
    evaluated = read_evaluated(tmp_path / "mask.png", 4, 1)
    assert evaluated.tolist() == [[True, True, False, False]]


def test_a_name_that_leads_out_is_refused(tmp_path: Path) -> None:
    scene = Eth3dScene(path=tmp_path)
    for find in (scene.image_path, scene.truth_path, scene.mask_paths):
        with pytest.raises(WorkspaceError, match="leads out"):
            find("../evil.JPG")
