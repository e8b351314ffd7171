"""The tables that `evaluate eth3d` prints: that of the paper, and more detail."""

from typing import Any

from resdepth_colmap.evaluation.datasets.paper import PAPER_OVERALL, PAPER_ROWS
from resdepth_colmap.evaluation.depth.tables import (
    NAMES,
    NO_SCENE,
    OVERALL,
    PIXELS,
    REGION_ERRORS,
    discarded,
    error_rows,
    origins,
)
from resdepth_colmap.evaluation.markdown import Measured, columns, table

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
