"""A second view as tensors, and what it shows of a tile at any depth."""

from typing import NamedTuple, Self

import torch
from torch import Tensor

from resdepth_colmap.geometry.pixels import cropped_K
from resdepth_colmap.geometry.warp import warp_to_reference


class SourceTensors(NamedTuple):
    """A second view.

    Attributes:
        gray: Grey values in 0..1, shape (B, 1, Hs, Ws).
        K: K for index coordinates, shape (B, 3, 3), in pixels.
        source_from_reference: Pose, shape (B, 3, 4), translation in units.
        wanted: Which of its pixels count, shape (B, 1, Hs, Ws), bool; None = all. The
            others are black.
    """

    gray: Tensor
    K: Tensor
    source_from_reference: Tensor
    wanted: Tensor | None = None

    def item(self, place: int) -> Self:
        """One of a batch, as a batch of one."""
        one = slice(place, place + 1)
        return type(self)(
            self.gray[one],
            self.K[one],
            self.source_from_reference[one],
            None if self.wanted is None else self.wanted[one],
        )


class Sight(NamedTuple):
    """A tile's camera and the source that looks at the same.

    Attributes:
        K: K of the tile for index coordinates, shape (3, 3), in pixels.
        source: Its first source, a batch of one.
    """

    K: Tensor
    source: SourceTensors

    def crop(self, top_px: int, left_px: int) -> Self:
        """The same of a window that begins there."""
        cropped = cropped_K(self.K.cpu().numpy(), left_px, top_px)
        return self._replace(K=torch.from_numpy(cropped))

    def to(self, device: torch.device) -> Self:
        """The same with the photograph on a device; the matrices are small."""
        gray = self.source.gray.to(device)
        return self._replace(source=self.source._replace(gray=gray))

    def gray_at(self, inverse_depth: Tensor) -> Tensor:
        """The source where the tile would project into it, at several depths.

        Args:
            inverse_depth: Shape (C, H, W), in 1/unit; 0 or less = no depth.

        Returns:
            Grey values, shape (C, H, W); 0 where the source sees nothing.
        """
        num_depths = len(inverse_depth)

        def each(values: Tensor) -> Tensor:
            return values.expand(num_depths, *values.shape[1:])

        warped, _ = warp_to_reference(
            each(self.source.gray),
            inverse_depth[:, None],
            each(self.K[None]),
            each(self.source.K),
            each(self.source.source_from_reference),
        )
        return warped[:, 0]


class SourceSampler(NamedTuple):
    """What the first sources of a batch of tiles show, at any depth.

    Attributes:
        sights: Of each tile of the batch; None = nothing looks at it.
    """

    sights: tuple[Sight | None, ...]

    def crop(self, top_px: int, left_px: int) -> Self:
        """The same of a window of each tile that begins there."""
        return self._replace(
            sights=tuple(s and s.crop(top_px, left_px) for s in self.sights)
        )

    def to(self, device: torch.device) -> Self:
        """The same on a device."""
        return self._replace(sights=tuple(s and s.to(device) for s in self.sights))

    def gray_at(self, inverse_depth: Tensor) -> Tensor:
        """`Sight.gray_at` of each tile, shape (B, C, H, W); black where none looks."""
        return torch.stack(
            [
                torch.zeros_like(depths) if sight is None else sight.gray_at(depths)
                for sight, depths in zip(self.sights, inverse_depth, strict=True)
            ]
        )
