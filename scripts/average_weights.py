"""Average the weights of several files of one network.

    python -m scripts.average_weights mean.safetensors first.safetensors ...

The mean of weights along a training often generalises better than each of them
(Izmailov et al., "Averaging Weights Leads to Wider Optima and Better Generalization",
UAI 2018). The statistics of the batch norms are averaged too.
"""

import argparse
from pathlib import Path

import torch

from resdepth_colmap.errors import WeightsError
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import load_weights, read_facts, save_weights


def averaged(paths: list[Path]) -> ResDepthNet:
    """The network with the mean of their weights.

    Raises:
        WeightsError: If a file cannot be read or is of another network than the first.
    """
    networks = [load_weights(path) for path in paths]
    for path, network in zip(paths, networks, strict=True):
        if network.config != networks[0].config:
            raise WeightsError(f"{path}: of another network than {paths[0]}.")
    states = [network.state_dict() for network in networks]
    mean = {
        name: torch.stack([state[name].float() for state in states])
        .mean(dim=0)
        .to(value.dtype)
        for name, value in states[0].items()
    }
    networks[0].load_state_dict(mean)
    return networks[0]


def main() -> None:
    """Read the command line, average and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("weights", type=Path, nargs="+")
    arguments = parser.parse_args()
    network = averaged(arguments.weights)
    facts = {**read_facts(arguments.weights[-1]), "averaged": len(arguments.weights)}
    save_weights(arguments.output, network, facts)


if __name__ == "__main__":
    main()
