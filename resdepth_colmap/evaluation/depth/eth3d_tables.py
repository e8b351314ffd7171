"""What `evaluate eth3d` found: the shape of the paper's table, and more detail."""

from resdepth_colmap.evaluation.datasets.paper import (
    PAPER_OVERALL,
    PAPER_ROWS,
    PaperRow,
)
from resdepth_colmap.evaluation.depth.tables import (
    DEPTHS,
    OVERALL,
    Measured,
    origins,
    parts_table,
    residuals_said,
    result_rows,
)
from resdepth_colmap.evaluation.markdown import count, markdown_table, number, percent

_CAVEAT = (
    "The paper's figures are those of its table, not measured here: of other pairs, "
    "picked by hand, refined by a network that was trained on ETH3D."
)


def eth3d_table(measured: Measured) -> str:
    """The paper's table with both figures, then medians, shares, edges and flat areas.

    Args:
        measured: `DepthReport.to_mapping()` with a "protocol".
    """
    protocol = measured["protocol"]
    said = (
        f"Images {protocol['image_width_px']} px wide, pairs {protocol['pairs']}; "
        f"{residuals_said(measured, 'm')}; "
        f"weights `{measured['weights_sha256'][:12]}`."
    )
    if not measured["scenes"]:
        return "No scene could be compared."
    tables = [paper_table(measured), errors_table(measured), parts_table(measured)]
    return "\n\n".join([said, origins(measured), *tables, _CAVEAT])


def paper_table(measured: Measured) -> str:
    """The paper's table: its scenes in its order, then others; errors in metres."""
    scenes = measured["scenes"]
    names = [*PAPER_ROWS, *(name for name in scenes if name not in PAPER_ROWS)]
    rows = [_paper_row(name, scenes.get(name), PAPER_ROWS.get(name)) for name in names]
    num_pairs = sum(scene["num_views"] for scene in scenes.values())
    overall = {**measured["overall"], "num_views": num_pairs}
    return markdown_table(
        "scene | pairs | refined: MAE | RMSE | unfiltered: MAE | RMSE | "
        "paper: pairs | ResDepth-stereo: MAE | RMSE | COLMAP (unfilt.): MAE | RMSE",
        [*rows, _paper_row(OVERALL, overall, PAPER_OVERALL)],
    )


def errors_table(measured: Measured) -> str:
    """Every depth of every scene: errors in metres, shares off by centimetres."""
    rows = [
        [name, label, *_error_cells(errors[method])]
        for name, errors in result_rows(measured)
        for method, label in DEPTHS.items()
    ]
    return markdown_table(
        "scene | depth | MAE, m | RMSE, m | MedAE, m | off by > 1 cm | > 2 cm | "
        "> 5 cm | valid pixels | of",
        rows,
        num_texts=2,
    )


def _paper_row(name: str, scene: Measured | None, paper: PaperRow | None) -> list[str]:
    measured: list[float | None] = [None] * 4
    if scene is not None:
        measured = [
            scene[method][error]
            for method in ("refined", "unfiltered")
            for error in ("mae", "rmse")
        ]
    published: list[float | None] = [None] * 4
    if paper is not None:
        published = list(paper[1:])
    return [
        name,
        count(scene["num_views"] if scene else None),
        *[number(value, digits=2) for value in measured],
        count(paper.num_pairs if paper else None),
        *[number(value, digits=2) for value in published],
    ]


def _error_cells(errors: Measured) -> list[str]:
    return [
        *[number(errors[name]) for name in ("mae", "rmse", "medae")],
        *[percent(errors[name]) for name in ("bad_1cm", "bad_2cm", "bad_5cm")],
        count(errors["num_valid"]),
        count(errors["num_pixels"]),
    ]
