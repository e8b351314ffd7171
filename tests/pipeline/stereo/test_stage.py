"""Laws of the stage "stereo": who matches, what is kept, how it goes on."""

import json
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from click.testing import CliRunner
from fake_matcher import DEPTH, FakeMatcher, installed
from planes import NAMES
from workspaces import identity_weights, opened, plane_folder

from resdepth_colmap.cli.main import main
from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.pipeline.stereo import passes as stereo_passes
from resdepth_colmap.pipeline.stereo import stage as stereo_stage
from resdepth_colmap.pipeline.stereo.stage import (
    StereoReport,
    choose_backend,
    stereo_workspace,
)
from resdepth_colmap.progress import Advance, SilentProgress

CPU = StereoBackend.CPU
KINDS = ("photometric", "geometric")


@pytest.fixture(autouse=True)
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    return installed(monkeypatch)


def match(folder: Path, *, overwrite: bool = False, **options: object) -> StereoReport:
    config = StereoConfig(**options)  # type: ignore[arg-type] # passed on
    return stereo_workspace(*opened(folder), config, CPU, overwrite=overwrite)


def depth_path(folder: Path, name: str, kind: str) -> Path:
    return folder / "stereo/depth_maps" / f"{name}.{kind}.bin"


def times(folder: Path) -> dict[str, int]:
    """When each map was written."""
    paths = (folder / "stereo").rglob("*.bin")
    return {str(path.relative_to(folder)): path.stat().st_mtime_ns for path in paths}


def test_each_view_gets_whole_photometric_and_filtered_geometric_maps(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    assert set(match(folder).matched) == set(NAMES)
    for name in NAMES:
        assert (read_depth_map(depth_path(folder, name, "photometric")) == DEPTH).all()
        geometric = read_depth_map(depth_path(folder, name, "geometric"))
        assert set(np.unique(geometric)) == {0, np.float32(DEPTH)}
        for kind in KINDS:
            path = folder / "stereo/normal_maps" / f"{name}.{kind}.bin"
            assert path.is_file()
    before = times(folder)
    assert set(match(folder).kept) == set(NAMES)
    assert times(folder) == before


def test_the_second_pass_starts_from_the_first_and_sees_the_sources_depth(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    match(plane_folder(tmp_path, kinds=()))
    first, second = matcher.calls[: len(NAMES)], matcher.calls[len(NAMES) :]
    assert all(call.start is None and call.source_depths is None for call in first)
    assert len(second) == len(NAMES)
    for call in second:
        assert call.start is not None
        assert (call.start.depth == DEPTH).all()
        assert (call.start.normals == (0, 0, -1)).all()
        assert call.source_depths is not None
        shapes = [depth.shape for depth in call.source_depths]
        assert shapes == [source.gray.shape for source in call.sources]
        assert all((depth == DEPTH).all() for depth in call.source_depths)


def test_without_a_filter_every_pixel_keeps_its_depth(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, filter=False)
    for name in NAMES:
        assert read_depth_map(depth_path(folder, name, "geometric")).all()


def test_without_geometric_consistency_the_photometric_maps_are_filtered(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, geom_consistency=False, filter_min_triangulation_angle=90.0)
    for name in NAMES:
        assert not depth_path(folder, name, "geometric").exists()
        assert not read_depth_map(depth_path(folder, name, "photometric")).any()


def test_maps_of_others_are_never_replaced_but_used(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric",))
    before = times(folder)
    assert set(match(folder).matched) == set(NAMES)
    assert len(matcher.calls) == len(NAMES)
    assert all(call.start is not None for call in matcher.calls)
    assert times(folder).items() > before.items()
    other = plane_folder(tmp_path / "other", kinds=KINDS)
    before = times(other)
    assert match(other).matched == ()
    assert match(other, window_radius=3).matched == ()
    assert times(other) == before
    assert set(match(other, overwrite=True).matched) == set(NAMES)


def test_a_photometric_map_with_holes_and_without_normals_is_a_start_too(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric",))
    path = depth_path(folder, NAMES[0], "photometric")
    depth = read_depth_map(path)
    depth[10:20, 10:20] = 0
    depth[0, 0] = 1e6  # as far as COLMAP's may be
    write_depth_map(path, depth)
    (folder / "stereo/normal_maps" / f"{NAMES[0]}.photometric.bin").unlink()
    match(folder)
    near, far = matcher.calls[0].depth_range
    start = matcher.calls[0].start
    assert start is not None
    assert start.depth.min() >= near * 0.999
    assert start.depth.max() <= far * 1.001
    assert np.allclose(np.linalg.norm(start.normals, axis=2), 1, atol=1e-4)


def test_our_own_maps_are_made_anew_with_other_options(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder)
    assert set(match(folder, window_radius=3).matched) == set(NAMES)


def test_another_filter_does_the_second_pass_only(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder)
    matcher.calls.clear()
    assert set(match(folder, filter_min_ncc=0.5).matched) == set(NAMES)
    assert all(call.start is not None for call in matcher.calls)
    matcher.calls.clear()
    assert match(folder, filter_min_ncc=0.5, cache_size=1.0).matched == ()


def test_our_own_maps_are_made_anew_by_a_matcher_that_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder)
    monkeypatch.setattr(stereo_passes, "METHOD", -1)
    assert set(match(folder).matched) == set(NAMES)


def test_a_changed_image_is_matched_again_with_all_that_look_at_it(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    pairs = f"{NAMES[0]}\n{NAMES[1]}\n{NAMES[1]}\n{NAMES[2]}\n{NAMES[2]}\n{NAMES[3]}\n"
    text = pairs + f"{NAMES[3]}\n{NAMES[4]}\n{NAMES[4]}\n{NAMES[3]}\n"
    (folder / "stereo/patch-match.cfg").write_text(text, encoding="utf-8")
    match(folder)
    image = folder / "images" / NAMES[2]
    image.write_bytes(image.read_bytes() + b"\0")
    matcher.calls.clear()
    # The photometric maps of 1 and 2 change, so the geometric ones of 0, 1 and 2 do.
    assert set(match(folder).matched) == set(NAMES[:3])
    assert len(matcher.calls) == 5


def test_images_are_matched_at_the_size_asked_for(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    match(folder, max_image_size=40)
    for kind in KINDS:
        assert read_depth_map(depth_path(folder, NAMES[0], kind)).shape == (30, 40)


@pytest.mark.parametrize("num_written", [2, 7])
def test_an_interrupted_matching_goes_on_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, num_written: int
) -> None:
    folder = plane_folder(tmp_path, kinds=())
    written: list[Path] = []

    def write(
        path: Path, depth: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
    ) -> None:
        if len(written) == num_written:
            raise KeyboardInterrupt
        written.append(path)
        write_depth_map(path, depth)

    with monkeypatch.context() as patch:
        patch.setattr(stereo_stage, "write_depth_map", write)
        with pytest.raises(KeyboardInterrupt):
            match(folder)
    assert choose_backend(StereoBackend.AUTO, *opened(folder)) is CPU
    before = times(folder)
    again = stereo_workspace(*opened(folder), StereoConfig())
    num_finished = max(0, num_written - len(NAMES))
    assert len(again.kept) == num_finished
    assert len(again.matched) == len(NAMES) - num_finished  # the half-written one, too
    for path in written:
        key = str(path.relative_to(folder))
        assert times(folder)[key] == before[key]
    backend = choose_backend(StereoBackend.AUTO, *opened(folder))
    assert backend is StereoBackend.EXISTING


def test_ctrl_c_between_two_sweeps_leaves_nothing_half_written(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())

    class Impatient(SilentProgress):
        """Interrupts in the third view's fourth sweep."""

        def __init__(self) -> None:
            self.done = 0.0

        def stage(self, title: str, total: int) -> AbstractContextManager[Advance]:
            assert total == 3 * len(NAMES)  # both passes: the time left is that of all

            def advance(units: float) -> None:
                self.done += units
                if self.done > 5.2:
                    raise KeyboardInterrupt

            return nullcontext(advance)

    with pytest.raises(KeyboardInterrupt):
        stereo_workspace(*opened(folder), StereoConfig(), CPU, progress=Impatient())
    maps = list((folder / "stereo/depth_maps").rglob("*.*"))
    assert len([path for path in maps if path.is_file()]) == 2
    assert not list(folder.rglob(".partial*"))
    again = match(folder)
    assert set(again.matched) == set(NAMES)


def test_maps_that_are_there_win(tmp_path: Path) -> None:
    auto = StereoBackend.AUTO
    folder = plane_folder(tmp_path)
    assert choose_backend(auto, *opened(folder)) is StereoBackend.EXISTING
    bare = plane_folder(tmp_path / "bare", kinds=())
    expected = StereoBackend.COLMAP if pycolmap.has_cuda else CPU
    assert choose_backend(auto, *opened(bare)) is expected
    with pytest.raises(WorkspaceError, match="--stereo cpu"):
        choose_backend(StereoBackend.EXISTING, *opened(bare))


def test_refine_matches_in_both_passes_without_the_filter(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    words = ["refine", str(folder), "--stereo", "cpu", "--no-fuse", "--no-pictures"]
    weights = str(identity_weights(tmp_path))
    result = CliRunner().invoke(main, [*words, "--weights", weights])
    assert result.exit_code == 0, result.output
    record = json.loads((folder / "resdepth/run.json").read_text(encoding="utf-8"))
    assert record["options"]["stereo"]["filter"] is False
    images = record["images"].values()
    assert {(i["input"], i["filled_before"]) for i in images} == {("geometric", 1.0)}
