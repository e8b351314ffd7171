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
from resdepth_colmap.evaluation.markdown import Column, Measured, table

PAPER = (
    Column("scene", "scene"),
    Column("pairs", "num_views", ","),
    Column("refined: MAE", "refined/mae", ".2f"),
    Column("RMSE", "refined/rmse", ".2f"),
    Column("unfiltered: MAE", "unfiltered/mae", ".2f"),
    Column("RMSE", "unfiltered/rmse", ".2f"),
    Column("paper: pairs", "paper/num_pairs", ","),
    Column("ResDepth-stereo: MAE", "paper/refined_mae", ".2f"),
    Column("RMSE", "paper/refined_rmse", ".2f"),
    Column("COLMAP (unfilt.): MAE", "paper/unfiltered_mae", ".2f"),
    Column("RMSE", "paper/unfiltered_rmse", ".2f"),
)
ERRORS = (
    *NAMES,
    Column("MAE, m", "mae", ".3f"),
    Column("RMSE, m", "rmse", ".3f"),
    Column("MedAE, m", "medae", ".3f"),
    Column("off by > 1 cm", "bad_1cm", ".1%"),
    Column("> 2 cm", "bad_2cm", ".1%"),
    Column("> 5 cm", "bad_5cm", ".1%"),
    *PIXELS,
)
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
