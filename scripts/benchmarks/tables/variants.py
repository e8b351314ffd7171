"""The tables of the paper's variants, and of what was added to the paper."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from resdepth_colmap.evaluation.markdown import markdown_table, number, percent

METHODS = {
    "unfiltered": "unfiltered PatchMatch",
    "median": "5 x 5 median",
    "unet_stereo": "Unet-stereo (images only)",
    "resdepth_0": "ResDepth-0",
    "resdepth_mono": "ResDepth-mono",
    "resdepth_stereo": "ResDepth-stereo",
    "resdepth_stereo_iter": "ResDepth-stereo_iter",
}
BEYOND = {
    "unfiltered": "unfiltered PatchMatch",
    "resdepth_stereo": "ResDepth-stereo (the paper's)",
    "robust": "+ robust normalisation",
    "inputs": "+ validity and photo-consistency as inputs",
    "last_block": "+ last block at full resolution",
    "gate": "+ learned gate",
    "loss": "+ relative and logarithmic loss",
    "confidence": "+ confidence head (Laplace likelihood)",
    "source_depth": "+ depth maps of other views (completion, two inputs)",
    "holes": "+ filtered and unfiltered maps in one network",
    "color": "+ the reference in colour",
    "length": "+ errors in units of length in the loss",
    "propagation": "+ a second network that mixes depths",
    "two_passes": "the same, two passes with shared weights",
}
LEAST_CHANGE = 0.02
"""A smaller change of a ratio is not told: views are few, and trainings short."""

SETS = {"rendered": "held-out rendered scenes", "middlebury": "Middlebury"}

NORMALISATIONS = {
    "robust": "minus the tile's median, over half the tile's 10-90 % spread",
    "baseline": "times the baseline, minus the tile's mean",
}

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
    kind = NORMALISATIONS[measured["network"]["normalisation"]]
    parts = [f"{_measured_by(measured)} Its inverse depth: {kind}."]
    for name, label in SETS.items():
        if name in measured["sets"]:
            parts += _set_parts(label, measured["sets"][name])
    return "\n\n".join(parts)


def beyond_table(measured: Mapping[str, Any]) -> str:
    """One row an addition: the ratios, and what is off, on each set."""
    sets = {key: measured["sets"][key] for key in SETS if key in measured["sets"]}
    columns = [
        f"{label}: {SETS[key]}, {result['num_views']} views" if place == 0 else label
        for key, result in sets.items()
        for place, label in enumerate(("MAE ratio", "MedAE ratio", "off by > 2 %"))
    ]
    rows = [
        [
            label,
            *(cell for it in sets.values() for cell in _ratios(it["methods"][name])),
        ]
        for name, label in BEYOND.items()
        if all(name in result["methods"] for result in sets.values())
    ]
    table = markdown_table(" | ".join(["network", *columns]), rows)
    told = [_changes(SETS[key], result["methods"]) for key, result in sets.items()]
    return "\n\n".join([_measured_by(measured), table, *told])


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


def _changes(label: str, methods: Mapping[str, Any]) -> str:
    """Which additions changed a ratio, each against the row before it."""
    names = [name for name in BEYOND if name in methods and name != "unfiltered"]
    told = []
    for key, measure in (("mae_ratio", "MAE"), ("medae_ratio", "MedAE")):
        better: list[str] = []
        worse: list[str] = []
        for before, name in itertools.pairwise(names):
            change = methods[name][key] - methods[before][key]
            if abs(change) >= LEAST_CHANGE:
                kind = better if change < 0 else worse
                kind.append(f"{BEYOND[name].removeprefix('+ ')} ({change:+.2f})")
        told.append(
            f"{measure} ratio lower with {'; '.join(better) or 'nothing'}, "
            f"higher with {'; '.join(worse) or 'nothing'}"
        )
    return (
        f"{label.capitalize()}, changes of at least {LEAST_CHANGE} against the row "
        f"before: {'. '.join(told)}."
    )


def _measured_by(measured: Mapping[str, Any]) -> str:
    network, training = measured["network"], measured["training"]
    return (
        f"Measured by `{measured['command']}` on {measured['date']}, "
        f"{measured['hardware']}. Each network: {measured['steps']:,} steps of "
        f"{training['batch_size']} crops of {training['crop_px']} px from "
        f"{measured['num_scenes']} rendered scenes, learning rate "
        f"{training['learning_rate']:g}, {network['base_channels']} to "
        f"{network['max_channels']} channels."
    )


def _set_parts(label: str, result: Mapping[str, Any]) -> Sequence[str]:
    methods = result["methods"]
    rows = [
        [METHODS[name], *_cells(methods[name])] for name in METHODS if name in methods
    ]
    header = (
        "variant | MAE, m | RMSE, m | MedAE, mm | off by > 2 % | "
        "MAE ratio | MedAE ratio"
    )
    swapped = out_of_order({name: method["mae"] for name, method in methods.items()})
    order = "The order is the paper's."
    if swapped:
        pairs = "; ".join(f"{METHODS[a]} beats {METHODS[b]}" for a, b in swapped)
        order = f"Unlike in the paper: {pairs}."
    return [
        f"{label.capitalize()}, {result['num_views']} views:",
        markdown_table(header, rows),
        order,
    ]


def _cells(method: Mapping[str, Any]) -> list[str]:
    return [
        number(method["mae"]),
        number(method["rmse"]),
        number(method["medae"], scale=1000, digits=1),
        percent(method["bad_2"]),
        number(method["mae_ratio"], digits=2),
        number(method["medae_ratio"], digits=2),
    ]


def _ratios(method: Mapping[str, Any]) -> list[str]:
    return [
        number(method["mae_ratio"], digits=2),
        number(method["medae_ratio"], digits=2),
        percent(method["bad_2"]),
    ]
