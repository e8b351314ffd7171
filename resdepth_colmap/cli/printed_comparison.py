"""The tables that `compare` prints."""

from collections.abc import Mapping
from typing import Any

import click

from resdepth_colmap.cli.printed import show_line, show_table

_FUSERS = {"open3d": "open3d", "colmap": "COLMAP"}


def show_workspaces(result: Mapping[str, Any]) -> None:
    """Print the tables of each workspace.

    Args:
        result: Of `compare_workspaces`.
    """
    for name, found in result["workspaces"].items():
        _show_workspace(name, found)


def _show_workspace(name: str, found: Mapping[str, Any]) -> None:
    show_line("workspace", f"{name} ({len(found['views'])} views compared)")
    for method, facts in found["methods"].items():
        normals = f"normals: {facts['normals']}"
        show_line(method, f"{facts['kind']} maps, {normals}")
    for fuser, settings in found["fusion"].items():
        values = ", ".join(f"{key} {value:g}" for key, value in settings.items())
        show_line(f"fusion {fuser}", values)
    if found["truth"] is not None:
        truth = {k: v for k, v in found["truth"].items() if k != "kind"}
        values = ", ".join(f"{key} {value:,}" for key, value in truth.items())
        show_line("ground truth", f"{found['truth']['kind']}: {values}")
    for note in found["notes"]:
        show_line("note", note)
    _show_clouds(found["clouds"])
    _show_measures(found)


def _show_clouds(clouds: Mapping[str, Any]) -> None:
    rows: list[list[str] | None] = []
    notes: dict[str, list[str]] = {}
    for fuser, methods in clouds.items():
        for method, cloud in methods.items():
            rows += [[_FUSERS[fuser], method, *row] for row in _cloud_rows(cloud)]
            if cloud["note"]:
                note = f"{_FUSERS[fuser]}: {cloud['note']}"
                notes.setdefault(note, []).append(method)
        rows.append(None)
    scores = ("points", "tolerance", "accuracy", "complete", "F1")
    show_table(("fusion", "method", *scores), rows, "clouds", num_left=2)
    for note, of_methods in notes.items():
        show_line("note", f"{', '.join(of_methods)}: {note}.")


def _cloud_rows(cloud: Mapping[str, Any]) -> list[list[str]]:
    scores, num_points = cloud["scores"], cloud["num_points"]
    points = "-" if num_points is None else f"{num_points:,}"
    if scores is None:
        return [[points, "-", "-", "-", "-"]]
    keys = ("accuracy", "completeness", "f1")
    return [
        [
            points,
            f"{tolerance:.4g}",
            *(f"{100 * scores[key][it]:.2f} %" for key in keys),
        ]
        for it, tolerance in enumerate(scores["tolerances"])
    ]


def _show_measures(found: Mapping[str, Any]) -> None:
    from resdepth_colmap.evaluation.metrics.view_maps import MEASURES

    methods = found["measures"]
    measured = [
        name
        for name in MEASURES
        if any(it[name] is not None for it in methods.values())
    ]
    rows = [
        [name, *(_percent(values[name], ".1f") for values in methods.values())]
        for name in measured
    ]
    show_table(("measure, %", *methods), rows, "means over the views")
    headers = ("points of 100", "mean", "95 %", "median", "better", "worse", "tiles")
    for pair, differences in found["paired"].items():
        rows = [_difference_row(name, **differences[name]) for name in measured]
        show_table(headers, rows, f"{pair}, view by view")
    width = max(map(len, measured)) + 2
    for name in measured:
        click.echo(f"{name:<{width}}{MEASURES[name]}")


def _difference_row(
    name: str, views: Mapping[str, Any], tiles: Mapping[str, Any]
) -> list[str]:
    return [
        name,
        _percent(views["mean"]),
        " ".join(map(_percent, views["interval"] or [None])),
        _percent(views["median"]),
        str(views["num_better"]),
        str(views["num_worse"]),
        f"{tiles['num_better']}:{tiles['num_worse']}",
    ]


def _percent(value: float | None, form: str = "+.1f") -> str:
    return "-" if value is None else format(100 * value, form)
