"""Measure matcher and network on the two-view scenes of Middlebury.

    python -m scripts.benchmarks.middlebury [OPTIONS OF
        `resdepth-colmap evaluate depth`]
    python -m scripts.benchmarks.middlebury --without-network

It is that command on the folder middlebury/ of RESDEPTH_DATA, and writes the figures to
docs/measurements/middlebury.json unless --output names another file; then
`python -m scripts.benchmarks.make_tables` puts them into the documents. The second form
takes a network that changes nothing, so that what remains is what the map of the
second view does to the first one's; its figures go to middlebury_completed.json.
"""

import os
import sys
import tempfile
from pathlib import Path

from resdepth_colmap.cli.main import main
from resdepth_colmap.network.network_config import NetworkConfig
from resdepth_colmap.network.unet import ResDepthNet
from resdepth_colmap.network.weights import save_weights

REPOSITORY = Path(__file__).resolve().parents[2]
MEASUREMENTS = REPOSITORY / "docs" / "measurements"
WITHOUT_NETWORK = "--without-network"


def run() -> None:
    """Run the command; the last --output wins."""
    default = REPOSITORY.parent / "shared" / "data"
    scenes = Path(os.environ.get("RESDEPTH_DATA", default)) / "middlebury"
    options = [option for option in sys.argv[1:] if option != WITHOUT_NETWORK]
    name = "middlebury"
    with tempfile.TemporaryDirectory() as folder:
        if len(options) < len(sys.argv) - 1:
            name = "middlebury_completed"
            weights = Path(folder) / "unchanging.safetensors"
            unchanging = NetworkConfig(base_channels=1, propagation_channels=0)
            save_weights(weights, ResDepthNet(unchanging))
            options = ["--weights", str(weights), "--rounds", "1", *options]
        command = ["evaluate", "depth", str(scenes)]
        command += ["--output", str(MEASUREMENTS / f"{name}.json"), *options]
        main(command, prog_name="resdepth-colmap")


if __name__ == "__main__":
    run()
