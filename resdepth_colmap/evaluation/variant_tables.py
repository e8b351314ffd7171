"""The table of the paper's variants, and whether their order is the paper's."""

from collections.abc import Mapping, Sequence
from typing import Any

from resdepth_colmap.evaluation.markdown import markdown_table, number, percent

ARMS = {
    "unfiltered": "unfiltered PatchMatch",
    "median": "5 x 5 median",
    "unet_stereo": "Unet-stereo (images only)",
    "resdepth_0": "ResDepth-0",
    "resdepth_mono": "ResDepth-mono",
    "resdepth_stereo": "ResDepth-stereo",
    "resdepth_stereo_iter": "ResDepth-stereo_iter",
}
SETS = {"rendered": "held-out rendered scenes", "middlebury": "Middlebury"}

WORST_FIRST = (
    "unet_stereo",
    "resdepth_0",
    "resdepth_mono",
    "resdepth_stereo",
    "resdepth_stereo_iter",
)
"""The paper's order of mean absolute errors (its table of the ablation study)."""


def variants_table(measured: Mapping[str, Any]) -> str:
    """One row a variant and set: errors, and the means of their ratios."""
    network = measured["network"]
    training = (
        f"Each variant: {measured['steps']:,} steps of "
        f"{measured['training']['batch_size']} crops from {measured['num_scenes']} "
        "rendered scenes, "
        f"{network['base_channels']} to {network['max_channels']} channels."
    )
    measured_by = (
        f"Measured by `{measured['command']}` on {measured['date']}, "
        f"{measured['hardware']}."
    )
    parts = [f"{measured_by} {training}"]
    for name, label in SETS.items():
        if name in measured["sets"]:
            parts += _set_parts(label, measured["sets"][name])
    return "\n\n".join(parts)


def out_of_order(maes: Mapping[str, float]) -> list[tuple[str, str]]:
    """Pairs of variants of which the paper's worse one is the better one here.

    Args:
        maes: Mean absolute error by the names of `WORST_FIRST`; some may be missing.
    """
    names = [name for name in WORST_FIRST if name in maes]
    return [
        (worse, better)
        for place, worse in enumerate(names)
        for better in names[place + 1 :]
        if maes[worse] < maes[better]
    ]


def _set_parts(label: str, result: Mapping[str, Any]) -> Sequence[str]:
    arms = result["arms"]
    rows = [[ARMS[name], *_cells(arms[name])] for name in ARMS if name in arms]
    header = (
        "variant | MAE, m | RMSE, m | MedAE, mm | off by > 2 % | "
        "MAE ratio | MedAE ratio"
    )
    swapped = out_of_order({name: arm["mae"] for name, arm in arms.items()})
    order = "The order is the paper's."
    if swapped:
        pairs = "; ".join(f"{ARMS[a]} beats {ARMS[b]}" for a, b in swapped)
        order = f"Unlike in the paper: {pairs}."
    return [
        f"{label.capitalize()}, {result['num_views']} views:",
        markdown_table(header, rows),
        order,
    ]


def _cells(arm: Mapping[str, Any]) -> list[str]:
    return [
        number(arm["mae"]),
        number(arm["rmse"]),
        number(arm["medae"], scale=1000, digits=1),
        percent(arm["bad_2"]),
        number(arm["mae_ratio"], digits=2),
        number(arm["medae_ratio"], digits=2),
    ]
