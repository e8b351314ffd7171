"""COLMAP's sparse model, read into a Scene, and its points."""

import dataclasses
import shlex
import tempfile
from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import pycolmap

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.colmap.reconstruction import (
    PYCOLMAP_ERRORS,
    broken_model,
    find_model,
    names_in_text,
    open_reconstruction,
    quiet_pycolmap,
)
from resdepth_colmap.io.files import safe_name
from resdepth_colmap.scene import Camera, Matrix, Scene, View

_PINHOLES = ("PINHOLE", "SIMPLE_PINHOLE")
FAR_SIZES = 100.0
"""A model is far from its origin at so many times its own size."""

_ANGLE_PERCENTILE = 75.0  # COLMAP's choice for the sources of its PatchMatch


def read_scene(sparse_path: Path, images_path: Path, workspace_path: Path) -> Scene:
    """Read cameras, poses, and the statistics of the sparse points.

    Images without a pose are left out.

    Args:
        sparse_path: Folder of the model, binary or text, of any COLMAP version.
        images_path: Folder of the undistorted images; they are not opened.
        workspace_path: The dense workspace that both belong to.

    Returns:
        The scene; its statistics are None if there are no sparse points with tracks.

    Raises:
        WorkspaceError: If the model is missing, broken or empty, has a camera with
            distortion, or names an image outside of its folder.
    """
    model = open_reconstruction(sparse_path)
    with quiet_pycolmap(), tempfile.TemporaryDirectory() as folder:
        try:
            origin = _origin(model)
            views = _views(sparse_path, images_path, model)
            if origin.any():  # MVSModel reads from a folder, into single precision
                model.transform(pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), -origin))
                views = tuple(_about(view, origin) for view in views)
                sparse_path = Path(folder)
                model.write(sparse_path)
            num_points = model.num_points3D()
            if num_points == 0:
                return Scene(views=views, origin_in_world=origin)
            mvs_model = pycolmap.MVSModel()
            mvs_model.read_from_colmap(
                workspace_path.absolute(),
                sparse_path.absolute(),
                images_path.absolute(),
            )
            order = np.argsort(model.reg_image_ids())  # MVSModel has them as they come
            scene = _scene_with_points(views, num_points, mvs_model, order)
            return dataclasses.replace(scene, origin_in_world=origin)
        except WorkspaceError:
            raise
        except PYCOLMAP_ERRORS as error:
            raise broken_model(sparse_path, error) from error


def _origin(model: Any) -> Matrix:
    """The centre of a model that is far from its origin; else (0, 0, 0).

    Far: single precision, which has 24 bits, would lose more than 1e-5 of its size.
    """
    centers = [np.array(image.projection_center()) for image in _registered(model)]
    points = [np.array(point.xyz) for point in model.points3D.values()]
    xyz = np.array([*centers, *points], dtype=np.float64)
    if not len(xyz) or not np.isfinite(xyz).all():
        return np.zeros(3)  # said by whoever reads the views
    low, high = np.quantile(xyz, (0.01, 0.99), axis=0)
    center, size = np.round((low + high) / 2), float((high - low).max())
    return center if np.abs(center).max() > FAR_SIZES * size else np.zeros(3)


def _registered(model: Any) -> list[Any]:
    """The images that have a pose, image ids ascending."""
    return [model.images[image_id] for image_id in sorted(model.reg_image_ids())]


def _about(view: View, origin: Matrix) -> View:
    """The same view in coordinates about another origin."""
    pose = view.cam_from_world.copy()
    pose[:, 3] += pose[:, :3] @ origin
    return dataclasses.replace(view, cam_from_world=pose)


def read_image_indices(sparse_path: Path) -> dict[int, int]:
    """The index of each image, by its id, among those of COLMAP's MVSModel.

    COLMAP takes the images with a pose as the model has them, which need not be by
    ascending ids. Its consistency graphs count like that.

    Raises:
        WorkspaceError: If the model is missing or broken.
    """
    image_ids = open_reconstruction(sparse_path).reg_image_ids()
    return {int(image_id): index for index, image_id in enumerate(image_ids)}


def _views(sparse_path: Path, images_path: Path, model: Any) -> tuple[View, ...]:
    """The views of the images that have a pose, image ids ascending."""
    images = _registered(model)
    if find_model(sparse_path) == ".txt":
        whole_names = names_in_text(sparse_path)
        names = [whole_names.get(image.image_id, image.name) for image in images]
    else:
        names = [image.name for image in images]
    _check_names(sparse_path, names)
    _check_cameras(sparse_path, images_path, images)
    pairs = zip(images, names, strict=True)
    return tuple(_view(sparse_path, image, name) for image, name in pairs)


def _scene_with_points(
    views: tuple[View, ...],
    num_points: int,
    mvs_model: Any,
    order: npt.NDArray[np.int64],
) -> Scene:
    depth_range = np.array(mvs_model.compute_depth_ranges(), dtype=np.float64)
    has_points = depth_range[:, 1] > 0  # COLMAP says (-1, -1) where there are none
    if not has_points.any():  # points without tracks give no statistics
        return Scene(views=views, num_points=num_points)
    shared = _square(mvs_model.compute_shared_points())
    angles = _square(mvs_model.compute_triangulation_angles(_ANGLE_PERCENTILE))
    depth_range[~has_points] = 0
    return Scene(
        views=views,
        num_points=num_points,
        num_shared_points=shared[np.ix_(order, order)].astype(np.int64),
        triangulation_angle_deg=np.degrees(angles[np.ix_(order, order)]),
        depth_range=depth_range[order],
    )


def _square(rows: list[dict[int, float]]) -> Matrix:
    """A symmetric matrix of COLMAP's value for each pair of images; 0 elsewhere."""
    matrix = np.zeros((len(rows), len(rows)), dtype=np.float64)
    for row, values in enumerate(rows):
        for column, value in values.items():
            matrix[row, column] = value
    return matrix


def _view(sparse_path: Path, image: Any, name: str) -> View:
    camera = image.camera
    K = camera.calibration_matrix()
    pose = np.array(image.cam_from_world().matrix(), dtype=np.float64)
    rotation = pose[:, :3]
    is_rotation = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3)
    if not (is_rotation and np.isfinite(pose).all() and _is_camera(camera, K)):
        raise WorkspaceError(
            f"{sparse_path}: the pose or camera {image.camera_id} of {name} is "
            "not one (not finite, no rotation or no positive size); "
            "run the reconstruction again."
        )
    return View(
        image_id=int(image.image_id),
        name=name,
        camera=Camera(
            width_px=int(camera.width),
            height_px=int(camera.height),
            fx=float(K[0, 0]),
            fy=float(K[1, 1]),
            cx=float(K[0, 2]),
            cy=float(K[1, 2]),
        ),
        cam_from_world=pose,
    )


def _is_camera(camera: Any, K: Matrix) -> bool:
    sizes = (camera.width, camera.height, K[0, 0], K[1, 1])
    return bool(np.isfinite(K).all()) and min(sizes) > 0


def _check_names(sparse_path: Path, names: list[str]) -> None:
    if not names:
        raise WorkspaceError(
            f"{sparse_path}: the model is empty (no image with a pose); "
            "point at a workspace whose reconstruction succeeded."
        )
    for name in names:
        try:
            safe_name(name)
        except WorkspaceError as error:
            raise WorkspaceError(f"{sparse_path}: {error}") from error
    repeated = sorted(name for name, count in Counter(names).items() if count > 1)
    if repeated:
        raise WorkspaceError(
            f"{sparse_path}: the model names {repeated[0]} more than once; "
            "image names have to be unique, as the maps are named after them."
        )


def _check_cameras(sparse_path: Path, images_path: Path, images: list[Any]) -> None:
    for image in images:
        model_name = image.camera.model_name
        if model_name not in _PINHOLES:
            input_path, image_path = map(
                shlex.quote, map(str, (sparse_path, images_path))
            )
            raise WorkspaceError(
                f"{sparse_path}: camera {image.camera_id} is of model {model_name}, "
                "but only undistorted images can be used (PINHOLE, SIMPLE_PINHOLE); "
                f"run `colmap image_undistorter --image_path {image_path} --input_path "
                f"{input_path} --output_path DENSE` and point at DENSE."
            )


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SparsePoints:
    """Sparse points.

    Attributes:
        ids: COLMAP's ids, ascending, shape (N,).
        xyz: World coordinates, shape (N, 3), in units.
        seen: By image id, the indices in `ids` of the points that the image saw.
    """

    ids: npt.NDArray[np.int64]
    xyz: Matrix
    seen: Mapping[int, npt.NDArray[np.int64]]

    def about(self, origin_in_world: Matrix) -> Self:
        """The same points in coordinates about another origin: those of a `Scene`."""
        return dataclasses.replace(self, xyz=self.xyz - origin_in_world)

    def seen_by(self, image_id: int) -> npt.NDArray[np.int64]:
        """Indices of the points that an image saw, shape (M,)."""
        return self.seen.get(image_id, np.zeros(0, np.int64))


def read_sparse_points(sparse_path: Path) -> SparsePoints:
    """Read the points, maybe none; WorkspaceError if the model is missing or broken."""
    points = open_reconstruction(sparse_path).points3D
    ids = sorted(points)
    seen: defaultdict[int, set[int]] = defaultdict(set)
    xyz = np.zeros((len(ids), 3))
    for index, point_id in enumerate(ids):
        point = points[point_id]
        xyz[index] = point.xyz
        for element in point.track.elements:
            seen[int(element.image_id)].add(index)
    return SparsePoints(
        ids=np.array(ids, np.int64),
        xyz=xyz,
        seen={image: np.array(sorted(it), np.int64) for image, it in seen.items()},
    )
