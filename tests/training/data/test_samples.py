"""Laws of the samples: which maps become one, and what is in them."""

import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from noisy_planes import write_noisy_plane
from planes import NAMES

from resdepth_colmap.config import StereoConfig
from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.geometry.resize import nearest_resized
from resdepth_colmap.io.colmap.maps import read_depth_map, write_depth_map
from resdepth_colmap.network.network_config import InputVariant, NetworkConfig
from resdepth_colmap.pipeline import view_images
from resdepth_colmap.training.data import labelled_views as labelled_views_module
from resdepth_colmap.training.data.labelled_views import labelled_views
from resdepth_colmap.training.data.samples import (
    DENSE,
    FILLED,
    HOLES,
    guidance_names,
    prepare_samples,
    read_sample,
    sample_size,
)

NETWORK = NetworkConfig(levels=3, base_channels=4, max_channels=8)


def names_of(paths: list[Path]) -> list[str]:
    return [path.stem for path in paths]


def test_unfiltered_and_filtered_maps_of_a_view_are_samples_of_their_own(
    tmp_path: Path,
) -> None:
    scene = write_noisy_plane(tmp_path / "room", kinds=("photometric", "geometric"))
    paths = prepare_samples([scene], NETWORK, tmp_path / "cache")
    assert len(set(paths)) == len(paths)
    expected = {"photometric": {DENSE, FILLED, HOLES}, "geometric": {HOLES}}
    for kind, ends in expected.items():
        own = [name for name in names_of(paths) if f"-{kind}-" in name]
        assert {"-" + name.rsplit("-", 1)[1] for name in own} == ends
        assert len(own) == len(NAMES) * len(ends)
    filtered = [read_sample(path) for path in paths if "-geometric-" in path.stem]
    assert all(0.8 < sample.valid.mean() < 0.95 for sample in filtered)


def test_scenes_of_one_folder_name_do_not_share_samples(tmp_path: Path) -> None:
    scenes = [write_noisy_plane(tmp_path / name / "dense") for name in ("a", "b")]
    scenes.append(write_noisy_plane(tmp_path / "c" / "a" / "dense"))
    paths = prepare_samples(scenes, NETWORK, tmp_path / "cache")
    assert len(set(paths)) == len(paths) == 3 * len(NAMES) * 3


def test_a_sample_is_made_anew_when_its_map_changes_and_only_then(
    tmp_path: Path,
) -> None:
    scene = write_noisy_plane(tmp_path / "room")
    first = prepare_samples([scene], NETWORK, tmp_path / "cache")
    times = [path.stat().st_mtime_ns for path in first]
    again = prepare_samples([scene], NETWORK, tmp_path / "cache")
    assert again == first
    assert [path.stat().st_mtime_ns for path in again] == times
    path = scene / "stereo/depth_maps/3.png.photometric.bin"
    write_depth_map(path, read_depth_map(path) * np.float32(1.01))
    os.utime(path, ns=(1, 1))
    changed = prepare_samples([scene], NETWORK, tmp_path / "cache")
    new = {path.stem for path in set(changed) - set(first)}
    assert sum("-3.png-" in stem for stem in new) == 3
    # The others look at it; maps of another kind do not.
    assert all("-photometric-" in stem for stem in new)


def test_each_image_and_map_is_read_once_for_all_samples_of_a_workspace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_noisy_plane(tmp_path / "room", kinds=("photometric", "geometric"))
    reads: Counter[Path] = Counter()

    def counted(read: Callable[[Path], Any]) -> Callable[[Path], Any]:
        def count(path: Path) -> Any:
            reads[path] += 1
            return read(path)

        return count

    for name in ("read_gray", "read_depth_map"):
        original = getattr(view_images, name)
        monkeypatch.setattr(view_images, name, counted(original))
    prepare_samples([scene], NETWORK, tmp_path / "cache")
    assert len(reads) == 3 * len(NAMES)  # images, and maps of two kinds
    assert set(reads.values()) == {1}


def test_all_variants_share_their_samples(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "room")
    cache = tmp_path / "cache"
    paths = {
        variant: prepare_samples([scene], NetworkConfig.paper(variant), cache)
        for variant in InputVariant
    }
    assert all(found == paths[InputVariant.STEREO] for found in paths.values())
    channels = guidance_names(1)
    assert channels == (
        "reference",
        "source_0",
        "valid",
        "photo_consistency",
        "reprojected_change",
        "reprojected",
        "red",
        "blue",
    )
    assert len(read_sample(paths[InputVariant.MONO][0]).guidance) == len(channels)


def test_the_size_is_read_without_the_rest(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "room")
    path = prepare_samples([scene], NETWORK, tmp_path / "cache")[0]
    assert sample_size(path) == read_sample(path).target.shape == (60, 80)


def test_a_map_of_a_failed_pair_is_not_used(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "room", wrong_share=0.9)
    assert prepare_samples([scene], NETWORK, tmp_path / "cache") == []


def test_a_smaller_map_has_a_smaller_sample_with_the_same_truth(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "room", wrong_share=0.0)
    for path in (scene / "stereo" / "depth_maps").rglob("*.bin"):
        write_depth_map(path, nearest_resized(read_depth_map(path), (40, 30)))
    for path in prepare_samples([scene], NETWORK, tmp_path / "cache"):
        sample = read_sample(path)
        assert sample.target.shape == sample.guidance.shape[1:] == (30, 40)
        right = sample.inverse_depth[sample.valid] * (1 / sample.target[sample.valid])
        np.testing.assert_allclose(right, 1.0, atol=1e-5)


def test_a_workspace_without_maps_is_matched_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_noisy_plane(tmp_path / "room", kinds=())
    asked: list[StereoConfig] = []

    def match(workspace: object, scene_: object, config: StereoConfig, **_: object):  # type: ignore[no-untyped-def] # a fake
        asked.append(config)
        write_noisy_plane(scene)

    monkeypatch.setattr(labelled_views_module, "stereo_workspace", match)
    views = labelled_views(scene)
    assert len(asked) == 1
    assert [view.image_name for view in views] == list(NAMES)
    assert {view.kind for view in views} == {"photometric"}
    labelled_views(scene)
    assert len(asked) == 1


def test_a_map_of_another_image_is_refused(tmp_path: Path) -> None:
    scene = write_noisy_plane(tmp_path / "room")
    path = scene / "stereo/depth_maps/3.png.photometric.bin"
    write_depth_map(path, np.ones((80, 60), np.float32))
    with pytest.raises(WorkspaceError, match=r"3\.png\.photometric\.bin"):
        prepare_samples([scene], NETWORK, tmp_path / "cache")
