"""Texture lookup, filtered by mip levels."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.resize import area_resized
from resdepth_colmap.synthetic.textures import Picture

Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]


class Atlas:
    """All textures and their mip levels in one flat array.

    Args:
        textures: Pictures in 0..1 (sRGB), each (S, S, 3) with S a power of two.
    """

    def __init__(self, textures: Sequence[Picture]) -> None:  # noqa: D107
        levels: list[npt.NDArray[np.uint8]] = []
        most = max(len(picture) for picture in textures).bit_length()
        self._base = np.zeros((len(textures), most), dtype=np.int64)
        self._sizes = np.array([len(picture) for picture in textures])
        total = 0
        for index, picture in enumerate(textures):
            level = np.asarray(picture)
            for step in range(len(picture).bit_length()):
                self._base[index, step] = total
                levels.append(np.round(level * 255).astype(np.uint8).reshape(-1, 3))
                total += len(levels[-1])
                half = max(len(level) // 2, 1)
                level = area_resized(level, (half, half))
        self._texels = np.concatenate(levels)
        # sRGB to linear reflectance
        self._linear = (np.arange(256, dtype=np.float32) / 255) ** 2.2

    def sample(self, texture: Indices, uv: Floats, width: Floats) -> Floats:
        """Reflectance, bilinear in the nearest mip level.

        Args:
            texture: Index of the texture, shape (N,).
            uv: Texture coordinates, shape (N, 2), in repeats of the texture.
            width: Side of the footprint of a ray, shape (N,), in repeats.

        Returns:
            Reflected share of the light (linear), shape (N, 3).
        """
        full = self._sizes[texture]
        blur = np.log2(np.maximum(width * full, 1.0))
        level = np.minimum(np.round(blur), np.log2(full)).astype(np.int64)
        size = full >> level
        base = self._base[texture, level]
        xy = (uv % 1.0) * size[:, None] - 0.5
        corner = np.floor(xy).astype(np.int64)
        share = (xy - corner).astype(np.float32)
        color = np.zeros((len(uv), 3), dtype=np.float32)
        for dx, wx in ((0, 1 - share[:, 0]), (1, share[:, 0])):
            x = (corner[:, 0] + dx) & (size - 1)
            for dy, wy in ((0, 1 - share[:, 1]), (1, share[:, 1])):
                row = (corner[:, 1] + dy) & (size - 1)
                texel = self._texels[base + row * size + x]
                color += (wx * wy)[:, None] * self._linear[texel]
        return color
