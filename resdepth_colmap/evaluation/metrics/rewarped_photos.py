"""How well a view's photo fits the neighbours' photos, warped by its depth map."""

import torch
from torch import Tensor

from resdepth_colmap.evaluation.compare.method_maps import ViewMaps
from resdepth_colmap.evaluation.metrics.reference_free import Sums
from resdepth_colmap.evaluation.metrics.tile_sums import TileSums
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.pipeline.refine.view import SourceView, ViewInputs

Sampled = tuple[Tensor, Tensor]
"""A warped photo and where it is inside, shapes (1, 1, H, W)."""


def photo_agreement(maps: ViewMaps, photos: ViewInputs) -> dict[str, Sums]:
    """Mean correlation of the photo with each warped neighbour, by arm.

    Zero-mean normalised cross-correlation of 7 x 7 windows, of which only covered
    pixels count; "common": only those that every arm covers and the neighbour sees.

    Args:
        maps: The view.
        photos: Its photo and those of its neighbours, at the size of the maps.
    """
    reference = torch.from_numpy(photos.gray)[None, None]
    totals = {method: torch.zeros(4, *maps.shape) for method in maps.depths}
    for source in photos.sources:
        warped = _warped(maps, photos, source)
        in_all = torch.stack([inside for _, inside in warped.values()]).all(dim=0)
        for method, (image, inside) in warped.items():
            for place, counted in enumerate((inside, in_all)):
                correlation = _correlation(reference, image, counted)
                totals[method][2 * place] += correlation
                totals[method][2 * place + 1] += counted[0, 0]
    return {
        method: {
            "photo": TileSums.of(total[0].numpy(), total[1].numpy()),
            "photo_common": TileSums.of(total[2].numpy(), total[3].numpy()),
        }
        for method, total in totals.items()
    }


def _correlation(reference: Tensor, image: Tensor, counted: Tensor) -> Tensor:
    """Correlation at the counted pixels, 0 elsewhere, shape (H, W)."""
    value = photometric_error(reference, [(image, counted)])
    return torch.where(counted, 1.0 - 2.0 * value, 0.0)[0, 0]


def _warped(
    maps: ViewMaps, photos: ViewInputs, source: SourceView
) -> dict[str, Sampled]:
    K, source_K, pose = (
        torch.from_numpy(matrix)[None]
        for matrix in (photos.K, source.K, source.source_from_reference)
    )
    image = torch.from_numpy(source.gray)[None, None]
    return {
        method: warp_to_reference(
            image,
            torch.from_numpy(invert_map(depth))[None, None],
            K,
            source_K,
            pose,
        )
        for method, depth in maps.depths.items()
    }
