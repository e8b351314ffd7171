"""Weights of a network for a larger one, which then does the same at first.

As in Net2Net (Chen et al., ICLR 2016), but what is new in the larger network starts
with random weights, and what was there does not see it yet.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.propagation import NUM_MORE, PACKED_PX

NEW_DEPTH_LOGIT = -2.0
"""Of depths that a propagation could not mix before: nearly no weight beside the
pixel's own, but enough of a gradient."""

_PROPAGATION = "propagation."
_FIRST_KERNEL = "encoder.0.0.weight"
_PROPAGATION_KERNEL = f"{_PROPAGATION}stem.0.0.weight"
_PROPAGATION_HEAD = (f"{_PROPAGATION}head.weight", f"{_PROPAGATION}head.bias")


def widened(
    weights: Mapping[str, Tensor],
    known: NetworkConfig,
    wanted: NetworkConfig,
    fresh: Mapping[str, Tensor],
) -> dict[str, Tensor]:
    """The weights of a network of the wanted configuration.

    Args:
        weights: Of a network that sees less, has no propagation or a narrower one.
        known: Its configuration.
        wanted: That of the larger network.
        fresh: The random weights of such a network.

    Returns:
        All its weights: the output is that of the smaller network, within rounding and
        the little that depths take which the smaller one could not mix.
    """
    grown = dict(weights)
    names = {
        _FIRST_KERNEL: (known.channels, wanted.channels),
        _PROPAGATION_KERNEL: (known.propagation_inputs, wanted.propagation_inputs),
    }
    for key in names.keys() & weights.keys():
        grown[key] = _with_inputs(grown[key], *names[key])
    for key in weights:
        if key in _PROPAGATION_HEAD:
            grown[key] = _with_depths(grown[key], fresh[key])
        elif key.startswith(_PROPAGATION):
            grown[key] = _with_channels(key, grown[key], fresh[key])
    return {**fresh, **grown}


def _with_inputs(
    kernel: Tensor, known: tuple[str, ...], wanted: tuple[str, ...]
) -> Tensor:
    """Zeros for new inputs; a name is one channel, or as many as each of the others."""
    group = kernel.shape[1] // len(known)
    wide = kernel.new_zeros(kernel.shape[0], group * len(wanted), *kernel.shape[2:])
    for name, part in zip(known, torch.split(kernel, group, dim=1), strict=True):
        place = wanted.index(name) * group
        wide[:, place : place + group] = part
    return wide


def _with_channels(key: str, values: Tensor, fresh: Tensor) -> Tensor:
    """New channels as they were made; no old one sees them."""
    wide = fresh.clone()
    if values.ndim > 1:
        is_transposed = key.startswith(f"{_PROPAGATION}up.")
        outputs_axis = 1 if is_transposed else 0
        wide.narrow(outputs_axis, 0, values.shape[outputs_axis]).zero_()
    wide[tuple(slice(length) for length in values.shape)] = values
    return wide


def _with_depths(values: Tensor, fresh: Tensor) -> Tensor:
    """The head for more channels, and for more depths to mix."""
    wide = torch.zeros_like(fresh)
    num_last = NUM_MORE * PACKED_PX**2
    num_known = len(values) - num_last
    if values.ndim == 1:
        wide[num_known:-num_last] = NEW_DEPTH_LOGIT
        wide[:num_known], wide[-num_last:] = values[:-num_last], values[-num_last:]
    else:
        wide[:num_known, : values.shape[1]] = values[:-num_last]
        wide[-num_last:, : values.shape[1]] = values[-num_last:]
    return wide
