"""Laws of what is drawn: which images, from which maps, to which files."""

from pathlib import Path

import numpy as np
import pytest
from planes import NAMES, write_plane_workspace

from resdepth_colmap.io.colmap.maps import write_depth_map
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.images import read_rgb
from resdepth_colmap.pipeline import pictures
from resdepth_colmap.pipeline.pictures import draw_workspace, evenly_chosen
from resdepth_colmap.pipeline.refine.stage import RefineReport
from resdepth_colmap.progress import SilentProgress
from resdepth_colmap.scene import ColorImage
from resdepth_colmap.viz.strips import BeforeAfter


@pytest.fixture
def output(tmp_path: Path) -> OutputWorkspace:
    """A workspace whose maps are refined, each to a constant depth."""
    for plane in write_plane_workspace(tmp_path / "room"):
        path = OutputWorkspace(source=open_workspace(tmp_path / "room"))
        depth = np.full(plane.depth.shape, 3, np.float32)
        write_depth_map(path.depth_map_path(plane.view.name), depth)
    return OutputWorkspace(source=open_workspace(tmp_path / "room"))


def draw(output: OutputWorkspace, refined: tuple[str, ...] = NAMES) -> Path:
    source = output.source
    report = RefineReport(
        output=output,
        refined=refined,
        kept=tuple(name for name in NAMES if name not in refined),
        skipped=(),
        images={name: {"input": "geometric"} for name in NAMES},
        facts={},
    )
    scene = read_scene(source.sparse_path, source.images_path, source.path)
    return draw_workspace(output, scene, report, SilentProgress())


def strip_path(output: OutputWorkspace, name: str) -> Path:
    return output.path / "pictures" / f"{name}.png"


def test_each_image_has_a_strip_beside_the_overview(output: OutputWorkspace) -> None:
    assert draw(output) == output.path / "overview.png"
    for path in (output.path / "overview.png", *(strip_path(output, n) for n in NAMES)):
        assert read_rgb(path).shape[2] == 3


def test_what_was_kept_is_not_drawn_again(output: OutputWorkspace) -> None:
    draw(output)
    for name in NAMES:
        strip_path(output, name).write_bytes(b"old")
    strip_path(output, NAMES[1]).unlink()
    draw(output, refined=NAMES[:1])
    old = [strip_path(output, name).read_bytes() == b"old" for name in NAMES]
    assert old == [False, False, True, True, True]


def test_each_image_is_loaded_once(
    output: OutputWorkspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = []

    def counted(path: Path) -> ColorImage:
        paths.append(path)
        return read_rgb(path)

    monkeypatch.setattr(pictures, "read_rgb", counted)
    draw(output)
    assert len(paths) == len(set(paths)) == len(NAMES)


def test_a_true_depth_of_another_size_is_that_of_the_nearest_pixel(
    output: OutputWorkspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    contents = []

    def strip(content: BeforeAfter) -> ColorImage:
        contents.append(content)
        return content.rgb

    monkeypatch.setattr(pictures, "depth_strip", strip)
    rows, columns = np.mgrid[1:101, 1:134]  # 5/3 of the maps' 60 x 80
    truth = (rows + 1000 * columns).astype(np.float32)
    write_depth_map(output.source.truth_path(NAMES[0]), truth)
    draw(output, refined=NAMES[:1])
    shown = contents[0].truth
    height, width = contents[0].before.shape
    # The pixel whose centre is nearest to that of the map's pixel.
    row = np.floor((np.arange(height) + 0.5) * 100 / height).astype(int)
    column = np.floor((np.arange(width) + 0.5) * 133 / width).astype(int)
    np.testing.assert_array_equal(shown, truth[np.ix_(row, column)])


def test_chosen_images_are_spread_evenly_and_hold_both_ends() -> None:
    names = [str(number) for number in range(100)]
    chosen = evenly_chosen(names, 12)
    steps = np.diff([int(name) for name in chosen])
    assert len(chosen) == 12 and (chosen[0], chosen[-1]) == ("0", "99")
    assert set(steps) == {9}
    assert evenly_chosen(names[:5], 12) == names[:5]
