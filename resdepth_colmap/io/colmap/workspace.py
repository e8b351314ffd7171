"""A COLMAP dense workspace: where its images, model and maps lie."""

import dataclasses
import re
from pathlib import Path

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.masks import Masks
from resdepth_colmap.io.colmap.reconstruction import find_model
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.io.images import image_size
from resdepth_colmap.scene import Scene

OUTPUT_FOLDER = "resdepth"
"""Our output in a workspace: a workspace itself, but never the one that was meant."""

ORIGINAL_SUFFIX = ".original"
"""What a map replaced in place is kept under; an empty file says there was no map."""

_KIND = re.compile(r"[^./\\]+")
_MOST_NAMES_SHOWN = 3


@dataclasses.dataclass(frozen=True, kw_only=True)
class Workspace:
    """Paths of a dense workspace.

    Attributes:
        path: The workspace, as `colmap image_undistorter` wrote it.
        sparse_path: Folder of the model: `sparse` or `sparse/0` in it.
        images_path: Folder of the undistorted images.
        stereo_path: Folder of the maps and cfg files; it may not exist yet.
        masks: The masks of the images, once they are looked for (`pipeline.masks`).
    """

    path: Path
    sparse_path: Path
    images_path: Path
    stereo_path: Path
    masks: Masks = Masks()  # noqa: RUF009 (it is frozen)

    def image_path(self, name: str) -> Path:
        """The image of that name; WorkspaceError if the name leads out of it."""
        return self.images_path / safe_name(name)

    def depth_map_path(self, name: str, kind: str) -> Path:
        """The depth map of an image; it may not exist. `kind` as in `map_kinds`."""
        return self.stereo_path / "depth_maps" / f"{safe_name(name)}.{kind}.bin"

    def normal_map_path(self, name: str, kind: str) -> Path:
        """The normal map of an image; it may not exist. `kind` as in `map_kinds`."""
        return self.stereo_path / "normal_maps" / f"{safe_name(name)}.{kind}.bin"

    def consistency_graph_path(self, name: str, kind: str) -> Path:
        """The consistency graph of an image; it may not exist."""
        folder = self.stereo_path / "consistency_graphs"
        return folder / f"{safe_name(name)}.{kind}.bin"

    def truth_path(self, name: str) -> Path:
        """The true depth map of an image, where one is known; it may not exist."""
        return self.path / "ground_truth" / f"{safe_name(name)}.bin"

    def map_kinds(self, name: str) -> tuple[str, ...]:
        """The kinds of depth map an image has: each K of a file `<name>.K.bin`.

        COLMAP's are "photometric" and "geometric"; no other one is excluded. They are
        sorted. A map that a run in place has put there counts; see `original_kinds`.
        """
        bare_path = self.stereo_path / "depth_maps" / safe_name(name)
        folder, start, end = bare_path.parent, f"{bare_path.name}.", ".bin"
        if not folder.is_dir():
            return ()
        names = (path.name for path in folder.iterdir())
        kinds = (
            name[len(start) : -len(end)]
            for name in names
            if name.startswith(start) and name.endswith(end)
        )
        return tuple(sorted(kind for kind in kinds if _KIND.fullmatch(kind)))

    def original_kinds(self, name: str) -> tuple[str, ...]:
        """As `map_kinds`, but without the maps that only a run in place has made."""
        return tuple(
            kind
            for kind in self.map_kinds(name)
            if original_map_path(self.depth_map_path(name, kind)) is not None
        )


def original_map_path(path: Path) -> Path | None:
    """Where the map of that path lies as it was before any run in place.

    Returns:
        The path itself if it was never replaced, the kept original if it was, and
        None if there was no map before, or is none at all.
    """
    kept = path.with_name(path.name + ORIGINAL_SUFFIX)
    if kept.is_file():
        return kept if kept.stat().st_size else None
    return path if path.is_file() else None


def open_workspace(path: Path) -> Workspace:
    """Find the dense workspace at a path, or in a folder of it.

    A parent will do: one with `dense/`, with `dense/0/`, or with just one folder that
    is a workspace. Nothing is created.

    Raises:
        WorkspaceError: If there is no workspace, more than one, or one in PMVS's
            layout; the message names the folder to use.
    """
    try:
        return _find(path)
    except PermissionError as error:
        raise WorkspaceError(f"{error.filename}: no permission to read it.") from error


def missing_images(workspace: Workspace, scene: Scene) -> tuple[str, ...]:
    """Names of the model's images that have no file."""
    return tuple(
        view.name
        for view in scene.views
        if not workspace.image_path(view.name).is_file()
    )


def check_images(workspace: Workspace, scene: Scene) -> None:
    """Check that each image of the model is there, and as large as its camera.

    Raises:
        WorkspaceError: Naming the images that are missing, or the first one whose size
            differs from its camera's, or that is no image.
    """
    missing = missing_images(workspace, scene)
    if missing:
        shown = ", ".join(missing[:_MOST_NAMES_SHOWN])
        more = len(missing) - _MOST_NAMES_SHOWN
        raise WorkspaceError(
            f"{workspace.images_path}: {len(missing)} of {len(scene.views)} images of "
            f"the model are missing: {shown}{f' and {more} more' if more > 0 else ''}; "
            "copy them there, as `colmap image_undistorter` wrote them."
        )
    for view in scene.views:
        path = workspace.image_path(view.name)
        width, height = image_size(path)
        camera = view.camera
        if (width, height) != (camera.width_px, camera.height_px):
            raise WorkspaceError(
                f"{path}: the image has {width} x {height} pixels, but its camera "
                f"{camera.width_px} x {camera.height_px}; use the images that belong "
                "to the model (for undistorted ones, of the same image_undistorter)."
            )


_WHAT_TO_POINT_AT = (
    "point at the folder that `colmap image_undistorter` wrote, "
    "which holds images/, sparse/ and stereo/"
)


def _find(path: Path) -> Workspace:
    if not path.exists():
        raise WorkspaceError(f"{path}: no such folder; {_WHAT_TO_POINT_AT}.")
    if not path.is_dir():
        raise WorkspaceError(f"{path}: is a file, not a folder; {_WHAT_TO_POINT_AT}.")
    _refuse_pmvs(path)
    if _is_workspace(path) and (path / "stereo").is_dir():
        return _workspace(path)
    candidates = _candidates(path)
    if len(candidates) > 1:
        listed = ", ".join(map(str, candidates))
        raise WorkspaceError(f"{path}: more than one workspace; use one of: {listed}.")
    if candidates:
        return _workspace(candidates[0])
    raise WorkspaceError(
        f"{path}: not a COLMAP dense workspace ({_what_is_missing(path)}); "
        f"{_WHAT_TO_POINT_AT}."
    )


def _workspace(path: Path) -> Workspace:
    return Workspace(
        path=path,
        sparse_path=_sparse_path(path) or path / "sparse",
        images_path=path / "images",
        stereo_path=path / "stereo",
    )


def _sparse_path(path: Path) -> Path | None:
    for folder in (path / "sparse", path / "sparse" / "0"):
        if find_model(folder) is not None:
            return folder
    return None


def _is_workspace(path: Path) -> bool:
    return (path / "images").is_dir() and _sparse_path(path) is not None


def _candidates(path: Path) -> list[Path]:
    """Workspaces below a folder: the likeliest place that has any."""
    dense = path / "dense"
    found = [folder for folder in (dense, *_folders(dense)) if _is_workspace(folder)]
    if not found and _is_workspace(path):  # not computed yet: no stereo folder
        found = [path]
    return found or [folder for folder in _folders(path) if _is_workspace(folder)]


def _folders(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    folders = (child for child in path.iterdir() if child.is_dir())
    return sorted(folder for folder in folders if folder.name != OUTPUT_FOLDER)


def _what_is_missing(path: Path) -> str:
    missing = []
    if not (path / "images").is_dir():
        missing.append("no images/")
    if _sparse_path(path) is None:
        missing.append("no model in sparse/ or sparse/0/")
    return ", ".join(missing)


def _refuse_pmvs(path: Path) -> None:
    marks = [path / "pmvs", path / "bundle.rd.out", *path.glob("stereo-*")]
    found = [mark for mark in marks if mark.exists()]
    if found and not (path / "stereo").is_dir():
        raise WorkspaceError(
            f"{path}: a workspace in PMVS's layout ({found[0].name}); run `colmap "
            "image_undistorter` with --output_type COLMAP and point at its output."
        )
