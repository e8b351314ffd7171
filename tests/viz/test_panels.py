"""Laws of the layout: pictures pixel for pixel, and text that stays in its panel."""

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from resdepth_colmap.scene import ColorImage
from resdepth_colmap.viz.colormaps import error_scale
from resdepth_colmap.viz.panels import (
    Panel,
    draw_panels,
    fitted_size,
    rendered,
    resized,
)


def _noise(height: int, width: int, seed: int = 0) -> ColorImage:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (height, width, 3), dtype=np.uint8)


def _is_in(sheet: ColorImage, picture: ColorImage) -> bool:
    """Whether a picture of noise is somewhere on a sheet, pixel for pixel."""
    height, width = picture.shape[:2]
    corners = np.argwhere((sheet == picture[0, 0]).all(axis=2))
    return any(
        np.array_equal(sheet[y : y + height, x : x + width], picture)
        for y, x in corners
    )


def test_pictures_of_any_size_are_drawn_pixel_for_pixel() -> None:
    pictures = [_noise(41, 97), _noise(120, 13, 1), _noise(1, 1, 2), _noise(60, 100, 3)]
    panels = [Panel(picture, "title", "detail") for picture in pictures]
    panels[1] = panels[1]._replace(scale=error_scale())
    for num_columns in (1, 2, 3, 4):
        sheet = draw_panels("name", "note", panels, num_columns, 150)
        assert all(_is_in(sheet, picture) for picture in pictures)


@pytest.mark.parametrize("name", ["W" * 300, "i" * 300, "x/" * 300, "\u6771" * 99])
def test_a_long_name_stays_in_its_panel(name: str) -> None:
    panel = Panel(_noise(50, 200), name, name)
    sheet = draw_panels(name, name, [panel, panel], 2, 200)
    gap = sheet[70:, 221:239]  # between the panels
    assert (gap == 255).all()
    assert (sheet[:, :20] == 255).all() and (sheet[:, -20:] == 255).all()
    assert (sheet[:70, 20:-20] < 128).any()


def test_a_bar_and_its_text_stay_below_their_panels() -> None:
    white = np.full((30, 250, 3), 255, np.uint8)
    panels = [Panel(white, "a", "b", error_scale()), Panel(white, "a", "b")]
    sheet = draw_panels("name", "note", panels, 2, 250)
    below = sheet[66 + 44 + 30 :]
    assert (below[:, 20:270] < 128).any()
    assert (below[:, 272:] == 255).all() and (below[-8:] == 255).all()


def test_nothing_is_left_behind_in_matplotlib() -> None:
    before = dict(rcParams)
    draw_panels("name", "note", [Panel(_noise(9, 9), "a", "b", error_scale())], 1, 200)
    assert dict(rcParams) == before


def test_a_figure_becomes_a_picture_of_its_size() -> None:
    picture = rendered(Figure(figsize=(3, 2), dpi=50))
    assert picture.shape == (100, 150, 3) and picture.dtype == np.uint8


def test_pictures_are_fitted_and_resized() -> None:
    assert fitted_size((300, 600), 480) == (480, 240)
    assert fitted_size((600, 300, 3), 480) == (240, 480)
    assert fitted_size((1, 1000), 480) == (480, 1)
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    assert np.array_equal(resized(rgb, (4, 4))[::2, ::2], rgb)
