"""Laws of refining a workspace: what is chosen, written, kept and done again."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from planes import NAMES, NORMAL, OFFSET
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import RefineConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.io.colmap.output import read_record
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import read_cloud
from resdepth_colmap.pipeline.refine.stage import RefineReport, refine_workspace
from resdepth_colmap.progress import Advance


def refine(
    folder: Path, in_place: bool = False, overwrite: bool = False, **options: object
) -> RefineReport:
    """Refine with a network that changes nothing."""
    options.setdefault("weights", identity_weights(folder.parent))
    config = RefineConfig(tile_px=64, overlap_px=16, **options)  # type: ignore[arg-type] # passed on
    return refine_workspace(
        open_workspace(folder), config, in_place=in_place, overwrite=overwrite
    )


def map_path(folder: Path, name: str, kind: str = "geometric") -> Path:
    return folder / "stereo" / "depth_maps" / f"{name}.{kind}.bin"


def with_holes(path: Path, num_rows: int) -> None:
    depth = read_depth_map(path)
    depth[:num_rows] = 0
    write_depth_map(path, depth)


def test_an_identity_network_writes_the_maps_it_read(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    report = refine(folder)
    assert set(report.refined) == set(NAMES)
    for name in NAMES:
        before = read_depth_map(map_path(folder, name))
        after = read_depth_map(map_path(folder / "resdepth", name))
        np.testing.assert_allclose(after, before, rtol=1e-6)


def test_colmap_fuses_the_result_and_the_points_lie_on_the_plane(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path, center_px=0.0)
    refine(folder)
    options = pycolmap.StereoFusionOptions()
    options.min_num_pixels = 3
    cloud_path = tmp_path / "cloud.ply"
    pycolmap.stereo_fusion(
        cloud_path, folder / "resdepth", options=options, output_type="PLY"
    )
    cloud = read_cloud(cloud_path)
    assert len(cloud) > 1000
    np.testing.assert_allclose(cloud.points @ NORMAL, OFFSET, atol=0.01)
    assert (cloud.normals @ NORMAL).min() > 0.99


def test_the_fuller_map_is_taken_and_of_equal_ones_the_geometric(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path, kinds=("geometric", "photometric"))
    with_holes(map_path(folder, NAMES[0]), 10)
    with_holes(map_path(folder, NAMES[1], "photometric"), 10)
    images = refine(folder).images
    assert images[NAMES[0]]["input"] == "photometric"
    assert images[NAMES[1]]["input"] == "geometric"
    assert images[NAMES[2]]["input"] == "geometric"


def test_holes_are_filled_and_counted(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    with_holes(map_path(folder, NAMES[0]), 15)
    record = refine(folder).images[NAMES[0]]
    assert record["filled_before"] == pytest.approx(45 / 60)
    assert record["filled_after"] == 1.0
    assert read_depth_map(map_path(folder / "resdepth", NAMES[0])).min() > 0


def test_an_image_without_the_kind_asked_for_is_skipped_and_said(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path, kinds=("geometric", "photometric"))
    map_path(folder, NAMES[1], "photometric").unlink()
    report = refine(folder, input="photometric")
    reason = "no photometric depth map (there is: geometric)"
    assert report.skipped == ((NAMES[1], reason),)
    assert NAMES[1] not in report.refined


def test_a_map_without_any_depth_is_skipped_and_said(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    with_holes(map_path(folder, NAMES[0]), 60)
    ((name, reason),) = refine(folder).skipped
    assert name == NAMES[0]
    assert "no depth at all" in reason


def test_without_any_map_of_the_kind_the_kinds_there_are_named(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    with pytest.raises(WorkspaceError, match=r"no photometric.*there are: geometric"):
        refine(folder, input="photometric")


def test_without_any_map_the_way_out_is_named(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    with pytest.raises(WorkspaceError, match="--stereo cpu"):
        refine(folder)


def test_maps_may_be_smaller_than_their_image(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for name in NAMES:
        path = map_path(folder, name)
        write_depth_map(path, np.ascontiguousarray(read_depth_map(path)[::2, ::2]))
    assert set(refine(folder).refined) == set(NAMES)
    assert read_depth_map(map_path(folder / "resdepth", NAMES[0])).shape == (30, 40)


@pytest.mark.parametrize("shape", [(60, 40), (120, 160)])
def test_a_map_of_another_image_is_refused(
    tmp_path: Path, shape: tuple[int, int]
) -> None:
    folder = plane_folder(tmp_path)
    write_depth_map(map_path(folder, NAMES[0]), np.ones(shape, np.float32))
    with pytest.raises(WorkspaceError, match=r"0\.png\.geometric\.bin.*another image"):
        refine(folder)


def test_an_explicit_list_of_sources_is_what_is_chosen_from(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    text = f"{NAMES[0]}\n{NAMES[4]}, {NAMES[3]}\n"
    (folder / "stereo/patch-match.cfg").write_text(text, encoding="utf-8")
    images = refine(folder).images
    (source,) = images[NAMES[0]]["sources"]
    assert source["name"] in (NAMES[3], NAMES[4])
    assert source["reason"]
    assert set(images) == set(NAMES)


def test_a_second_run_does_nothing(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    first = refine(folder)
    time_before = map_path(folder / "resdepth", NAMES[0]).stat().st_mtime_ns
    second = refine(folder)
    assert second.refined == ()
    assert set(second.kept) == set(NAMES)
    assert second.images == first.images
    assert map_path(folder / "resdepth", NAMES[0]).stat().st_mtime_ns == time_before


def users_of(name: str, report: RefineReport) -> set[str]:
    """The image itself and those that it is the second view of."""
    return {name} | {
        user
        for user, record in report.images.items()
        if record["sources"][0]["name"] == name
    }


def test_a_changed_map_is_refined_again_and_nothing_else(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder)
    with_holes(map_path(folder, NAMES[0]), 5)
    assert refine(folder).refined == (NAMES[0],)


def test_whoever_looks_at_a_changed_map_is_refined_again_too(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path, source_depth=True)
    images = refine(folder, weights=weights).images
    lookers = {name for name, it in images.items() if NAMES[0] in it["source_maps"]}
    assert lookers and NAMES[0] not in lookers
    with_holes(map_path(folder, NAMES[0]), 5)
    again = refine(folder, weights=weights)
    assert set(again.refined) == {NAMES[0]} | lookers


def test_a_lost_result_is_made_again_and_nothing_else(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder)
    map_path(folder / "resdepth", NAMES[2]).unlink()
    assert refine(folder).refined == (NAMES[2],)


def test_a_changed_source_image_means_again(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    users = users_of(NAMES[0], refine(folder))
    image = folder / "images" / NAMES[0]
    status = image.stat()
    os.utime(image, (status.st_atime, status.st_mtime + 5))
    assert refine(folder).refined == ()  # what is in it counts, not its date
    image.write_bytes(image.read_bytes() + b"\0")
    os.utime(image, (status.st_atime, status.st_mtime))
    assert set(refine(folder).refined) == users


def test_other_options_or_weights_mean_again(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    refine(folder)
    assert len(refine(folder, inner_iterations=2).refined) == len(NAMES)
    assert len(refine(folder, inner_iterations=2).refined) == 0
    assert len(refine(folder, inner_iterations=2, update_gating=False).refined) == len(
        NAMES
    )
    other = identity_weights(tmp_path, seed=1)
    assert len(refine(folder, inner_iterations=2, weights=other).refined) == len(NAMES)
    again = refine(folder, inner_iterations=2, weights=other, overwrite=True)
    assert len(again.refined) == len(NAMES)


class Interruption:
    """Presses Ctrl-C after some images."""

    def __init__(self, after: int) -> None:
        self.after = after

    @contextlib.contextmanager
    def stage(self, title: str, total: int) -> Iterator[Advance]:
        def advance(units: float) -> None:
            self.after -= 1
            if self.after == 0:
                raise KeyboardInterrupt

        yield advance


def test_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    weights = identity_weights(tmp_path)
    config = RefineConfig(tile_px=64, overlap_px=16, weights=weights)
    with pytest.raises(KeyboardInterrupt):
        refine_workspace(open_workspace(folder), config, progress=Interruption(after=2))
    record = read_record(folder / "resdepth/run.json")
    assert len(record["images"]) == 2
    assert not list(folder.rglob(".partial-*"))
    second = refine(folder, weights=weights)
    assert len(second.kept) == 2
    assert len(second.refined) == len(NAMES) - 2


def test_in_place_keeps_the_originals_and_starts_from_them(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    with_holes(map_path(folder, NAMES[0]), 15)
    original = map_path(folder, NAMES[0]).read_bytes()
    first = refine(folder, in_place=True)
    assert map_path(folder, NAMES[0]).read_bytes() != original
    kept = map_path(folder, NAMES[0]).with_name(
        f"{Path(NAMES[0]).name}.geometric.bin.original"
    )
    assert kept.read_bytes() == original
    assert len(refine(folder, in_place=True).kept) == len(NAMES)
    again = refine(folder, in_place=True, overwrite=True)
    for name in NAMES:
        del first.images[name]["seconds"], again.images[name]["seconds"]
    assert again.images == first.images
    assert kept.read_bytes() == original


def test_a_single_image_is_refused_with_the_reason(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    model = pycolmap.Reconstruction(folder / "sparse")
    for index in sorted(model.reg_image_ids())[1:]:
        model.deregister_frame(model.images[index].frame_id)
    model.write(folder / "sparse")
    with pytest.raises(WorkspaceError, match="single image"):
        refine(folder)
