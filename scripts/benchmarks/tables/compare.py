"""The tables of the comparison: scores, witnesses, seconds and memory."""

from collections.abc import Iterator, Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import (
    HARDWARE,
    NOT_KNOWN,
    count,
    markdown_table,
    number,
    percent,
)
from resdepth_colmap.evaluation.metrics.measures import MEASURES

Measured = Mapping[str, Any]

FUSERS = {"open3d": "ours", "colmap": "COLMAP's"}
REFERENCE = "filtered"
_POINTS = 100  # a share in points of 100


def comparison_table(measured: Measured) -> str:
    """All tables, with what each is measured by."""
    results = measured["results"]
    first = next(iter(results.values()))
    parts = [
        f"Measured by `{measured['command']}` on {measured['date']}, {HARDWARE}; "
        f"weights `{measured['weights_sha256'][:12]}`.",
        _settings(first["fusion"]),
        markdown_table(
            "workspace | fusion | arm | points | within | accuracy | completeness | F1",
            [row for name, it in results.items() for row in _cloud_rows(name, it)],
            num_texts=3,
        ),
        *_gains(results),
        "Refined minus filtered, and minus unfiltered: mean difference of the views in "
        "points of 100, its 95 % interval, and the views that got better and worse.",
        markdown_table(
            "workspace | measure | difference | filtered | unfiltered | refined | "
            "mean | from | to | better | worse",
            [row for name, it in results.items() for row in _paired_rows(name, it)],
            num_texts=3,
        ),
        "; ".join(f"*{name}*: {text}" for name, text in MEASURES.items()) + ".",
        markdown_table(
            "workspace | command | seconds | peak memory",
            [row for name, it in results.items() for row in _cost_rows(name, it)],
            num_texts=2,
        ),
    ]
    notes = [f"{n}: {note}" for n, it in results.items() for note in _notes(it)]
    if notes:
        parts.append("\n".join(f"- {note}" for note in notes))
    return "\n\n".join(parts)


def score_gains(result: Measured, fuser: str) -> Iterator[dict[str, float]]:
    """Refined minus filtered scores of each tolerance, in points of 100.

    Args:
        result: `Comparison.to_mapping()`.
        fuser: Whose clouds.

    Yields:
        Tolerance, accuracy, completeness and F1; nothing without truth or the arm.
    """
    clouds = result["clouds"][fuser]
    if REFERENCE not in clouds:
        return
    refined, before = (clouds[method]["scores"] for method in ("refined", REFERENCE))
    if refined is None or before is None:
        return
    for place, tolerance in enumerate(refined["tolerances"]):
        gains = {
            key: _POINTS * (refined[key][place] - before[key][place])
            for key in ("accuracy", "completeness", "f1")
        }
        yield {"tolerance": tolerance, **gains}


def _gains(results: Measured) -> list[str]:
    rows = [
        [name, label, f"{gain['tolerance']:.4g}", *_signed(gain)]
        for name, result in results.items()
        for fuser, label in FUSERS.items()
        for gain in score_gains(result, fuser)
    ]
    if not rows:
        return []
    header = "workspace | fusion | within | accuracy | completeness | F1"
    return [
        "Refined minus filtered, in points of 100:",
        markdown_table(header, rows, num_texts=2),
    ]


def _signed(gain: Mapping[str, float]) -> list[str]:
    return [f"{gain[key]:+.1f}" for key in ("accuracy", "completeness", "f1")]


def _settings(fusion: Measured) -> str:
    said = [
        f"{FUSERS[fuser]}: " + ", ".join(f"`{k}` {v:g}" for k, v in settings.items())
        for fuser, settings in fusion.items()
    ]
    return f"Fusion, the same for all arms ({'; '.join(said)})."


def _cloud_rows(name: str, result: Measured) -> Iterator[list[str]]:
    for fuser, methods in result["clouds"].items():
        for method, cloud in methods.items():
            head = [name, FUSERS[fuser], method, count(cloud["num_points"])]
            scores = cloud["scores"]
            if scores is None:
                yield [*head, *[NOT_KNOWN] * 4]
                continue
            for place, tolerance in enumerate(scores["tolerances"]):
                shares = (
                    scores[it][place] for it in ("accuracy", "completeness", "f1")
                )
                yield [*head, f"{tolerance:.4g}", *map(percent, shares)]


def _paired_rows(name: str, result: Measured) -> Iterator[list[str]]:
    methods = ("filtered", "unfiltered", "refined")
    for pair, differences in result["paired"].items():
        for measure, paired in differences.items():
            views = paired["views"]
            if views["mean"] is None:
                continue
            means = [
                result["measures"].get(method, {}).get(measure) for method in methods
            ]
            low, high = views["interval"] or (None, None)
            yield [
                name,
                measure,
                pair,
                *(number(it, _POINTS, 1) for it in means),
                *(number(it, _POINTS, 1) for it in (views["mean"], low, high)),
                str(views["num_better"]),
                str(views["num_worse"]),
            ]


def _cost_rows(name: str, result: Measured) -> Iterator[list[str]]:
    for command, cost in result["cost"].items():
        memory = f"{cost['peak_memory_mb'] / 1024:.2f} GiB"
        yield [name, command, number(cost["seconds"], digits=1), memory]


def _notes(result: Measured) -> list[str]:
    said = dict.fromkeys(result["notes"])
    for fuser, methods in result["clouds"].items():
        for cloud in methods.values():
            if cloud["note"]:
                said[f"{FUSERS[fuser]} fusion: {cloud['note']}."] = None
    return list(said)
