"""How often a run opens its files: each map once a view, iteration and role."""

import collections
import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from planes import NAMES
from workspaces import identity_weights, plane_folder

from resdepth_colmap.config import FuseConfig, RefineConfig
from resdepth_colmap.io.colmap.output import OutputWorkspace
from resdepth_colmap.io.colmap.workspace import open_workspace
from resdepth_colmap.network.weights import load_weights
from resdepth_colmap.pipeline.refine import stage
from resdepth_colmap.pipeline.refine.cross_view import NUM_SOURCE_MAPS
from resdepth_colmap.pipeline.refine.stage import refine_workspace
from resdepth_colmap.pipeline.run import run_refine
from resdepth_colmap.pipeline.run_config import RunConfig
from resdepth_colmap.report.refine_and_report import refine_and_report

_opened: collections.Counter[str] | None = None


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if event == "open" and _opened is not None and "r" in str(arguments[1] or "r"):
        _opened[str(arguments[0])] += 1


sys.addaudithook(_watch)  # there is no way to take it off: it counts when asked to


@pytest.fixture
def opened() -> Iterator[collections.Counter[str]]:
    """How often each file was opened for reading."""
    global _opened
    _opened = collections.Counter()
    yield _opened
    _opened = None


def num_map_reads(opened: collections.Counter[str]) -> int:
    folders = ("depth_maps", "outer_iterations")
    maps = (path for path in opened if any(folder in path for folder in folders))
    return sum(
        opened[path]
        for path in maps
        if path.endswith(".bin") and ".partial-" not in path
    )


def config(folder: Path) -> RefineConfig:
    weights = identity_weights(folder, source_depth=True)
    return RefineConfig(tile_px=64, overlap_px=16, weights=weights, outer_iterations=3)


@pytest.mark.parametrize("kinds", [("geometric",), ("geometric", "photometric")])
def test_each_map_is_read_once_a_view_an_iteration_and_a_role(
    tmp_path: Path, opened: collections.Counter[str], kinds: tuple[str, ...]
) -> None:
    folder = plane_folder(tmp_path, kinds=kinds)
    options = config(tmp_path)
    opened.clear()
    refine_workspace(open_workspace(folder), options)
    num_sources = min(NUM_SOURCE_MAPS, len(NAMES) - 1)
    refining = options.outer_iterations * len(NAMES) * (1 + num_sources)
    fingerprints = len(NAMES) * len(kinds)
    assert num_map_reads(opened) <= refining + fingerprints
    # The maps of this scene stay in memory: each is read, and fingerprinted.
    num_maps = len(NAMES) * (len(kinds) + options.outer_iterations)
    assert num_map_reads(opened) <= 2 * num_maps


def test_what_is_fresh_is_not_read_again(
    tmp_path: Path, opened: collections.Counter[str]
) -> None:
    folder = plane_folder(tmp_path)
    options = config(tmp_path)
    refine_workspace(open_workspace(folder), options)
    opened.clear()
    assert refine_workspace(open_workspace(folder), options).refined == ()
    assert num_map_reads(opened) == 0
    assert not [path for path in opened if "/images/" in path]


def test_a_run_with_nothing_to_do_leaves_all_as_it_is(tmp_path: Path) -> None:
    folder = plane_folder(tmp_path)
    options = RunConfig(refine=config(tmp_path))
    assert not refine_and_report(folder, options).is_idle
    files = [path for path in folder.rglob("*") if path.is_file()]
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}
    again = refine_and_report(folder, options)
    assert again.is_idle and again.num_points > 0
    after = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}
    changed = [path.name for path in files if before[path] != after[path]]
    assert changed == []
    fewer = dataclasses.replace(options, fuse=FuseConfig(min_num_views=2))
    assert not refine_and_report(folder, fewer).is_idle


def test_a_run_loads_its_network_and_prepares_its_output_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = plane_folder(tmp_path)
    calls: collections.Counter[str] = collections.Counter()
    load, prepare = load_weights, OutputWorkspace.prepare

    def counted_load(*args: object) -> object:
        calls["load"] += 1
        return load(*args)  # type: ignore[arg-type] # passed on

    def counted_prepare(self: OutputWorkspace, names: list[str]) -> None:
        calls["prepare"] += 1
        prepare(self, names)

    monkeypatch.setattr(stage, "load_weights", counted_load)
    monkeypatch.setattr(OutputWorkspace, "prepare", counted_prepare)
    run_refine(folder, RunConfig(refine=config(tmp_path), no_pictures=True))
    assert calls == {"load": 1, "prepare": 1}
