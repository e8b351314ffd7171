"""Laws of the masks in all stages: where a mask is 0, no file says anything."""

import dataclasses
import json
import logging
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.cli.main import main
from resdepth_colmap.config import MaskConfig, RefineConfig, StereoBackend, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.maps import (
    read_depth_map,
    read_planes,
    write_depth_map,
    write_planes,
)
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.model import read_scene
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.io.point_cloud import read_cloud
from resdepth_colmap.pipeline.masks import masked_depth, with_masks
from resdepth_colmap.pipeline.refine.stage import RefineReport, refine_workspace
from resdepth_colmap.pipeline.stereo.stage import stereo_workspace

RED = (255, 0, 0)

Flags = npt.NDArray[np.bool_]


def wanted(width_px: int = 80, height_px: int = 60) -> Flags:
    """All but the left quarter and a square inside."""
    flags = np.ones((height_px, width_px), np.bool_)
    flags[:, : width_px // 4] = False
    flags[height_px // 3 : height_px // 2, width_px // 2 : 3 * width_px // 4] = False
    return flags


def write_masks(folder: Path, *, by_stem: bool = False, scale: int = 1) -> Path:
    """Masks of all images, with that many times the pixels on a side."""
    for name in NAMES:
        path = folder / (
            f"{Path(name).with_suffix('')}.png" if by_stem else f"{name}.png"
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        values = np.where(wanted(80 * scale, 60 * scale), 255, 0).astype(np.uint8)
        Image.fromarray(values).save(path)
    return folder


def paint(folder: Path, color: tuple[int, int, int] = RED) -> None:
    """Give what is masked in the images a colour."""
    for name in NAMES:
        path = folder / "images" / name
        image = np.array(Image.open(path))
        image[~wanted()] = color
        Image.fromarray(image).save(path)


def refine(
    folder: Path, masks: MaskConfig | None = None, **options: object
) -> RefineReport:
    source_depth = bool(options.pop("source_depth", False))
    weights = identity_weights(folder.parent, source_depth=source_depth)
    options = {"weights": weights, "tile_px": 64, "overlap_px": 16, **options}
    config = RefineConfig(**options)  # type: ignore[arg-type] # passed on
    return refine_workspace(open_workspace(folder), config, masks=masks)


def maps_of(folder: Path, name: str) -> dict[str, npt.NDArray[np.float32]]:
    """The refined maps of an image as they lie in the files, shape (C, H, W)."""
    stereo = folder / "resdepth/stereo"
    return {
        kind: read_planes(stereo / kind / f"{name}.geometric.bin", num_channels=number)
        for kind, number in (
            ("depth_maps", 1),
            ("normal_maps", 3),
            ("confidence_maps", 1),
        )
    }


def assert_masked(folder: Path, flags: Flags) -> None:
    for name in NAMES:
        maps = maps_of(folder, name)
        for planes in maps.values():
            assert not planes[:, ~flags].any()
        assert (maps["depth_maps"][0] > 0)[flags].all()
        assert np.abs(maps["normal_maps"]).max(0)[flags].min() > 0


def run(*arguments: object, exit_code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert result.exit_code == exit_code, result.output
    return result


@pytest.mark.parametrize("source_depth", [False, True])
@pytest.mark.parametrize(("by_stem", "scale"), [(False, 1), (True, 1), (False, 3)])
def test_where_the_mask_is_black_all_maps_are_blank_and_else_full(
    tmp_path: Path, by_stem: bool, scale: int, source_depth: bool
) -> None:
    folder = plane_folder(tmp_path)
    masks = write_masks(tmp_path / "m", by_stem=by_stem, scale=scale)
    record = refine(
        folder, MaskConfig(mask_path=masks), source_depth=source_depth
    ).images[NAMES[0]]
    assert_masked(folder, wanted())
    share = pytest.approx(wanted().mean(), abs=1e-6)
    assert record["filled_before"] == record["filled_after"] == share


def test_masks_follow_smaller_maps(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for path in (folder / "stereo/depth_maps").rglob("*.bin"):
        depth = read_depth_map(path)
        write_depth_map(path, np.ascontiguousarray(depth[::2, ::2]))
    refine(folder, MaskConfig(mask_path=write_masks(tmp_path / "m")))
    assert_masked(folder, wanted(40, 30))


def test_what_lies_under_the_masks_changes_nothing(tmp_path: Path) -> None:
    """Photographs and depth maps, of the view and of those that it is compared with."""
    results = []
    for place, color in enumerate((RED, (10, 200, 90))):
        folder = plane_folder(tmp_path / str(place))
        paint(folder, color)
        for path in (folder / "stereo/depth_maps").rglob("*.bin"):
            depth = read_depth_map(path)
            write_depth_map(path, np.where(wanted(), depth, np.float32(1 + place)))
        masks = MaskConfig(mask_path=write_masks(tmp_path / "m"))
        refine(folder, masks, source_depth=True, outer_iterations=2)
        results.append([maps_of(folder, name) for name in NAMES])
    for one, other in zip(*results, strict=True):
        for kind, planes in one.items():
            np.testing.assert_allclose(planes, other[kind], rtol=1e-4, atol=1e-5)


def test_a_masked_map_without_holes_counts_as_unfiltered(tmp_path: Path) -> None:
    """What a mask leaves out says nothing of a filter."""
    folder = plane_folder(tmp_path)
    masks = MaskConfig(mask_path=write_masks(tmp_path / "m"))
    refine(folder, masks, source_depth=True)
    full = [maps_of(folder, name)["depth_maps"] for name in NAMES]
    for path in (folder / "stereo/depth_maps").rglob("*.bin"):
        write_depth_map(path, np.where(wanted(), read_depth_map(path), np.float32(0)))
    refine(folder, masks, source_depth=True)
    for depth, name in zip(full, NAMES, strict=True):
        np.testing.assert_allclose(maps_of(folder, name)["depth_maps"], depth, 1e-5)


def test_a_folder_beside_the_images_is_found_and_can_be_left_out(
    tmp_path: Path,
) -> None:
    folder = plane_folder(tmp_path)
    write_masks(folder / "masks")
    assert set(refine(folder).refined) == set(NAMES)
    assert_masked(folder, wanted())
    assert f"{folder / 'masks'} (5 of 5 images)" in run("info", folder).stdout
    facts = json.loads(run("info", folder, "--json").stdout)
    assert (facts["masks"], facts["num_masked"]) == (str(folder / "masks"), 5)
    assert set(refine(folder, MaskConfig(use_masks=False)).refined) == set(NAMES)
    assert_masked(folder, np.ones((60, 80), np.bool_))
    facts = json.loads(run("info", folder, "--no-masks", "--json").stdout)
    assert (facts["masks"], facts["num_masked"]) == ("", 0)


def test_an_alpha_channel_is_a_mask_on_request(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for name in NAMES:
        image = Image.open(folder / "images" / name).convert("RGB")
        image.putalpha(Image.fromarray((wanted() * 255).astype(np.uint8)))
        image.save(folder / "images" / name)
    refine(folder)
    assert_masked(folder, np.ones((60, 80), np.bool_))
    refine(folder, MaskConfig(alpha_masks=True))
    assert_masked(folder, wanted())


def test_an_image_that_is_wholly_masked_gets_blank_maps(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    masks = write_masks(folder / "masks")
    Image.fromarray(np.zeros((60, 80), np.uint8)).save(masks / f"{NAMES[3]}.png")
    run("refine", folder, "--weights", identity_weights(tmp_path, source_depth=True))
    assert not any(planes.any() for planes in maps_of(folder, NAMES[3]).values())
    assert maps_of(folder, NAMES[4])["depth_maps"].any()


def test_images_without_a_mask_are_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = plane_folder(tmp_path)
    masks = write_masks(tmp_path / "m")
    for name in NAMES[1:]:
        (masks / f"{name}.png").unlink()
    with caplog.at_level(logging.WARNING, logger="resdepth_colmap"):
        refine(folder, MaskConfig(mask_path=masks))
    said = [record.getMessage() for record in caplog.records]
    (line,) = [it for it in said if "no mask" in it]
    assert line.startswith("4 images have no mask")
    assert ", ".join(NAMES[1:4]) + " and 1 more" in line
    assert maps_of(folder, NAMES[1])["depth_maps"].all()
    weights = identity_weights(tmp_path)
    options = ("--mask-path", masks, "--weights", weights, "--overwrite")
    assert run("refine", folder, *options).stderr.count("no mask") == 1


def test_a_changed_mask_means_again_for_whoever_looks_at_it(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    masks = write_masks(folder / "masks")
    images = refine(folder, source_depth=True).images
    assert refine(folder, source_depth=True).refined == ()
    Image.fromarray(np.full((60, 80), 255, np.uint8)).save(masks / f"{NAMES[0]}.png")
    users = {
        name
        for name, it in images.items()
        if NAMES[0]
        in (name, *it["source_maps"], *(source["name"] for source in it["sources"]))
    }
    again = refine(folder, source_depth=True, outer_iterations=3).refined
    assert users <= set(again)
    assert maps_of(folder, NAMES[0])["depth_maps"].all()


def test_later_commands_leave_out_what_the_run_has_left_out(tmp_path: Path) -> None:
    folder, masks = plane_folder(tmp_path), write_masks(tmp_path / "m")
    paint(folder)
    weights = identity_weights(tmp_path)
    run("refine", folder, "--weights", weights, "--mask-path", masks, "--no-pictures")
    record = json.loads((folder / "resdepth/run.json").read_text())
    assert record["masks"] == {"folder": masks.as_posix(), "alpha": False}
    run("export", folder, "--maps", "geometric", "--output", tmp_path / "out")
    for name in NAMES:
        assert np.array_equal(np.load(tmp_path / f"out/{name}.npy") > 0, wanted())
    run("fuse", folder, "--min-num-views", 1, "--output", tmp_path / "cloud.ply")
    cloud = read_cloud(tmp_path / "cloud.ply")
    assert len(cloud) > 1000
    assert not (cloud.colors == RED).all(axis=1).any()
    run("report", folder)
    run("compare", folder)
    result = run("refine", folder, "--weights", weights, "--no-pictures", "--no-report")
    assert "kept            5 images" in result.stdout  # once masked, always so
    run(
        "export",
        folder,
        "--maps",
        "geometric",
        "--no-masks",
        "--output",
        tmp_path / "o",
    )
    assert np.load(tmp_path / f"o/{NAMES[0]}.npy").all()


def test_what_a_run_did_not_mask_is_masked_by_a_later_command(tmp_path: Path) -> None:
    folder, masks = plane_folder(tmp_path), write_masks(tmp_path / "m", by_stem=True)
    paint(folder)
    run("refine", folder, "--weights", identity_weights(tmp_path), "--no-pictures")
    for fuser in ("open3d", "colmap"):
        for options in ([], ["--mask-path", masks]):
            path = tmp_path / f"{fuser}.ply"
            run("fuse", folder, "--fuser", fuser, "--output", path, *options)
            cloud = read_cloud(path)
            assert len(cloud) > 500
            assert (cloud.colors == RED).all(axis=1).any() == (not options)
    output = ("--output", tmp_path / "out")
    run("export", folder, "--mask-path", masks, "--format", "png16", *output)
    with Image.open(tmp_path / f"out/{NAMES[2]}.png") as exported:
        assert np.array_equal(np.asarray(exported) > 0, wanted())
    run("report", folder, "--mask-path", masks)


def test_a_run_that_leaves_masks_out_is_taken_at_its_word(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    write_masks(folder / "masks")
    weights = identity_weights(tmp_path)
    quick = ("--no-fuse", "--no-pictures", "--no-report")
    run("refine", folder, "--weights", weights, "--no-masks", *quick)
    run("export", folder, "--output", tmp_path / "out")
    assert np.load(tmp_path / f"out/{NAMES[0]}.npy").all()
    run("refine", folder, "--weights", weights, *quick)
    assert_masked(folder, wanted())


def test_the_refinement_does_not_fill_what_stereo_has_masked(tmp_path: Path) -> None:
    folder, masks = plane_folder(tmp_path, kinds=()), write_masks(tmp_path / "m")
    workspace = open_workspace(folder)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    config = StereoConfig(
        num_iterations=1, window_radius=2, filter=False, geom_consistency=False
    )
    masked = with_masks(workspace, scene, MaskConfig(mask_path=masks))
    stereo_workspace(masked, scene, config, StereoBackend.CPU)
    refine(folder)
    assert_masked(folder, wanted())
    # Maps that were made with masks are made again without, and the other way round.
    assert stereo_workspace(masked, scene, config).matched == ()
    assert set(stereo_workspace(workspace, scene, config).matched) == set(NAMES)
    assert stereo_workspace(masked, scene, config).matched == ()


def test_empty_pixels_of_a_map_are_kept_on_request(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    for name, value in zip(NAMES, (-1.0, np.nan, 0.0, -np.inf, np.inf), strict=True):
        path = folder / f"stereo/depth_maps/{name}.geometric.bin"
        planes = np.array(read_planes(path, num_channels=1))
        planes[:, ~wanted()] = value
        write_planes(path, planes)
    refine(folder, source_depth=True)
    assert_masked(folder, np.ones((60, 80), np.bool_))
    assert set(refine(folder, source_depth=True, keep_empty=True).refined) == set(NAMES)
    assert_masked(folder, wanted())


def one_line(folder: Path, *arguments: object) -> str:
    result = run("refine", folder, *arguments, exit_code=1)
    (line,) = [line for line in result.stderr.splitlines() if line.strip()]
    assert line.startswith("Error: ")
    assert not (folder / "resdepth").exists()
    return line


def test_masks_that_do_not_fit_are_one_line_and_nothing_is_written(
    tmp_path: Path,
) -> None:
    folder, masks = plane_folder(tmp_path), tmp_path / "m"
    there = sorted(folder.rglob("*"))
    line = one_line(folder, "--mask-path", masks)
    assert f"{masks}: no such folder of masks" in line
    masks.mkdir()
    Image.fromarray(np.zeros((60, 80), np.uint8)).save(masks / "other.png")
    line = one_line(folder, "--mask-path", masks)
    assert f"{masks}: no mask of any of the 5 images" in line
    assert "3.png.png" in line
    Image.fromarray(np.zeros((60, 60), np.uint8)).save(masks / "3.png.png")
    line = one_line(folder, "--mask-path", masks)
    assert f"{masks / '3.png.png'}: the mask has 60 x 60 pixels" in line
    assert "80 x 60" in line
    line = one_line(folder, "--alpha-masks")
    assert "none of the 5 images has an alpha channel" in line
    line = one_line(folder, "--mask-path", masks, "--no-masks")
    assert "masks=False" in line
    assert sorted(folder.rglob("*")) == there
    masks.rename(folder / "masks")
    assert "--no-masks" in one_line(folder)
    assert "the mask has 60 x 60 pixels" in run("info", folder).stdout


def test_a_folder_of_the_run_before_that_is_gone_is_an_error(tmp_path: Path) -> None:
    folder, masks = plane_folder(tmp_path), write_masks(tmp_path / "m")
    weights = identity_weights(tmp_path)
    quick = ("--no-fuse", "--no-pictures", "--no-report", "--weights", weights)
    run("refine", folder, "--mask-path", masks, *quick)
    masks.rename(tmp_path / "elsewhere")
    line = run("refine", folder, *quick, exit_code=1).stderr
    assert "no such folder of masks" in line
    assert "--no-masks" in line
    run("refine", folder, "--mask-path", tmp_path / "elsewhere", *quick)
    assert_masked(folder, wanted())


@pytest.mark.parametrize("size_px", [(40, 30), (80, 60), (160, 120), (240, 180)])
def test_a_mask_is_resized_to_the_map_by_its_nearest_pixels(
    tmp_path: Path, size_px: tuple[int, int]
) -> None:
    write_masks(tmp_path)
    width_px, height_px = size_px
    depth = np.full((height_px, width_px), 2.0, np.float32)
    masks = Masks(folder=tmp_path)
    masked = masked_depth(masks, NAMES[0], depth)
    assert masked.dtype == np.float32
    assert np.array_equal(masked > 0, wanted(width_px, height_px))
    assert masked_depth(masks, "without.png", depth) is depth
    with pytest.raises(WorkspaceError, match=r"80 x 60 .* 60 x 80"):
        masked_depth(masks, NAMES[0], np.ones((80, 60), np.float32))


def test_a_moved_workspace_takes_its_masks_along(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    masks = write_masks(folder / "extra")
    quick = ("--no-fuse", "--no-pictures", "--no-report")
    weights = identity_weights(tmp_path)
    run("refine", folder, "--mask-path", masks, "--weights", weights, *quick)
    moved = folder.rename(tmp_path / "moved")
    workspace = open_workspace(moved)
    scene = read_scene(workspace.sparse_path, workspace.images_path, workspace.path)
    found = with_masks(workspace, scene, MaskConfig()).masks
    assert found == dataclasses.replace(Masks(), folder=moved / "extra")
