"""What `evaluate depth` found, as Markdown tables."""

from collections.abc import Iterator, Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import (
    count,
    markdown_table,
    number,
    percent,
)

Measured = Mapping[str, Any]
"""The JSON of a result, parsed."""

DEPTHS = {"unfiltered": "unfiltered", "median": "5 x 5 median", "refined": "refined"}
OVERALL = "**overall**"
_PARTS = {"edges": "edges", "flat": "flat areas"}


def depth_table(measured: Measured) -> str:
    """Errors of every scene and over all pixels; edges and flat areas apart.

    Args:
        measured: `DepthReport.to_mapping()`.
    """
    if not measured["scenes"]:
        return "No scene could be compared."
    return "\n\n".join(
        [
            f"Errors in workspace units, {residuals_said(measured)}; "
            f"weights `{measured['weights_sha256'][:12]}`.",
            markdown_table(
                "scene | depth | MAE | RMSE | MedAE | off by > 1 % | off by > 2 % | "
                "valid pixels | of",
                [
                    [name, label, *_error_cells(errors[method])]
                    for name, errors in result_rows(measured)
                    for method, label in DEPTHS.items()
                ],
                num_texts=2,
            ),
            parts_table(measured),
            origins(measured),
        ]
    )


def parts_table(measured: Measured) -> str:
    """Errors at edges and in flat areas."""
    header = "scene | depth" + "".join(
        f" | MAE: {part} | MedAE: {part} | off by > 2 %: {part} | pixels: {part}"
        for part in _PARTS.values()
    )
    rows = [
        [
            name,
            label,
            *(cell for part in _PARTS for cell in _part_cells(errors[part][method])),
        ]
        for name, errors in result_rows(measured)
        for method, label in DEPTHS.items()
    ]
    return markdown_table(header, rows, num_texts=2)


def residuals_said(measured: Measured, unit: str = "units") -> str:
    """Which residuals were discarded, before means and medians were taken."""
    limit = measured["options"]["max_residual"]
    if limit is None:
        return "no residual discarded"
    return f"residuals beyond {limit:g} {unit} discarded"


def origins(measured: Measured) -> str:
    """Whose the unfiltered depth is."""
    scenes: dict[str, list[str]] = {}
    for name, scene in measured["scenes"].items():
        scenes.setdefault(", ".join(scene["initial"]), []).append(name)
    if len(scenes) == 1:
        return f"Unfiltered depth: {next(iter(scenes))}."
    listed = "; ".join(f"{origin} ({', '.join(n)})" for origin, n in scenes.items())
    return f"Unfiltered depth: {listed}."


def result_rows(measured: Measured) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The scenes and, where there are several, all pixels of all of them."""
    yield from measured["scenes"].items()
    if len(measured["scenes"]) > 1:
        yield OVERALL, measured["overall"]


def _error_cells(errors: Measured) -> list[str]:
    return [
        number(errors["mae"], digits=4),
        number(errors["rmse"], digits=4),
        number(errors["medae"], digits=4),
        percent(errors["bad_1"]),
        percent(errors["bad_2"]),
        count(errors["num_valid"]),
        count(errors["num_pixels"]),
    ]


def _part_cells(errors: Measured) -> list[str]:
    return [
        number(errors["mae"], digits=4),
        number(errors["medae"], digits=4),
        percent(errors["bad_2"]),
        count(errors["num_pixels"]),
    ]
