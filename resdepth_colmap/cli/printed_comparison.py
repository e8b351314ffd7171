"""The tables that `compare` prints."""

from collections.abc import Mapping, Sequence
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
    from rich.table import Table

    table = Table(title="clouds")
    for header in ("fusion", "method"):
        table.add_column(header)
    for header in ("points", "tolerance", "accuracy", "complete", "F1"):
        table.add_column(header, justify="right")
    notes: dict[str, list[str]] = {}
    for fuser, methods in clouds.items():
        for method, cloud in methods.items():
            for row in _cloud_rows(cloud):
                table.add_row(_FUSERS[fuser], method, *row)
            if cloud["note"]:
                note = f"{_FUSERS[fuser]}: {cloud['note']}"
                notes.setdefault(note, []).append(method)
        table.add_section()
    show_table(table)
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
    _show_means(methods, measured)
    for pair, differences in found["paired"].items():
        _show_differences(pair, differences, measured)
    width = max(map(len, measured)) + 2
    for name in measured:
        click.echo(f"{name:<{width}}{MEASURES[name]}")


def _show_means(methods: Mapping[str, Any], measured: Sequence[str]) -> None:
    from rich.table import Table

    table = Table("measure, %", title="means over the views")
    for method in methods:
        table.add_column(method, justify="right")
    for name in measured:
        table.add_row(name, *(_percent(values[name]) for values in methods.values()))
    show_table(table)


def _show_differences(
    pair: str, differences: Mapping[str, Any], measured: Sequence[str]
) -> None:
    from rich.table import Table

    table = Table("points of 100", title=f"{pair}, view by view")
    for header in ("mean", "95 %", "median", "better", "worse", "tiles"):
        table.add_column(header, justify="right")
    for name in measured:
        views, tiles = differences[name]["views"], differences[name]["tiles"]
        low, high = views["interval"] or (None, None)
        table.add_row(
            name,
            _points(views["mean"]),
            "-" if low is None else f"{_points(low)} {_points(high)}",
            _points(views["median"]),
            str(views["num_better"]),
            str(views["num_worse"]),
            f"{tiles['num_better']}:{tiles['num_worse']}",
        )
    show_table(table)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def _points(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:+.1f}"
