"""Correlation of an image with its neighbours, warped by the depth map."""

import torch
from torch import Tensor

from resdepth_colmap.evaluation.metrics.reference_free import Sums
from resdepth_colmap.evaluation.metrics.view_maps import ViewMaps, with_common
from resdepth_colmap.geometry.inverse_depth import invert_map
from resdepth_colmap.geometry.warp import warp_to_reference
from resdepth_colmap.pipeline.refine.photometric_error import photometric_error
from resdepth_colmap.pipeline.refine.view import ViewInputs
from resdepth_colmap.scene import DepthMap


def photo_correlation(maps: ViewMaps, inputs: ViewInputs) -> dict[str, Sums]:
    """Mean correlation of the image with each warped neighbour, by method.

    Normalised cross-correlation (NCC) of 7 x 7 windows over the covered pixels;
    "common": over those that every method covers and that the neighbour sees. The
    images of `inputs` are at the size of the maps.
    """
    reference = torch.from_numpy(inputs.gray)[None, None]
    totals = {method: torch.zeros(4, *maps.shape) for method in maps.depths}
    for source in inputs.sources:
        K, source_K, pose = (
            torch.from_numpy(matrix)[None]
            for matrix in (inputs.K, source.K, source.source_from_reference)
        )
        image = torch.from_numpy(source.gray)[None, None]
        warped = {
            method: warp_to_reference(image, _inverse(depth), K, source_K, pose)
            for method, depth in maps.depths.items()
        }
        in_all = torch.stack([inside for _, inside in warped.values()]).all(dim=0)
        for method, (image, inside) in warped.items():
            for index, counted in enumerate((inside, in_all)):
                correlation = _correlation(reference, image, counted)
                totals[method][2 * index] += correlation
                totals[method][2 * index + 1] += counted[0, 0]
    return {
        method: with_common("photo", total.numpy()) for method, total in totals.items()
    }


def _correlation(reference: Tensor, image: Tensor, counted: Tensor) -> Tensor:
    """Correlation at the counted pixels, 0 elsewhere, shape (H, W)."""
    value = photometric_error(reference, [(image, counted)])
    return torch.where(counted, 1.0 - 2.0 * value, 0.0)[0, 0]


def _inverse(depth: DepthMap) -> Tensor:
    return torch.from_numpy(invert_map(depth))[None, None]
