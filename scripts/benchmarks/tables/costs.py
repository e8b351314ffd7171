"""Tables of commands, of real workspaces, and of ETH3D's cloud scores."""

from collections.abc import Iterator
from typing import Any

from resdepth_colmap.evaluation.markdown import Column, Measured, columns

MIB = 1 / 1024
COMMANDS = [
    Column("command", lambda row: f"`{row['command']}`"),
    *columns("", {"what": "on"}),
    *columns(".1f", {"seconds": "seconds", "cpu_seconds": "processor seconds"}),
    *columns(".2f", {"peak_memory_mb": "peak memory, GiB"}, MIB),
]
STAGES = {"seconds/stereo": "stereo, s", "seconds/refine": "refine, s"}
WORKSPACES = [
    *columns("", {"name": "workspace"}),
    Column("command", lambda row: f"`{' '.join(['refine', *row['options']])}`"),
    *columns(",", {"num_images": "images"}),
    *columns(".1f", {**STAGES, "seconds_in_all": "in all, s"}),
    *columns(".1f", {"peak_memory_mb": "peak memory, GiB"}, MIB),
    *columns(",", {"points_before": "points: before", "points_after": "after"}),
    *columns(".0%", {"filled_before": "filled: before", "filled_after": "after"}),
    *columns("", {"date": "date"}),
]
SCORES = ("accuracy", "completeness", "f1")
DIFFERENCE = "largest difference of all scores, points of 100"
CLOUDS = [
    *columns("", {"sample": "sample", "tolerances": "tolerances, m"}),
    *columns(".3%", {"official/f1": "F1 at the smallest: official", "ours/f1": "ours"}),
    *columns(".4f", {"difference": DIFFERENCE}, 100),
]


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
