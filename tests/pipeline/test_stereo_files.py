"""Laws of what the stage "stereo" writes beside depth: masks, consistency graphs."""

from pathlib import Path

import numpy as np
import pycolmap
import pytest
from fake_matcher import DEPTH, FakeMatcher, installed
from PIL import Image
from planes import NAMES
from workspaces import opened, plane_folder

from resdepth_colmap.config import MaskConfig, StereoBackend, StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.cfg import read_sources
from resdepth_colmap.io.colmap.maps import read_depth_map, read_normal_map
from resdepth_colmap.io.colmap.model import read_image_indices
from resdepth_colmap.pipeline.masks import with_masks
from resdepth_colmap.pipeline.stereo.stage import StereoReport, stereo_workspace


@pytest.fixture(autouse=True)
def matcher(monkeypatch: pytest.MonkeyPatch) -> FakeMatcher:
    return installed(monkeypatch)


def match(
    folder: Path, backend: StereoBackend = StereoBackend.CPU, **options: object
) -> StereoReport:
    workspace, scene = opened(folder)
    masks = MaskConfig(mask_path=options.pop("mask_path", None))  # type: ignore[arg-type]
    config = StereoConfig(**options)  # type: ignore[arg-type] # passed on
    workspace = with_masks(workspace, scene, masks)
    return stereo_workspace(workspace, scene, config, backend)


def write_mask(folder: Path, name: str, value: int = 0) -> None:
    """The upper half is excluded; the lower half has that value."""
    mask = np.zeros((60, 80), np.uint8)
    mask[30:] = value
    path = folder / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(mask).save(path)


def depth_of(
    folder: Path, name: str, kind: str
) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    return read_depth_map(folder / f"stereo/depth_maps/{name}.{kind}.bin")


def test_where_the_mask_is_black_there_is_no_depth(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder, masks = plane_folder(tmp_path, kinds=()), tmp_path / "masks"
    write_mask(masks, NAMES[0], value=255)
    match(folder, mask_path=masks, filter=False)
    for kind in ("photometric", "geometric"):
        depth = depth_of(folder, NAMES[0], kind)
        assert np.array_equal(depth > 0, np.arange(60)[:, None].repeat(80, 1) >= 30)
        path = folder / f"stereo/normal_maps/{NAMES[0]}.{kind}.bin"
        assert np.array_equal(read_normal_map(path).any(axis=2), depth > 0)
        assert depth_of(folder, NAMES[1], kind).all()
    looking = [call for call in matcher.calls if call.source_depths is not None]
    halves = [d for call in looking for d in call.source_depths or () if not d.all()]
    assert halves  # what is masked in a source confirms nothing
    matcher.calls.clear()
    write_mask(masks, NAMES[0], value=1)
    match(folder, mask_path=masks, filter=False)
    assert matcher.calls  # the mask's file has changed


def test_a_wholly_black_mask_leaves_a_map_without_depth(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder, masks = plane_folder(tmp_path, kinds=()), tmp_path / "masks"
    write_mask(masks, NAMES[0])
    report = match(folder, mask_path=masks)
    assert set(report.matched) == set(NAMES)
    assert len(matcher.calls) == 2 * (len(NAMES) - 1)
    assert not depth_of(folder, NAMES[0], "geometric").any()
    assert match(folder, mask_path=masks).matched == ()


def test_a_mask_of_another_shape_stops_all_before_it_begins(
    tmp_path: Path, matcher: FakeMatcher
) -> None:
    folder, masks = plane_folder(tmp_path, kinds=()), tmp_path / "masks"
    (masks / NAMES[0]).parent.mkdir(parents=True)
    Image.fromarray(np.zeros((40, 40), np.uint8)).save(masks / f"{NAMES[0]}.png")
    with pytest.raises(WorkspaceError, match=r"0\.png\.png.* 40 x 40 .* 80 x 60"):
        match(folder, mask_path=masks)
    assert not matcher.calls


def test_a_consistency_graph_names_images_as_colmap_counts_them(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    cfg = f"{NAMES[2]}\n{NAMES[4]}, {NAMES[0]}, {NAMES[1]}\n"
    rest = [name for name in NAMES if name != NAMES[2]]
    cfg += "".join(f"{name}\n{NAMES[2]}\n" for name in rest)
    (folder / "stereo/patch-match.cfg").write_text(cfg, encoding="utf-8")
    match(folder, write_consistency_graph=True, filter_geom_consistency_max_cost=3.0)
    graphs = folder / "stereo/consistency_graphs"
    content = (graphs / f"{NAMES[2]}.geometric.bin").read_bytes()
    header, data = content[:8], np.frombuffer(content[8:], "<i4").tolist()
    assert header == b"80&60&1&"
    model = pycolmap.MVSModel()
    model.read_from_colmap(folder, folder / "sparse", folder / "images")
    expected = [model.get_image_idx(NAMES[index]) for index in (4, 0, 1)]
    depth = depth_of(folder, NAMES[2], "geometric")
    num_records, found = 0, set()
    while data:
        column, row, count = data[:3]
        assert depth[row, column] > 0
        assert count >= 2
        assert [i for i in expected if i in data[3 : 3 + count]] == data[3 : 3 + count]
        found |= set(data[3 : 3 + count])
        data, num_records = data[3 + count :], num_records + 1
    assert num_records == np.count_nonzero(depth) > 0
    assert len(found) > 1


def test_image_indices_are_those_of_colmaps_model(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path, kinds=())
    model = pycolmap.MVSModel()
    model.read_from_colmap(folder, folder / "sparse", folder / "images")
    indices = read_image_indices(folder / "sparse")
    assert len(indices) == len(NAMES)
    for view in opened(folder)[1].views:
        assert indices[view.image_id] == model.get_image_idx(view.name)


def test_colmap_is_given_what_was_said_and_its_maps_are_masked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path, kinds=("photometric", "geometric"))
    masks, calls = tmp_path / "masks", []
    write_mask(masks, NAMES[0], value=255)

    def run(path: str, *, options: pycolmap.PatchMatchOptions) -> None:
        calls.append((path, options.todict()))

    monkeypatch.setattr(pycolmap, "has_cuda", True)
    monkeypatch.setattr(pycolmap, "patch_match_stereo", run)
    said = {
        "max_image_size": 800,
        "window_radius": 7,
        "depth_min": 0.5,
        "depth_max": 9.0,
        "min_triangulation_angle": 2.0,
        "geom_consistency": False,
        "filter_min_num_consistent": 3,
        "write_consistency_graph": True,
        "cache_size": 8.0,
    }
    report = match(folder, StereoBackend.COLMAP, mask_path=masks, **said)
    assert report.backend is StereoBackend.COLMAP
    ((path, options),) = calls
    assert path == str(folder)
    default = pycolmap.PatchMatchOptions().todict()
    assert options == {**default, **said}
    for kind in ("photometric", "geometric"):
        depth = depth_of(folder, NAMES[0], kind)
        assert not depth[:30].any()
        assert depth[30:].all()
        assert depth_of(folder, NAMES[1], kind).all()
    assert depth_of(folder, NAMES[0], "geometric").max() != DEPTH


def test_without_sparse_points_colmap_is_told_sources_and_range(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path, kinds=(), num_points=0)
    calls = []

    def run(_: str, *, options: pycolmap.PatchMatchOptions, config_path: str) -> None:
        calls.append((options.depth_min, options.depth_max))
        for name, spec in read_sources(Path(config_path)).items():
            assert name in NAMES
            assert set(spec.names) < set(NAMES)

    monkeypatch.setattr(pycolmap, "has_cuda", True)
    monkeypatch.setattr(pycolmap, "patch_match_stereo", run)
    match(folder, StereoBackend.COLMAP)
    ((near, far),) = calls
    assert 0 < near < 3.4  # the plane lies between 3.3 and 5.7
    assert far > 5.7
