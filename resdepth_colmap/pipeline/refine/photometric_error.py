"""How well the photographs agree where a depth says that they show the same."""

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

NCC_WINDOW_PX = 7
NCC_VARIANCE_FLOOR = 4e-6  # (half a grey level of 255) squared: weaker is noise
NO_EVIDENCE = 0.5  # photometric error of a correlation of 0


def photometric_error(reference: Tensor, warped: list[tuple[Tensor, Tensor]]) -> Tensor:
    """How badly the best warped source matches the reference, in 0..1.

    (1 - NCC) / 2, with the zero-mean normalised cross-correlation of 7 x 7 windows: 0 =
    same pattern, 0.5 = no relation, 1 = negative. Brightness and contrast do not
    matter. Without texture the correlation goes to 0; where no source sees the pixel
    the value is 0.5, as there is no evidence either way.

    Args:
        reference: Grey values, shape (B, 1, H, W).
        warped: Of each source the image and where it is inside, shapes (B, 1, H, W).

    Returns:
        The least value of all sources, shape (B, 1, H, W).
    """
    best = torch.full_like(reference, math.inf)
    for image, inside in warped:
        value = 0.5 * (1.0 - _windowed_ncc(reference, image, inside))
        best = torch.where(inside, torch.minimum(best, value), best)
    return torch.where(torch.isinf(best), NO_EVIDENCE, best)


def _windowed_ncc(reference: Tensor, image: Tensor, inside: Tensor) -> Tensor:
    """Correlation in -1..1 over those pixels of each window that are inside."""
    weight = inside.to(reference.dtype)
    share = _window_mean(weight).clamp(min=1.0 / NCC_WINDOW_PX**2)

    def mean(values: Tensor) -> Tensor:
        return _window_mean(values * weight) / share

    mean_reference, mean_image = mean(reference), mean(image)
    variance_reference = mean(reference**2) - mean_reference**2
    variance_image = mean(image**2) - mean_image**2
    covariance = mean(reference * image) - mean_reference * mean_image
    floor = NCC_VARIANCE_FLOOR
    product = (variance_reference.clamp(min=0) + floor) * (
        variance_image.clamp(min=0) + floor
    )
    return (covariance / product.sqrt()).clamp(-1.0, 1.0)


def _window_mean(values: Tensor) -> Tensor:
    radius = NCC_WINDOW_PX // 2
    return avg_pool2d(values, NCC_WINDOW_PX, stride=1, padding=radius)
