"""MeshLab projects (.mlp) with the poses of laser scans, as in ETH3D.

`scan_alignment.mlp` names each scan's PLY file, in the frame of its scanner, and the
4 x 4 matrix that brings it into the world.
"""

import dataclasses
import logging
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from resdepth_colmap.errors import WorkspaceError
from resdepth_colmap.io.files import reading

logger = logging.getLogger(__name__)

_ROTATION_TOLERANCE = 1e-3


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class AlignedScan:
    """A scan's file and where its scanner stood.

    Attributes:
        path: PLY file; its points are in the frame of the scanner, which is the origin,
            z up.
        world_from_scan: Rigid motion, shape (4, 4), float32; translation in metres.
    """

    path: Path
    world_from_scan: npt.NDArray[np.float32]


def read_scan_alignment(path: Path) -> tuple[AlignedScan, ...]:
    """Read the poses of the scans of a scene, at least one; the scans are not read.

    Of several groups of meshes the first counts, as for ETH3D's own program.

    Raises:
        WorkspaceError: If the file is not there or not such a project, if a scan has
            no file or no rigid matrix, or if there is no scan.
    """
    try:
        with reading(path):
            root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise WorkspaceError(
            f"{path}: not a MeshLab project, which is XML ({error}); "
            "name ETH3D's scan_alignment.mlp."
        ) from error
    meshes = root.findall("./MeshGroup[1]/MLMesh")
    if root.tag != "MeshLabProject" or not meshes:
        raise WorkspaceError(
            f"{path}: no scan in it (MLMesh in the MeshGroup of a MeshLabProject); "
            "name ETH3D's scan_alignment.mlp."
        )
    return tuple(_read_scan(mesh, path) for mesh in meshes)


def _read_scan(mesh: ElementTree.Element, path: Path) -> AlignedScan:
    name = mesh.get("filename")
    if not name:
        raise WorkspaceError(f"{path}: a mesh without a file name.")
    scan_path = path.parent / name
    if not scan_path.is_file():
        raise WorkspaceError(
            f"{path}: names the scan {name}, but {scan_path} does not exist; unpack "
            "the scans beside the project."
        )
    text = mesh.findtext("MLMatrix44") or ""
    return AlignedScan(path=scan_path, world_from_scan=_matrix(text, f"{path}: {name}"))


def _matrix(text: str, label: str) -> npt.NDArray[np.float32]:
    try:
        values = np.array([float(word) for word in text.split()], np.float32)
    except ValueError as error:
        message = f"{label}: its matrix is not of numbers: {error}."
        raise WorkspaceError(message) from error
    if values.shape != (16,) or not np.isfinite(values).all():
        raise WorkspaceError(
            f"{label}: its matrix has {values.size} values but expected 16 numbers."
        )
    matrix: npt.NDArray[np.float32] = values.reshape(4, 4)
    if matrix[3].tolist() != [0, 0, 0, 1]:
        raise WorkspaceError(
            f"{label}: the last row of its matrix is {matrix[3].tolist()} but expected "
            "0 0 0 1."
        )
    rotation = matrix[:3, :3].astype(np.float64)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ROTATION_TOLERANCE:
        logger.warning(
            "%s: its matrix is not a rigid motion; accuracy needs one.", label
        )
    return matrix
