"""The figures of a weights file, read from the file."""

from pathlib import Path
from typing import Any

from resdepth_colmap.network.weights import load_weights, read_facts, weights_hash


def weights_facts(path: Path) -> dict[str, Any]:
    """The content of docs/measurements/weights.json for a weights file.

    Raises:
        WeightsError: If the file is missing, broken or of another program.
    """
    network = load_weights(path)
    return {
        "file": path.name,
        "sha256": weights_hash(path),
        "megabytes": round(path.stat().st_size / 1e6, 1),
        "num_parameters": sum(values.numel() for values in network.parameters()),
        "channels": list(network.config.channels),
        "network": network.config.to_mapping(),
        "facts": read_facts(path),
    }
