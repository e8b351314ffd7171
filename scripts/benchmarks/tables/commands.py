"""The table of what each command takes."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import HARDWARE, markdown_table, number


def command_table(measured: Mapping[str, Any]) -> str:
    """Seconds, processor seconds and peak memory of each command."""
    rows = [
        [
            f"`{row['command']}`",
            row["what"],
            number(row["seconds"], digits=1),
            number(row["cpu_seconds"], digits=1),
            f"{row['peak_memory_mb'] / 1024:.2f} GiB",
        ]
        for row in measured["commands"]
    ]
    return "\n\n".join(
        [
            f"Measured by `{measured['command']}` on {measured['date']}, {HARDWARE}.",
            markdown_table(
                "command | on | seconds | processor seconds | peak memory",
                rows,
                num_texts=2,
            ),
        ]
    )
