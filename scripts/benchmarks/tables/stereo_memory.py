"""The table of the matcher's memory, and how soon it starts."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import HARDWARE, markdown_table, number

Measured = Mapping[str, Any]

BYTES_PER_MIB = 1 << 20


def stereo_memory_table(measured: Measured) -> str:
    """Memory by size and number of views, its growth, and the start."""
    rows, sentences = [], []
    for size, series in measured["sizes"].items():
        cache = f"{1024 * series['options']['cache_size']:.1f}"
        for run in series["runs"]:
            cells = [
                number(mb, digits=0) for mb in (run["peak_memory_mb"], _later(run))
            ]
            rows.append([size, str(run["views"]), cache, *cells])
        if len(series["runs"]) > 1:
            sentences.append(_growth_sentence(size, series["runs"]))
    header = (
        "size, px | views | `cache_size`, MiB | peak, MiB | after the first step, MiB"
    )
    parts = [_measured_by(measured), markdown_table(header, rows), *sentences]
    if "start" in measured:
        start = measured["start"]
        parts.append(
            f"From the call of the program to the first progress: {start['cold_s']:.0f}"
            f" s with nothing compiled, {start['warm_s']:.1f} s later."
        )
    return "\n\n".join(parts)


def _measured_by(measured: Measured) -> str:
    commands = [
        f"`{series['command']}` on {series['date']}"
        for series in measured["sizes"].values()
    ]
    return f"Measured by {' and '.join(commands)}, {HARDWARE}."


def _later(run: Measured) -> float | None:
    """The peak after the first step, where it was measured."""
    tenths = run.get("tenths_mb")
    return max(tenths) if tenths else None


def _growth_sentence(size: str, runs: list[Measured]) -> str:
    """From the fewest views to the most: in all, and a view beside one of its maps."""
    in_order = sorted(runs, key=lambda run: run["views"])
    few, many = in_order[0], in_order[-1]
    grown_mb = max(many["tenths_mb"]) - max(few["tenths_mb"])
    width_px, height_px = (int(side) for side in size.split(" x "))
    map_mb = 4 * width_px * height_px / BYTES_PER_MIB
    share = grown_mb / (many["views"] - few["views"]) / map_mb
    tenths = ", ".join(f"{peak:.1f}" for peak in many["tenths_mb"])
    return (
        f"Views of {size} px: from {few['views']} to {many['views']} of them the peak "
        f"after the first step changes by {grown_mb:+.1f} MiB, {share:+.2f} of one map "
        f"of {map_mb:.2f} MiB a view. In the tenths of the longest run it is {tenths} "
        "MiB."
    )
