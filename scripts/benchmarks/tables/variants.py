"""The table of the paper's variants and of the additions to them."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.markdown import Measured, columns, grouped

COLUMNS = [
    *columns("", {"label": "network"}),
    *grouped(
        {"rendered": "held-out rooms", "middlebury": "Middlebury"},
        [
            *columns(".2f", {"mae_ratio": "MAE ratio", "medae_ratio": "MedAE ratio"}),
            *columns(".1%", {"bad_2": "off by > 2 %"}),
        ],
    ),
]
PAPER = {
    "unfiltered": "unfiltered PatchMatch",
    "median": "5 x 5 median",
    "unet_stereo": "Unet-stereo (images only)",
    "resdepth_0": "ResDepth-0",
    "resdepth_mono": "ResDepth-mono",
    "resdepth_stereo": "ResDepth-stereo",
    "resdepth_stereo_iter": "ResDepth-stereo_iter",
}
ADDITIONS = {
    "resdepth_stereo": "ResDepth-stereo with inverse depth times the baseline",
    "inputs": "ResDepth-stereo + validity and photo-consistency as inputs",
    "last_block": "+ last block at full resolution",
    "gate": "+ gate",
    "loss": "+ relative and logarithmic loss",
    "confidence": "+ confidence (Laplace likelihood)",
    "source_depth": "+ maps of other views (completion, two inputs)",
    "holes": "+ filtered and unfiltered maps",
    "color": "+ colour of the reference view",
    "length": "+ errors in units of length in the loss",
    "propagation": "+ propagation (second network)",
    "two_inner_iterations": "the last one, two inner iterations",
}


def variant_rows(variants: Measured, additions: Measured) -> Iterator[dict[str, Any]]:
    """The networks of both records; each addition keeps those before it."""
    for measured, labels in ((variants, PAPER), (additions, ADDITIONS)):
        sets = {key: result["methods"] for key, result in measured["sets"].items()}
        for name, label in labels.items():
            if all(name in methods for methods in sets.values()):
                yield {"label": label, **{key: it[name] for key, it in sets.items()}}


def budget_note(variants: Measured, _additions: Measured) -> str:
    """What each network is trained with."""
    training, network = variants["training"], variants["network"]
    return (
        f"Each network: {variants['steps']:,} steps of {training['batch_size']} crops "
        f"of {training['crop_px']} px from {variants['num_scenes']} rooms, learning "
        f"rate {training['learning_rate']:g}, {network['base_channels']} to "
        f"{network['max_channels']} channels."
    )
