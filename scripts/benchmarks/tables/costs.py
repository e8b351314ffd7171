"""Tables of commands, of real workspaces, and of ETH3D's cloud scores."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.markdown import Column, Measured

COMMANDS = (
    Column("command", lambda row: f"`{row['command']}`"),
    Column("on", "what"),
    Column("seconds", "seconds", ".1f"),
    Column("processor seconds", "cpu_seconds", ".1f"),
    Column("peak memory, GiB", "peak_memory_mb", ".2f", 1 / 1024),
)
WORKSPACES = (
    Column("workspace", "name"),
    Column("command", lambda row: f"`{' '.join(['refine', *row['options']])}`"),
    Column("images", "num_images", ","),
    Column("stereo, s", "seconds/stereo", ".1f"),
    Column("refine, s", "seconds/refine", ".1f"),
    Column("in all, s", "seconds_in_all", ".1f"),
    Column("peak memory, GiB", "peak_memory_mb", ".1f", 1 / 1024),
    Column("points: before", "points_before", ","),
    Column("after", "points_after", ","),
    Column("filled: before", "filled_before", ".0%"),
    Column("after", "filled_after", ".0%"),
    Column("date", "date"),
)
SCORES = ("accuracy", "completeness", "f1")
CLOUDS = (
    Column("sample", "sample"),
    Column("tolerances, m", "tolerances"),
    Column("F1 at the smallest: official", "official/f1", ".3%"),
    Column("ours", "ours/f1", ".3%"),
    Column("largest difference of all scores, points of 100", "difference", ".4f", 100),
)


def workspace_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """The workspaces, with their names."""
    for name, sample in measured["workspaces"].items():
        yield {"name": name, **sample}


def refine_note(_commands: Measured, refine: Measured) -> str:
    """Seconds a megapixel and inner iteration, by size."""
    sizes = ", ".join(
        f"{size['s_per_mp_and_inner_iteration']:.2f} s at {size['width_px']} x "
        f"{size['height_px']} px"
        for size in refine["sizes"]
    )
    return f"One view, one source, a megapixel and inner iteration: {sizes}."


def cloud_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """Scores of the official program and ours, and how far apart they are, in 0..1."""
    for name, sample in measured["samples"].items():
        programs = (sample["official"], sample["ours"])
        pairs = [
            pair
            for score in SCORES
            for pair in zip(*(program[score] for program in programs), strict=True)
        ]
        tolerances = sample["tolerances"]
        yield {
            "sample": name.replace("_", " "),
            "tolerances": f"{len(tolerances)}, {tolerances[0]:g} to {tolerances[-1]:g}",
            "official": {"f1": programs[0]["f1"][0]},
            "ours": {"f1": programs[1]["f1"][0]},
            "difference": max(abs(official - ours) for official, ours in pairs),
        }


def cloud_note(measured: Measured) -> str:
    """Seconds and memory by the number of points."""
    sizes = "; ".join(
        f"{size['num_points']:,} points {size['seconds']:.1f} s and "
        f"{size['peak_memory_mb'] / 1024:.2f} GiB"
        for size in measured["sizes"]
    )
    return f"From files to scores, with a scan of as many points: {sizes}."
