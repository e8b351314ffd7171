"""Laws of the strips and the overview: what is in them, looked at pixel by pixel."""

import numpy as np
import pytest

from resdepth_colmap.scene import ColorImage, DepthMap
from resdepth_colmap.viz.colormaps import DepthScale
from resdepth_colmap.viz.strips import BeforeAfter, depth_strip, overview, thumbnails

HOLE = (200, 200, 200)
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


def _colors_of(picture: ColorImage) -> set[tuple[int, ...]]:
    return {tuple(color) for color in np.unique(picture.reshape(-1, 3), axis=0)}


def _area(picture: ColorImage, color: tuple[int, int, int]) -> int:
    return int((picture == color).all(axis=2).sum())


def test_a_strip_shows_the_photo_whole_and_the_holes_where_they_are() -> None:
    strip = depth_strip(_content())
    assert strip.dtype == np.uint8 and strip.ndim == 3
    panel_px = 480 * 360
    assert _area(strip, PHOTO_COLOR) == panel_px
    # Half of the initial depth and of the difference, and two legends.
    assert panel_px <= _area(strip, HOLE) < 1.01 * panel_px


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
    assert _area(depth_strip(content), HOLE) >= 5 * 480 * 320
    assert overview("empty", [thumbnails(content)], 1).size


@pytest.mark.parametrize(
    "name",
    ["$x_{$", "a$b$.png", "\u6771\u4eac/\u5199\u771f.jpg", "%s{}\\n", "x" * 500],
)
def test_any_image_name_can_be_written(name: str) -> None:
    plain = depth_strip(_content(name="a.png"))
    assert depth_strip(_content(name=name)).shape == plain.shape
    assert overview(name, [thumbnails(_content(name=name))], 1).size


def test_maps_of_different_sizes_are_refused_by_name() -> None:
    content = _content()
    with pytest.raises(ValueError, match=r"b\.png"):
        BeforeAfter(
            name="b.png",
            rgb=content.rgb,
            before=content.before[1:],
            after=content.after,
        )


@pytest.mark.parametrize("num_images", [0, 1, 2, 4, 7, 12])
def test_the_overview_shows_every_image_it_is_given(num_images: int) -> None:
    images = [thumbnails(_content(name=f"{i}.png")) for i in range(num_images)]
    picture = overview("room", images, num_images)
    assert _area(picture, PHOTO_COLOR) == num_images * 220 * 165


def test_portrait_and_landscape_images_go_together() -> None:
    contents = [_content(48, 64), _content(64, 48), _content(300, 10)]
    picture = overview("room", [thumbnails(content) for content in contents], 3)
    heights = [165, 280, 280]
    widths = [220, 210, 9]
    shown = sum(h * w for h, w in zip(heights, widths, strict=True))
    assert _area(picture, PHOTO_COLOR) == pytest.approx(shown, rel=0.02)


@pytest.mark.parametrize("num_times", [2, 7, 20])
def test_a_large_map_is_shown_as_its_small_copy_is(num_times: int) -> None:
    small = _content(60, 80)
    block = np.ones((num_times, num_times), np.float32)
    large = BeforeAfter(
        name=small.name,
        rgb=small.rgb,
        before=np.kron(small.before, block),
        after=np.kron(small.after, block),
    )
    first, second = depth_strip(small), depth_strip(large)
    below_px = 66  # the size of the maps is above
    assert np.mean(first[below_px:] == second[below_px:]) > 0.98


def test_beside_a_hole_no_depth_is_made_up() -> None:
    near = np.full((900, 1200), 2.0, np.float32)
    near[:, ::400] = 1.0  # so that the colours have a range
    holes = near.copy()
    holes[:, 601:] = 0
    rgb = np.full((3, 4, 3), PHOTO_COLOR, np.uint8)
    colors = np.hstack([DepthScale.of(near).colored(m) for m in (near, holes)])
    picture = BeforeAfter(name="a", rgb=rgb, before=holes, after=near).pictures(1200)[1]
    assert _colors_of(picture) <= _colors_of(colors)


def test_photo_and_maps_may_differ_in_size() -> None:
    content = _content(48, 64)
    rgb = np.full((480, 640, 3), PHOTO_COLOR, np.uint8)
    pair = BeforeAfter(name="a", rgb=rgb, before=content.before, after=content.after)
    assert {p.shape for p in pair.pictures(220)} == {(165, 220, 3)}
