"""What the commands print on stdout."""

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from resdepth_colmap.pipeline.info import Inspection
    from resdepth_colmap.pipeline.run import RunResult
    from resdepth_colmap.report.image_maps import ImageErrors

LABEL_WIDTH = 16


def show_line(label: str, text: object) -> None:
    """One fact: a label and what there is to say."""
    click.echo(f"{label:<{LABEL_WIDTH}}{text}")


def show_table(
    headers: "Sequence[str]",
    rows: "Iterable[Sequence[str] | None]",
    title: str | None = None,
    num_left: int = 1,
) -> None:
    """A table on stdout; never cut off, also where stdout is no terminal.

    Args:
        headers: Of the columns.
        rows: Cells; None draws a line.
        title: Above the table.
        num_left: How many columns are text, aligned left; the others are numbers.
    """
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title)
    for index, header in enumerate(headers):
        table.add_column(header, justify="left" if index < num_left else "right")
    for row in rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*row)
    Console(soft_wrap=True, highlight=False).print(table)


def duration(seconds: float) -> str:
    """Seconds for people: "45 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def show_run(result: "RunResult") -> None:
    """What `refine` did, and where it lies."""
    refine = result.refine
    show_line("refined", f"{len(refine.refined)} images")
    if refine.kept:
        show_line("kept", f"{len(refine.kept)} images, finished by an earlier run")
    if refine.skipped:
        show_line("skipped", f"{len(refine.skipped)} images (see the log)")
    show_line("depth maps", refine.output.workspace.stereo_path / "depth_maps")
    if result.cloud_path is not None:
        before = result.num_points_before
        points = f"{result.num_points:,} points"
        if before is not None:
            points += f"; {before:,} without refinement"
        show_line("cloud", f"{result.cloud_path} ({points})")
    if result.overview_path is not None:
        show_line("pictures", result.overview_path)
    if result.report_path is not None:
        show_line("report", result.report_path)
    show_line("record", refine.output.record_path)


def show_inspection(found: "Inspection") -> None:
    """What `info` found, for people."""
    first, *_, last = [f"{w} x {h}" for w, h, _ in found.image_sizes] * 2
    sizes = first if len(found.image_sizes) == 1 else f"{first} to {last}"
    show_line("workspace", found.path)
    show_line("images", f"{found.num_views} ({sizes} px)")
    show_line("missing images", len(found.missing_images))
    show_line("cameras", found.num_cameras)
    show_line("sparse points", f"{found.num_points:,}" if found.num_points else "none")
    masks = f"{found.masks} ({found.num_masked} of {found.num_views} images)"
    show_line("masks", masks if found.masks else "none")
    show_line("cfg files", ", ".join(found.cfg_files) or "none")
    if found.maps:
        rows = [
            (
                kind,
                f"{summary.num_maps} of {found.num_views}",
                f"{summary.num_normal_maps} of {found.num_views}",
                f"{summary.filled:.1%} (mean of {summary.num_read})",
            )
            for kind, summary in found.maps.items()
        ]
        show_table(("maps", "depth", "normal", "filled"), rows, num_left=4)
    else:
        show_line("depth maps", "none")
    _show_plan(found)
    for warning in found.warnings:
        show_line("warning", warning)


def _show_plan(found: "Inspection") -> None:
    origin = {
        "existing": "the maps that are there",
        "colmap": "COLMAP's PatchMatch (CUDA)",
        "cpu": "PatchMatch on the CPU",
    }
    cost = found.estimate
    show_line("refine would", f"take depth from {origin[str(found.stereo_backend)]},")
    if found.maps and found.num_matched:
        show_line("", f"match {found.num_matched} of {found.num_views} images")
    show_line("", f"refine {found.num_refined} of {found.num_views} images")
    if found.num_fresh:
        show_line("", f"keep {found.num_fresh}, whose refined maps are up to date")
    if cost.stereo_s:
        show_line("PatchMatch", f"about {duration(cost.stereo_s)}")
    show_line("refinement", f"about {duration(cost.refine_s)}")
    show_line("memory", f"about {cost.memory_mb / 1024:.1f} GiB")


def show_comparison(comparisons: "Sequence[ImageErrors]") -> None:
    """The error of each image's depth before and after, and the mean over them."""
    errors = {
        name: (before.mae, after.mae, before.bad_2, after.bad_2)
        for name, before, after in comparisons
    }
    columns = zip(*errors.values(), strict=True)
    mean = [sum(column) / len(comparisons) for column in columns]
    rows = [_error_row(name, *values) for name, values in errors.items()]
    headers = ("image", "mean error", "refined", "off by > 2 %", "refined")
    show_table(headers, [*rows, None, _error_row("mean", *mean)], num_left=5)


def _error_row(
    name: str, mae_before: float, mae_after: float, bad_before: float, bad_after: float
) -> tuple[str, ...]:
    change = (
        f"{mae_after:.4f} ({mae_after / mae_before - 1:+.0%})" if mae_before else ""
    )
    return (name, f"{mae_before:.4f}", change, f"{bad_before:.1%}", f"{bad_after:.1%}")
