"""Weights of a network as initialisation of a larger one with the same output.

As in Net2Net (Chen et al., ICLR 2016), but new parts of the larger network start with
random weights, and the existing parts have zero weights for them.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.propagation import NUM_MORE, PACKED_PX

NEW_DEPTH_LOGIT = -2.0
"""Logit of depths that a propagation could not mix before: almost no weight beside the
pixel's own depth, but enough of a gradient."""

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
    """The weights of a larger network.

    Args:
        weights: Weights of a network with fewer inputs, a narrower propagation or none.
        known: Its configuration.
        wanted: Configuration of the larger network.
        fresh: Random weights of the larger network.

    Returns:
        All weights of the larger network. Its output is that of the smaller one, within
        rounding and the small weight of depths that the smaller one could not mix.
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
    """A kernel with zeros for new inputs; names have equally many channels."""
    group = kernel.shape[1] // len(known)
    wide = kernel.new_zeros(kernel.shape[0], group * len(wanted), *kernel.shape[2:])
    for name, part in zip(known, torch.split(kernel, group, dim=1), strict=True):
        first = wanted.index(name) * group
        wide[:, first : first + group] = part
    return wide


def _with_channels(key: str, values: Tensor, fresh: Tensor) -> Tensor:
    """New channels keep their random weights; existing ones have zeros for them."""
    wide = fresh.clone()
    if values.ndim > 1:
        is_transposed = key.startswith(f"{_PROPAGATION}up.")
        outputs_axis = 1 if is_transposed else 0
        wide.narrow(outputs_axis, 0, values.shape[outputs_axis]).zero_()
    wide[tuple(slice(length) for length in values.shape)] = values
    return wide


def _with_depths(values: Tensor, fresh: Tensor) -> Tensor:
    """The head with more input channels, and with more depths to mix."""
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
