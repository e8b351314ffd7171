"""The tables of the model card (docs/model_card.md): the weights and their training."""

from operator import itemgetter
from typing import Any

from resdepth_colmap.evaluation.markdown import Column, Measured, columns, table

HASH_DIGITS = 12
"""As many digits of a SHA-256 identify a weights file."""

CHANNELS = {
    "inverse_depth": "initial inverse depth, holes filled",
    "reference": "the photo, grey",
    "source_0": "the second photo, warped with that depth",
    "valid": "which depth was measured, not filled",
    "photo_consistency": "photo-consistency of the two photos (NCC, 7 x 7)",
    "reprojected_change": "difference from the reprojected maps of other views",
    "reprojected": "where there is a reprojected map",
    "red": "the photo's red",
    "blue": "and blue",
}
STAGES = [
    *columns("", {"stage": "stage", "starts_from": "starts from", "maps": "maps"}),
    *columns(",", {"num_rooms": "rooms", "num_views": "views", "steps": "steps"}),
    *columns("", {"batch": "batch and crop, px"}),
    *columns("g", {"learning_rate": "learning rate"}),
    *columns(",", {"minutes": "minutes"}),
    *columns(".2f", {"held_out/mae_ratio": "held-out rooms: MAE ratio"}),
    *columns(".2f", {"held_out/medae_ratio": "MedAE ratio"}),
    Column("weights", lambda row: f"`{short_hash(row['weights_sha256'])}`"),
]


def short_hash(sha256: str) -> str:
    """The first digits of the hash of a weights file."""
    return sha256[:HASH_DIGITS]


def weights_text(measured: Measured) -> str:
    """File, size, inputs and outputs of the network, one row each."""
    network = measured["network"]
    inputs = [CHANNELS.get(name, name) for name in measured["channels"]]
    outputs = ["a residual of the inverse depth"]
    outputs += ["a gate that weights it"] if network["gate"] else []
    outputs += ["the expected error"] if network["confidence"] else []
    facts = {
        "file": f"`resdepth_colmap/weights/{measured['file']}`, "
        f"{measured['megabytes']} MB; SHA-256 begins "
        f"`{short_hash(measured['sha256'])}`",
        "network": f"U-Net, {network['levels']} levels, {network['base_channels']} to "
        f"{network['max_channels']} channels, "
        f"{measured['num_parameters'] / 1e6:.1f} million parameters"
        + _propagation(network),
        "inputs": "; ".join(inputs),
        "outputs": "; ".join(outputs),
        "normalisation": f"{network['normalisation']}, tile by tile",
    }
    return table([Column("", itemgetter(index)) for index in (0, 1)], facts.items())


def training_text(measured: Measured) -> str:
    """One row a stage of the training, and the commands."""
    rows = [_stage_row(index, it) for index, it in enumerate(measured["stages"], 1)]
    commands = [
        f"    {row['command']}  # stage {index}"
        for index, row in enumerate(rows, 1)
        if row["command"]
    ]
    parts = [f"On {measured['hardware']}:", table(STAGES, rows), "\n".join(commands)]
    return "\n\n".join(parts).rstrip()


def _propagation(network: Measured) -> str:
    channels = network.get("propagation_channels", 0)
    if not channels:
        return ""
    seen = ["the features of the first one"] if network["shared_features"] else []
    seen += ["the resampled source"] if network["source_resampling"] else []
    sees = f"sees {' and '.join(seen)} and " if seen else ""
    return (
        f", with those of the propagation network ({channels} channels at half the "
        f"resolution), which {sees}mixes each pixel's depth from its surroundings"
    )


def _stage_row(index: int, stage: Measured) -> dict[str, Any]:
    decision = stage["adr"].split("-")[0]
    crop = " x ".join(str(side_px) for side_px in stage["crop_px"])
    return {
        **stage,
        "stage": f"{index} ([ADR {decision}](adr/{stage['adr']}))",
        "batch": f"{stage['batch_size']} of {crop}",
    }
