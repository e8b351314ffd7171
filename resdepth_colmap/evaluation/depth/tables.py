"""The tables that evaluate depth and evaluate eth3d print."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.datasets.paper import PAPER_OVERALL, PAPER_ROWS
from resdepth_colmap.evaluation.markdown import Measured, columns, grouped, table

DEPTHS = {"unfiltered": "unfiltered", "median": "5 x 5 median", "refined": "refined"}
"""The depth maps that are compared, and what tables call them."""

OVERALL = "**overall**"
NO_SCENE = "No scene could be compared."
NAMES = columns("", {"scene": "scene", "depth": "depth"})
PIXELS = columns(",", {"num_valid": "valid pixels", "num_pixels": "of"})
ERRORS = [
    *NAMES,
    *columns(".4f", {"mae": "MAE", "rmse": "RMSE", "medae": "MedAE"}),
    *columns(".1%", {"bad_1": "off by > 1 %", "bad_2": "off by > 2 %"}),
    *PIXELS,
]
REGIONS = {"edges": "edges", "flat": "flat areas"}
REGION_ERRORS = [
    *NAMES,
    *grouped(
        REGIONS,
        [
            *columns(".4f", {"mae": "MAE", "medae": "MedAE"}),
            *columns(".1%", {"bad_2": "off by > 2 %"}),
            *columns(",", {"num_pixels": "pixels"}),
        ],
    ),
]


def depth_table(measured: Measured) -> str:
    """Errors of every scene and over all pixels; edges and flat areas apart.

    Args:
        measured: `DepthReport.to_mapping()`.
    """
    if not measured["scenes"]:
        return NO_SCENE
    return "\n\n".join(
        [
            f"Errors in workspace units, {discarded(measured)}; "
            f"weights `{measured['weights_sha256'][:12]}`.",
            table(ERRORS, error_rows(measured)),
            table(REGION_ERRORS, error_rows(measured)),
            origins(measured),
        ]
    )


def error_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """A row for each depth of each scene and, where there are several, of all pixels.

    Yields:
        Names of scene and depth, the errors, and those of each region.
    """
    scenes = dict(measured["scenes"])
    if len(scenes) > 1:
        scenes[OVERALL] = measured["overall"]
    for scene, errors in scenes.items():
        for method, label in DEPTHS.items():
            regions = {region: errors[region][method] for region in REGIONS}
            yield {"scene": scene, "depth": label, **errors[method], **regions}


def discarded(measured: Measured, unit: str = "units") -> str:
    """Which residuals are discarded before means and medians are taken."""
    limit = measured["options"]["max_residual"]
    if limit is None:
        return "no residual discarded"
    return f"residuals beyond {limit:g} {unit} discarded"


def origins(measured: Measured) -> str:
    """Where the unfiltered depth comes from."""
    scenes: dict[str, list[str]] = {}
    for name, scene in measured["scenes"].items():
        scenes.setdefault(", ".join(scene["initial"]), []).append(name)
    if len(scenes) == 1:
        return f"Unfiltered depth: {next(iter(scenes))}."
    listed = "; ".join(f"{origin} ({', '.join(n)})" for origin, n in scenes.items())
    return f"Unfiltered depth: {listed}."


SCORES = {
    "refined/mae": "refined: MAE",
    "refined/rmse": "RMSE",
    "unfiltered/mae": "unfiltered: MAE",
    "unfiltered/rmse": "RMSE",
}
PUBLISHED = {
    "paper/refined_mae": "ResDepth-stereo: MAE",
    "paper/refined_rmse": "RMSE",
    "paper/unfiltered_mae": "COLMAP (unfilt.): MAE",
    "paper/unfiltered_rmse": "RMSE",
}
PAPER = [
    *columns("", {"scene": "scene"}),
    *columns(",", {"num_views": "pairs"}),
    *columns(".2f", SCORES),
    *columns(",", {"paper/num_pairs": "paper: pairs"}),
    *columns(".2f", PUBLISHED),
]
ERRORS = [
    *NAMES,
    *columns(".3f", {"mae": "MAE, m", "rmse": "RMSE, m", "medae": "MedAE, m"}),
    *columns(
        ".1%", {"bad_1cm": "off by > 1 cm", "bad_2cm": "> 2 cm", "bad_5cm": "> 5 cm"}
    ),
    *PIXELS,
]
_CAVEAT = (
    "The paper's figures are those of its table, not measured here: of other pairs, "
    "picked by hand, refined by a network that was trained on ETH3D."
)


def eth3d_table(measured: Measured) -> str:
    """The paper's table with both figures, then medians, shares, edges and flat areas.

    Args:
        measured: `DepthReport.to_mapping()` with a "protocol".
    """
    if not measured["scenes"]:
        return NO_SCENE
    protocol = measured["protocol"]
    return "\n\n".join(
        [
            f"Images {protocol['image_width_px']} px wide, pairs {protocol['pairs']}; "
            f"{discarded(measured, 'm')}; "
            f"weights `{measured['weights_sha256'][:12]}`.",
            origins(measured),
            table(PAPER, paper_rows(measured)),
            table(ERRORS, error_rows(measured)),
            table(REGION_ERRORS, error_rows(measured)),
            _CAVEAT,
        ]
    )


def paper_rows(measured: Measured) -> list[dict[str, Any]]:
    """The scenes of the paper in its order, then others, then all pixels."""
    scenes = measured["scenes"]
    rows = [
        {"scene": name, **scenes.get(name, {}), "paper": _published(name)}
        for name in dict.fromkeys([*PAPER_ROWS, *scenes])
    ]
    num_pairs = sum(scene["num_views"] for scene in scenes.values())
    overall = {**measured["overall"], "num_views": num_pairs}
    return [*rows, {"scene": OVERALL, **overall, "paper": PAPER_OVERALL._asdict()}]


def _published(name: str) -> dict[str, Any] | None:
    return PAPER_ROWS[name]._asdict() if name in PAPER_ROWS else None
