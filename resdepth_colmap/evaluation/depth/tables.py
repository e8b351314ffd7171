"""The tables that `evaluate depth` and `evaluate eth3d` print."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.datasets.paper import PAPER_OVERALL, PAPER_ROWS
from resdepth_colmap.evaluation.markdown import Measured, columns, grouped, table

DEPTHS = {"unfiltered": "unfiltered", "median": "5 x 5 median", "refined": "refined"}
"""The depth maps that are compared, and what tables call them."""

_OVERALL = "**overall**"
_NO_SCENE = "No scene could be compared."
_NAMES = columns("", {"scene": "scene", "depth": "depth"})
_PIXELS = columns(",", {"num_valid": "valid pixels", "num_pixels": "of"})
_ERRORS = [
    *_NAMES,
    *columns(".4f", {"mae": "MAE", "rmse": "RMSE", "medae": "MedAE"}),
    *columns(".1%", {"bad_1": "off by > 1 %", "bad_2": "off by > 2 %"}),
    *_PIXELS,
]
_ERRORS_IN_METRES = [
    *_NAMES,
    *columns(".3f", {"mae": "MAE, m", "rmse": "RMSE, m", "medae": "MedAE, m"}),
    *columns(".1%", {"bad_1cm": "off by > 1 cm"}),
    *columns(".1%", {"bad_2cm": "> 2 cm", "bad_5cm": "> 5 cm"}),
    *_PIXELS,
]
_REGIONS = {"edges": "edges", "flat": "flat areas"}
_REGION_ERRORS = [
    *_NAMES,
    *grouped(
        _REGIONS,
        [
            *columns(".4f", {"mae": "MAE", "medae": "MedAE"}),
            *columns(".1%", {"bad_2": "off by > 2 %"}),
            *columns(",", {"num_pixels": "pixels"}),
        ],
    ),
]
_PAPER = [
    *columns("", {"scene": "scene"}),
    *columns(",", {"num_views": "pairs"}),
    *columns(".2f", {"refined/mae": "refined: MAE", "refined/rmse": "RMSE"}),
    *columns(".2f", {"unfiltered/mae": "unfiltered: MAE", "unfiltered/rmse": "RMSE"}),
    *columns(",", {"paper/num_pairs": "paper: pairs"}),
    *columns(".2f", {"paper/refined_mae": "ResDepth-stereo: MAE"}),
    *columns(".2f", {"paper/refined_rmse": "RMSE"}),
    *columns(".2f", {"paper/unfiltered_mae": "COLMAP (unfilt.): MAE"}),
    *columns(".2f", {"paper/unfiltered_rmse": "RMSE"}),
]
_CAVEAT = (
    "The paper's figures are those of its table, not measured here: of other pairs, "
    "picked by hand, refined by a network that was trained on ETH3D."
)


def depth_table(measured: Measured) -> str:
    """Errors of every scene and over all pixels; edges and flat areas apart.

    Args:
        measured: `DepthReport.to_mapping()`.
    """
    if not measured["scenes"]:
        return _NO_SCENE
    return "\n\n".join(
        [
            f"Errors in workspace units, {_discarded(measured, 'units')}.",
            table(_ERRORS, _error_rows(measured)),
            table(_REGION_ERRORS, _error_rows(measured)),
            _origins(measured),
        ]
    )


def eth3d_table(measured: Measured) -> str:
    """The paper's table with both figures, then medians, shares, edges and flat areas.

    Args:
        measured: `DepthReport.to_mapping()` with a "protocol".
    """
    if not measured["scenes"]:
        return _NO_SCENE
    protocol = measured["protocol"]
    return "\n\n".join(
        [
            f"Images {protocol['image_width_px']} px wide, pairs {protocol['pairs']}; "
            f"{_discarded(measured, 'm')}.",
            _origins(measured),
            table(_PAPER, _paper_rows(measured)),
            table(_ERRORS_IN_METRES, _error_rows(measured)),
            table(_REGION_ERRORS, _error_rows(measured)),
            _CAVEAT,
        ]
    )


def _paper_rows(measured: Measured) -> list[dict[str, Any]]:
    """The scenes of the paper in its order, then others, then all pixels."""
    scenes = measured["scenes"]
    num_pairs = sum(scene["num_views"] for scene in scenes.values())
    measured_rows = {
        **scenes,
        _OVERALL: {**measured["overall"], "num_views": num_pairs},
    }
    published = {**PAPER_ROWS, _OVERALL: PAPER_OVERALL}
    return [
        {
            "scene": name,
            **measured_rows.get(name, {}),
            "paper": published[name]._asdict() if name in published else None,
        }
        for name in dict.fromkeys([*PAPER_ROWS, *scenes, _OVERALL])
    ]


def _error_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """A row for each depth of each scene and, if there are several, of all pixels."""
    scenes = dict(measured["scenes"])
    if len(scenes) > 1:
        scenes[_OVERALL] = measured["overall"]
    for scene, errors in scenes.items():
        for method, label in DEPTHS.items():
            regions = {region: errors[region][method] for region in _REGIONS}
            yield {"scene": scene, "depth": label, **errors[method], **regions}


def _discarded(measured: Measured, unit: str) -> str:
    """Which residuals are discarded before means and medians are taken; the weights."""
    limit = measured["options"]["max_residual"]
    discarded = (
        "no residual discarded"
        if limit is None
        else f"residuals beyond {limit:g} {unit} discarded"
    )
    return f"{discarded}; weights `{measured['weights_sha256'][:12]}`"


def _origins(measured: Measured) -> str:
    """Where the unfiltered depth comes from."""
    scenes: dict[str, list[str]] = {}
    for name, scene in measured["scenes"].items():
        scenes.setdefault(", ".join(scene["initial"]), []).append(name)
    if len(scenes) == 1:
        return f"Unfiltered depth: {next(iter(scenes))}."
    listed = "; ".join(f"{origin} ({', '.join(n)})" for origin, n in scenes.items())
    return f"Unfiltered depth: {listed}."
