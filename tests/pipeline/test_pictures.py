"""Laws of the strips and the overview: what is in them, looked at pixel by pixel."""

import numpy as np
import pytest

from resdepth_colmap.pipeline.pictures import evenly_chosen, overview
from resdepth_colmap.scene import ColorImage, DepthMap
from resdepth_colmap.viz.canvas import Canvas, fitted_size, resized, shortened
from resdepth_colmap.viz.colormaps import HOLE_COLOR, DepthScale
from resdepth_colmap.viz.strips import BeforeAfter, depth_strip

PHOTO_COLOR = (255, 0, 255)


def _content(
    height: int = 48, width: int = 64, name: str = "a.png", truth: bool = False
) -> BeforeAfter:
    rows = np.linspace(2, 4, height, dtype=np.float32)[:, np.newaxis]
    after: DepthMap = np.repeat(rows, width, axis=1)
    before = after * np.float32(1.02)
    before[: height // 2] = 0
    rgb = np.full((height, width, 3), PHOTO_COLOR, np.uint8)
    known = after if truth else None
    return BeforeAfter(name=name, rgb=rgb, before=before, after=after, truth=known)


def _area(picture: ColorImage, color: tuple[int, int, int]) -> int:
    return int((picture == color).all(axis=2).sum())


def test_a_strip_shows_the_photo_whole_and_the_holes_where_they_are() -> None:
    strip = depth_strip(_content())
    assert strip.dtype == np.uint8 and strip.ndim == 3
    panel_px = 480 * 360
    assert _area(strip, PHOTO_COLOR) == panel_px
    # Half of the initial depth and of the difference, and two legends.
    assert panel_px <= _area(strip, HOLE_COLOR) < 1.01 * panel_px


def test_both_depth_maps_have_the_same_colours() -> None:
    content = _content()
    same = BeforeAfter(
        name="a", rgb=content.rgb, before=content.after, after=content.after
    )
    strip = depth_strip(same)
    colors = DepthScale.of(same.after).colored(same.after)[24, 0]
    rows = (strip == colors).all(axis=2).sum(axis=1)
    assert rows.max() >= 2 * 480


def test_the_truth_adds_a_row_with_both_errors() -> None:
    plain, with_truth = depth_strip(_content()), depth_strip(_content(truth=True))
    assert with_truth.shape[0] > 1.8 * plain.shape[0]
    assert with_truth.shape[1] < plain.shape[1]


@pytest.mark.parametrize(
    ("height", "width"), [(1, 1), (3, 200), (200, 3), (1000, 700), (2, 2)]
)
def test_maps_of_any_form_can_be_drawn(height: int, width: int) -> None:
    strip = depth_strip(_content(height, width, truth=True))
    assert strip.shape[0] > 100 and strip.shape[1] > 500


def test_maps_without_any_depth_can_be_drawn() -> None:
    empty = np.zeros((20, 30), np.float32)
    rgb = np.zeros((20, 30, 3), np.uint8)
    content = BeforeAfter(name="a", rgb=rgb, before=empty, after=empty, truth=empty)
    assert _area(depth_strip(content), HOLE_COLOR) >= 5 * 480 * 320
    assert overview("empty", [content], 1).size


@pytest.mark.parametrize(
    "name",
    ["$x_{$", "a$b$.png", "\u6771\u4eac/\u5199\u771f.jpg", "%s{}\\n", "x" * 500],
)
def test_any_image_name_can_be_written(name: str) -> None:
    plain = depth_strip(_content(name="a.png"))
    assert depth_strip(_content(name=name)).shape == plain.shape
    assert overview(name, [_content(name=name)], 1).size


def test_maps_of_different_sizes_are_refused_by_name() -> None:
    content = _content()
    wrong = BeforeAfter(
        name="b.png", rgb=content.rgb, before=content.before[1:], after=content.after
    )
    with pytest.raises(ValueError, match=r"b\.png"):
        depth_strip(wrong)


@pytest.mark.parametrize("num_images", [0, 1, 2, 4, 7, 12])
def test_the_overview_shows_every_image_it_is_given(num_images: int) -> None:
    contents = [_content(name=f"{number}.png") for number in range(num_images)]
    picture = overview("room", contents, num_images)
    assert _area(picture, PHOTO_COLOR) == num_images * 220 * 165


def test_portrait_and_landscape_images_go_together() -> None:
    contents = [_content(48, 64), _content(64, 48), _content(300, 10)]
    picture = overview("room", contents, 3)
    heights = [165, 280, 280]
    widths = [220, 210, 9]
    shown = sum(h * w for h, w in zip(heights, widths, strict=True))
    assert _area(picture, PHOTO_COLOR) == pytest.approx(shown, rel=0.02)


def test_chosen_images_are_spread_evenly_and_hold_both_ends() -> None:
    names = [str(number) for number in range(100)]
    chosen = evenly_chosen(names, 12)
    steps = np.diff([int(name) for name in chosen])
    assert len(chosen) == 12 and (chosen[0], chosen[-1]) == ("0", "99")
    assert set(steps) == {9}
    assert evenly_chosen(names[:5], 12) == names[:5]


def test_a_picture_is_put_where_it_is_said() -> None:
    canvas = Canvas(60, 40)
    canvas.picture(np.full((10, 20, 3), PHOTO_COLOR, np.uint8), 5, 7)
    sheet = canvas.rgb()
    assert sheet.shape == (40, 60, 3)
    assert (sheet[7:17, 5:25] == PHOTO_COLOR).all()
    assert _area(sheet, PHOTO_COLOR) == 200 and (sheet[0, 0] == 255).all()


def test_pictures_are_fitted_resized_and_names_shortened() -> None:
    assert fitted_size((300, 600), 480) == (240, 480)
    assert fitted_size((600, 300, 3), 480) == (480, 240)
    assert fitted_size((1, 1000), 480) == (1, 480)
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    assert np.array_equal(resized(rgb, 4, 4)[::2, ::2], rgb)
    assert shortened("abc", 3) == "abc" and shortened("abcdef", 4) == "…def"
