"""The tables of the cloud scores: parity with ETH3D's program, time and memory."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import (
    HARDWARE,
    count,
    markdown_table,
    number,
    percent,
)

SCORES = ("accuracy", "completeness", "f1")
"""What the official program prints, by the names of our JSON."""


def cloud_table(measured: Mapping[str, Any]) -> str:
    """Each score of each case and tolerance, official and ours; seconds and memory."""
    samples = measured["samples"]
    names = ("accuracy", "completeness", "F1")
    header = " | ".join(
        ["case | tolerance, m", *(f"{n}: official | ours" for n in names)]
    )
    rows = [
        _row(name, sample, index)
        for name, sample in samples.items()
        for index in range(len(sample["tolerances"]))
    ]
    sizes = [
        [
            count(size["num_points"]),
            count(size["num_scan_points"]),
            number(size["seconds"], digits=1),
            number(size["cpu_seconds"], digits=1),
            f"{size['peak_memory_mb'] / 1024:.2f} GiB",
        ]
        for size in measured["sizes"]
    ]
    return "\n\n".join(
        [
            f"Measured by `{measured['command']}` on {measured['date']}, {HARDWARE}.",
            "Largest difference in a score: "
            f"{largest_difference(measured) * 100:.4f} percentage points.",
            markdown_table(header, rows),
            markdown_table(
                "points of the cloud | points of the scan | seconds | "
                "processor seconds | peak memory",
                sizes,
                num_texts=0,
            ),
        ]
    )


def largest_difference(measured: Mapping[str, Any]) -> float:
    """Of all scores of all cases, between the official program and ours, in 0..1."""
    differences: list[float] = [
        abs(official - ours)
        for sample in measured["samples"].values()
        for name in SCORES
        for official, ours in zip(
            sample["official"][name], sample["ours"][name], strict=True
        )
    ]
    return max(differences)


def _row(name: str, sample: Mapping[str, Any], index: int) -> list[str]:
    shares = [
        sample[who][score][index] for score in SCORES for who in ("official", "ours")
    ]
    cells = [percent(share, digits=3) for share in shares]
    return [name.replace("_", " "), f"{sample['tolerances'][index]:g}", *cells]
