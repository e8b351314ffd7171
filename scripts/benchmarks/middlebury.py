"""Measure matcher and network on the two-view scenes of Middlebury.

    python -m scripts.benchmarks.middlebury [OPTIONS OF `evaluate depth`]
    python -m scripts.benchmarks.middlebury --without-network

Runs `resdepth-colmap evaluate depth` on middlebury/ of RESDEPTH_DATA and writes
docs/measurements/middlebury.json unless --output names another file. The second form
uses a network that changes nothing: what remains is the completion of depth without
consistent views. It writes docs/measurements/middlebury_without_network.json.
"""

import sys
import tempfile
from pathlib import Path

from scripts.benchmarks.program import evaluate_depth
from scripts.benchmarks.record import DATA

WITHOUT_NETWORK = "--without-network"


def main() -> None:
    """Run the command; the last --output wins."""
    scenes = DATA / "middlebury"
    options = [option for option in sys.argv[1:] if option != WITHOUT_NETWORK]
    if WITHOUT_NETWORK not in sys.argv:
        evaluate_depth(scenes, "middlebury", options)
        return
    with tempfile.TemporaryDirectory() as folder:
        weights = Path(folder) / "unchanging.safetensors"
        write_unchanging_network(weights)
        given = ["--weights", str(weights), "--rounds", "1"]
        evaluate_depth(scenes, "middlebury_without_network", [*given, *options])


def write_unchanging_network(path: Path) -> None:
    """Write weights of a small network whose residual is 0."""
    from resdepth_colmap.network.network_config import NetworkConfig
    from resdepth_colmap.network.unet import ResDepthNet
    from resdepth_colmap.network.weights import save_weights

    config = NetworkConfig(base_channels=1, propagation_channels=0)
    save_weights(path, ResDepthNet(config))


if __name__ == "__main__":
    main()
