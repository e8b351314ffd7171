"""The points of COLMAP's sparse model, and which images saw them."""

import dataclasses
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from resdepth_colmap.io.colmap.reconstruction import open_reconstruction
from resdepth_colmap.scene import Matrix


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class SparsePoints:
    """Sparse points.

    Attributes:
        ids: COLMAP's ids, ascending, shape (N,).
        xyz: World coordinates, shape (N, 3), in units.
        seen: Of each image id the places, in `ids`, of the points in whose tracks the
            image is; an image without points is missing.
    """

    ids: npt.NDArray[np.int64]
    xyz: Matrix
    seen: Mapping[int, npt.NDArray[np.int64]]

    def about(self, origin_in_world: Matrix) -> Self:
        """The same points in coordinates about another origin: those of a `Scene`."""
        return dataclasses.replace(self, xyz=self.xyz - origin_in_world)

    def seen_by(self, image_id: int) -> npt.NDArray[np.int64]:
        """Places of the points that an image saw, shape (M,)."""
        return self.seen.get(image_id, np.zeros(0, np.int64))


def read_sparse_points(sparse_path: Path) -> SparsePoints:
    """Read the points of a model; there may be none.

    Raises:
        WorkspaceError: If the model is missing or broken.
    """
    points = open_reconstruction(sparse_path).points3D
    ids = sorted(points)
    seen: defaultdict[int, set[int]] = defaultdict(set)
    xyz = np.zeros((len(ids), 3))
    for place, point_id in enumerate(ids):
        point = points[point_id]
        xyz[place] = point.xyz
        for element in point.track.elements:
            seen[int(element.image_id)].add(place)
    return SparsePoints(
        ids=np.array(ids, np.int64),
        xyz=xyz,
        seen={image: np.array(sorted(it), np.int64) for image, it in seen.items()},
    )
