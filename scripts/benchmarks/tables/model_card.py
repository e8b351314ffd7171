"""What the model card (docs/model_card.md) says of the weights: tables from figures."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import NOT_KNOWN, count, markdown_table, number

SHORT_HASH = 12
"""As many digits of a SHA-256 tell one weights file from another."""

CHANNELS = {
    "inverse_depth": "initial inverse depth, holes filled",
    "reference": "the photo, grey",
    "source_0": "the second photo, warped onto that depth",
    "valid": "which depth was measured, not filled",
    "photo_consistency": "how well the two photos agree (7 x 7 correlation)",
    "reprojected_change": "where the depth maps of other views differ",
    "reprojected": "where any of these says something",
    "red": "the photo's red",
    "blue": "and blue",
}


def weights_table(measured: Mapping[str, Any]) -> str:
    """File, size, inputs and outputs of the network, one row each."""
    network = measured["network"]
    inputs = [CHANNELS.get(name, name) for name in measured["channels"]]
    outputs = ["a residual of the inverse depth"]
    outputs += ["a gate that weighs it"] if network["gate"] else []
    outputs += ["the expected error"] if network["confidence"] else []
    facts = {
        "file": f"`resdepth_colmap/weights/{measured['file']}`, "
        f"{measured['megabytes']} MB; SHA-256 begins `{short_hash(measured)}`",
        "network": f"U-Net, {network['levels']} levels, {network['base_channels']} to "
        f"{network['max_channels']} channels, "
        f"{measured['num_parameters'] / 1e6:.1f} million parameters"
        + _second_network(network),
        "inputs": "; ".join(inputs),
        "outputs": "; ".join(outputs),
        "normalisation": f"{network['normalisation']}, tile by tile",
    }
    return "\n".join(
        ["| | |", "|---|---|", *(f"| {k} | {v} |" for k, v in facts.items())]
    )


def _second_network(network: Mapping[str, Any]) -> str:
    channels = network.get("propagation_channels", 0)
    if not channels:
        return ""
    seen = " sees the first one's features," if network["shared_features"] else ""
    again = (
        " looks at the second photo again and" if network["source_resampling"] else ""
    )
    return (
        f", those of a second, small one among them ({channels} channels at half the "
        f"resolution), which{seen}{again} mixes each pixel's depth from those around it"
    )


def training_table(measured: Mapping[str, Any]) -> str:
    """One row a stage of the training, and the commands."""
    stages = measured["stages"]
    header = (
        "stage | starts from | maps | rooms | views | steps | batch and crop, px | "
        "learning rate | minutes | held-out rooms: MAE ratio | MedAE ratio | weights"
    )
    rows = [_stage_row(place, stage) for place, stage in enumerate(stages, 1)]
    commands = [
        f"    {stage['command']}  # stage {place}"
        for place, stage in enumerate(stages, 1)
        if stage["command"]
    ]
    table = markdown_table(header, rows, num_texts=3)
    return "\n\n".join(
        [f"On {measured['hardware']}:", table, "\n".join(commands)]
    ).rstrip()


def short_hash(measured: Mapping[str, Any]) -> str:
    """The first digits of the file's SHA-256."""
    return str(measured["sha256"][:SHORT_HASH])


def _stage_row(place: int, stage: Mapping[str, Any]) -> list[str]:
    decision = stage["adr"].split("-")[0]
    minutes = stage["minutes"]
    held_out = stage["held_out"] or {}
    crop = " x ".join(str(side_px) for side_px in stage["crop_px"])
    return [
        f"{place} ([ADR {decision}](adr/{stage['adr']}))",
        stage["starts_from"],
        stage["maps"],
        count(stage["num_rooms"]),
        count(stage["num_views"]),
        count(stage["steps"]),
        f"{stage['batch_size']} of {crop}",
        f"{stage['learning_rate']:g}",
        NOT_KNOWN if minutes is None else str(minutes),
        number(held_out.get("mae_ratio"), digits=2),
        number(held_out.get("medae_ratio"), digits=2),
        f"`{stage['weights_sha256'][:SHORT_HASH]}`",
    ]
