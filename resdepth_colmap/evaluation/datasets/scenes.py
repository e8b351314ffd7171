"""The scenes at given paths: workspaces with ground truth, and Middlebury scenes."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from resdepth_colmap.evaluation.datasets.middlebury import (
    is_middlebury_scene,
    read_middlebury_samples,
)
from resdepth_colmap.evaluation.datasets.sample import (
    LazySample,
    SampleOptions,
    SceneSource,
)
from resdepth_colmap.evaluation.datasets.workspaces import (
    TRUTH_FOLDER,
    read_workspace_samples,
)


def scene_sources(paths: Sequence[Path]) -> tuple[SceneSource, ...]:
    """The scenes at the paths, or in folders at the paths; they are read later.

    A path that is neither is a source, too: reading it raises the error.
    """
    folders = list(dict.fromkeys(f for path in paths for f in _scenes_at(path)))
    names = distinct_names(folders)
    return tuple(
        SceneSource(name=name, read=functools.partial(_reader(folder), folder))
        for name, folder in zip(names, folders, strict=True)
    )


def _scenes_at(path: Path) -> list[Path]:
    if _is_scene(path) or not path.is_dir():
        return [path]
    return [child for child in sorted(path.iterdir()) if _is_scene(child)] or [path]


def _is_scene(path: Path) -> bool:
    return (path / TRUTH_FOLDER).is_dir() or is_middlebury_scene(path)


def _reader(path: Path) -> Callable[[Path, SampleOptions], Sequence[LazySample]]:
    return (
        read_middlebury_samples if is_middlebury_scene(path) else read_workspace_samples
    )


def distinct_names(folders: Sequence[Path]) -> list[str]:
    """The names of the folders, with as many parents as makes them unique."""
    parts = [folder.absolute().parts for folder in folders]
    names: list[str] = []
    for length in range(1, max(map(len, parts), default=1) + 1):
        names = ["/".join(it[-length:]) for it in parts]
        if len(set(names)) == len(names):
            break
    return names
