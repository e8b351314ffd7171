"""The command `evaluate eth3d`, whole, on a rendered scene in ETH3D's formats."""

import functools
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pycolmap
import pytest
from click.testing import CliRunner, Result
from eth3d_scene import IMAGES, RenderedEth3d, copied, write_eth3d_scene
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from workspaces import identity_weights

from resdepth_colmap.cli.main import main
from resdepth_colmap.config import StereoBackend, StereoConfig
from resdepth_colmap.evaluation.datasets.eth3d import Eth3dOptions, eth3d_sources
from resdepth_colmap.evaluation.datasets.sample import SampleOptions
from resdepth_colmap.evaluation.depth.match_cache import MatchCache, Matching
from resdepth_colmap.evaluation.depth.sample_matching import cache_name

WIDTH_PX = 120
FAST = ("--num-iterations", "3", "--window-radius", "3")
STEREO = StereoConfig(num_iterations=3, window_radius=3)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> RenderedEth3d:
    return write_eth3d_scene(tmp_path_factory.mktemp("eth3d") / "ETH3D" / "office")


def evaluate(tmp_path: Path, root: Path, *arguments: object) -> Result:
    options = ("--image-width", WIDTH_PX, "--stereo", "cpu", *FAST)
    identity = ("--weights", identity_weights(tmp_path))
    words = ["evaluate", "eth3d", root, *identity, *options, *arguments]
    return CliRunner().invoke(
        main, [str(word) for word in words], prog_name="resdepth-colmap"
    )


def measured(result: Result) -> dict:  # type: ignore[type-arg] # JSON
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    return found


def fill_cache(folder: Path, rendered: RenderedEth3d) -> None:
    """As if a matcher had found the exact depth of every pair."""
    options = Eth3dOptions(image_width_px=WIDTH_PX)
    wanted = SampleOptions(stereo=STEREO, num_sources=1)
    camera = rendered.camera(WIDTH_PX)
    (source,) = eth3d_sources(rendered.path.parent, options)
    for load in source.read(wanted):
        sample = load()
        index = IMAGES.index(sample.name.split()[0])
        name = cache_name(source.name, sample.name, StereoBackend.CPU)
        views = (sample.reference, *sample.sources)
        match = functools.partial(
            Matching, depth=rendered.depth(index, camera), cpu_s=1.0
        )
        MatchCache(folder=folder).get(name, views, sample.depth_range, STEREO, match)


def test_depth_that_is_right_scores_nothing_but_the_pixel_grid(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    fill_cache(tmp_path / "cache", rendered)
    result = evaluate(
        tmp_path, rendered.path.parent, "--cache", tmp_path / "cache", "--json"
    )
    assert result.exit_code == 0, result.output
    scene = measured(result)["scenes"]["office"]
    exact = rendered.depth(0, rendered.camera(WIDTH_PX))
    reach = maximum_filter(exact, 3) - minimum_filter(exact, 3)
    for method in ("unfiltered", "refined"):
        assert scene[method]["mae"] < 0.25 * reach.mean()
        assert scene[method]["medae"] < 0.25 * np.median(reach)
        assert scene[method]["medae"] < 0.004  # of about 4 m
        assert scene["flat"][method]["bad_1"] < 0.01
        assert scene[method]["num_missing"] == scene[method]["num_discarded"] == 0
    pixels = scene["unfiltered"]["num_pixels"]
    assert pixels == sum(scene[r]["refined"]["num_pixels"] for r in ("edges", "flat"))
    assert pixels > 0.8 * 120 * 80 * scene["num_views"]


def test_the_whole_road_ends_in_the_papers_table(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    cache, output = tmp_path / "cache", tmp_path / "eth3d.json"
    result = evaluate(
        tmp_path, rendered.path.parent, "--cache", cache, "--output", output
    )
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert "Unfiltered depth: our PatchMatch (CPU)." in lines
    assert "Images 120 px wide, pairs chosen by rule" in lines[0]
    (office,) = [it for it in lines if it.startswith("| office | ") and "1.21" in it]
    assert office.endswith("| 3 | 0.13 | 0.22 | 0.55 | 1.21 |")
    (pipes,) = [it for it in lines if it.startswith("| pipes ")]
    assert pipes.startswith("| pipes | - | - | - | - | - | 3 | 0.19 |")
    (overall,) = [it for it in lines if it.startswith("| **overall** ")]
    assert overall.endswith("| 26 | 0.15 | 0.57 | 0.35 | 1.13 |")
    found = json.loads(output.read_text())
    assert found["protocol"] == {"image_width_px": 120, "pairs": "chosen by rule"}
    scene = found["scenes"]["office"]
    assert scene["median"]["medae"] < 0.03  # of about 4 m
    assert len(list(cache.iterdir())) == scene["num_views"] == 3
    assert str(tmp_path) not in output.read_text()


def test_a_run_goes_on_from_its_cache(
    tmp_path: Path, rendered: RenderedEth3d, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = copied(rendered, tmp_path / "ETH3D" / "office").parent
    first = measured(evaluate(tmp_path, root, "--json", "--num-pairs", 1))
    assert len(list((root / "resdepth-cache").iterdir())) == 1
    monkeypatch.delattr("resdepth_colmap.evaluation.depth.sample_matching.match_view")
    again = measured(evaluate(tmp_path, root, "--json", "--num-pairs", 1))
    assert (
        again["scenes"]["office"]["unfiltered"]
        == (first["scenes"]["office"]["unfiltered"])
    )


def test_a_file_of_pairs_is_obeyed(tmp_path: Path, rendered: RenderedEth3d) -> None:
    root = copied(rendered, tmp_path / "ETH3D" / "office").parent
    text = f"# mine\noffice {IMAGES[2]} {IMAGES[1]}  # wide\n"
    (root / "pairs.txt").write_text(text)
    found = measured(evaluate(tmp_path, root, "--json"))
    assert found["scenes"]["office"]["view_names"] == [f"{IMAGES[2]} {IMAGES[1]}"]
    assert found["protocol"]["pairs"] == "of pairs.txt"
    (tmp_path / "mine.txt").write_text(f"office {IMAGES[0]} {IMAGES[1]}\n")
    found = measured(
        evaluate(tmp_path, root, "--json", "--pairs", tmp_path / "mine.txt")
    )
    assert found["scenes"]["office"]["view_names"] == [f"{IMAGES[0]} {IMAGES[1]}"]


def truncate_truth(scene: Path) -> None:
    path = scene / "ground_truth_depth/dslr_images" / IMAGES[0]
    path.write_bytes(path.read_bytes()[:1000])


def lose_truth(scene: Path) -> None:
    shutil.rmtree(scene / "ground_truth_depth")


def lose_calibration(scene: Path) -> None:
    shutil.rmtree(scene / "dslr_calibration_jpg")


def forget_an_image(scene: Path) -> None:
    path = scene / "dslr_calibration_jpg/images.txt"
    path.write_text(path.read_text().replace(IMAGES[0], "DSC_0009.JPG"))


def move_an_image(scene: Path) -> None:
    folder = scene / "dslr_calibration_jpg"
    model = pycolmap.Reconstruction(folder)
    model.transform(pycolmap.Sim3d(1, pycolmap.Rotation3d(), np.array([0.5, 0, 0])))
    model.write_text(folder)


def shrink_calibration(scene: Path) -> None:
    path = scene / "dslr_calibration_jpg/cameras.txt"
    path.write_text(path.read_text().replace(" 240 160 ", " 120 80 "))


def shrink_an_image(scene: Path) -> None:
    path = scene / "images/dslr_images_undistorted" / IMAGES[0]
    Image.new("L", (100, 70)).save(path)


def shrink_a_mask(scene: Path) -> None:
    Image.new("L", (100, 70)).save(scene / "masks_for_images/dslr_images/DSC_0001.png")


def break_a_model(scene: Path) -> None:
    (scene / "dslr_calibration_undistorted/points3D.txt").unlink()


def name_a_stranger(scene: Path) -> None:
    (scene.parent / "pairs.txt").write_text(f"office {IMAGES[0]} DSC_0009.JPG\n")


def pair_with_itself(scene: Path) -> None:
    (scene.parent / "pairs.txt").write_text(f"office {IMAGES[0]} {IMAGES[0]}\n")


def keep_no_truth(scene: Path) -> None:
    for path in (scene / "ground_truth_depth/dslr_images").iterdir():
        path.rename(path.with_suffix(".PNG"))


@pytest.mark.parametrize(
    ("break_it", "words"),
    [
        (truncate_truth, (IMAGES[0], "expected 153600 bytes", "found 1000")),
        (shrink_calibration, (IMAGES[0], "expected 38400 bytes", "found 153600")),
        (lose_truth, ("no ground_truth_depth/dslr_images/", "office_dslr_depth.7z")),
        (lose_calibration, ("no dslr_calibration_jpg/", "office_dslr_jpg.7z")),
        (forget_an_image, ("dslr_calibration_jpg: no image DSC_0001.JPG",)),
        (move_an_image, ("at different poses", "0.500 m apart")),
        (shrink_an_image, (IMAGES[0], "100 x 70 pixels", "its camera", "245 x 163")),
        (shrink_a_mask, ("DSC_0001.png", "100 x 70 pixels", "240 x 160")),
        (break_a_model, ("points3D.txt: no such file",)),
        (name_a_stranger, ("pairs.txt: names DSC_0009.JPG",)),
        (pair_with_itself, ("pairs.txt: pairs DSC_0001.JPG with itself",)),
        (keep_no_truth, ("no pair of high overlap among the 0 of 3 images",)),
    ],
)
def test_a_broken_scene_is_one_line_and_stops_no_other(
    tmp_path: Path,
    rendered: RenderedEth3d,
    break_it: Callable[[Path], None],
    words: tuple[str, ...],
) -> None:
    scene = copied(rendered, tmp_path / "ETH3D" / "office")
    copied(rendered, tmp_path / "ETH3D" / "pipes")
    break_it(scene)
    result = evaluate(tmp_path, scene.parent, "--num-pairs", 1)
    assert result.exit_code == 1
    (line,) = [line for line in result.stderr.splitlines() if line.strip()]
    assert line.startswith("Error: office: ")
    for word in words:
        assert word in line
    assert "| pipes | refined |" in result.stdout
    assert result.stdout.rstrip().endswith("1 of 2 scenes failed: office")


def test_a_scene_that_is_missing_is_named(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    scenes = ("--scene", "kicker", "--scene", "office")
    options = ("--num-pairs", 1, "--cache", tmp_path / "cache")
    result = evaluate(tmp_path, rendered.path.parent, *scenes, *options)
    assert result.exit_code == 1
    assert "Error: kicker: " in result.stderr
    assert "no scene kicker; there are: office" in result.stderr
    assert "| office | refined |" in result.stdout


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("office", "is a scene itself; point at the folder above it, {root}"),
        ("office/images", "is a folder of a scene; point at {root}"),
        ("..", "no scene in it, but in a folder of it; point at {above}/ETH3D"),
        ("office/dslr_scan_eval/x", "no such folder"),
    ],
)
def test_a_wrong_folder_is_told_where_the_right_one_is(
    tmp_path: Path, rendered: RenderedEth3d, where: str, words: str
) -> None:
    root = rendered.path.parent
    result = evaluate(tmp_path, root / where)
    assert result.exit_code == 1
    (line,) = [line for line in result.stderr.splitlines() if line.strip()]
    assert words.format(root=root, above=root / "..") in line


def test_an_empty_folder_says_how_to_fill_it(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    result = evaluate(tmp_path, tmp_path / "empty")
    assert result.exit_code == 1
    assert "unpack the archives of https://www.eth3d.net" in result.stderr


def test_a_malformed_file_of_pairs_is_one_line(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    path = tmp_path / "pairs.txt"
    path.write_text("# scene reference source\noffice DSC_0001.JPG\n")
    result = evaluate(tmp_path, rendered.path.parent, "--pairs", path)
    assert result.exit_code == 1
    assert f"{path}, line 2: 'office DSC_0001.JPG', but expected" in result.stderr
    result = evaluate(tmp_path, rendered.path.parent, "--pairs", tmp_path / "none")
    assert "none: cannot be read as text" in result.stderr


def test_colmap_without_cuda_is_one_line(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    if pycolmap.has_cuda:
        pytest.skip("this pycolmap has CUDA")
    result = evaluate(tmp_path, rendered.path.parent, "--stereo", "colmap")
    assert result.exit_code == 1
    assert "--stereo cpu" in result.stderr


def test_there_are_no_maps_to_start_from(
    tmp_path: Path, rendered: RenderedEth3d
) -> None:
    result = evaluate(tmp_path, rendered.path.parent, "--stereo", "existing")
    assert result.exit_code == 1
    assert "--stereo existing: the scenes have no depth maps" in result.stderr
