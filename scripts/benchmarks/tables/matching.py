"""Tables of the CPU PatchMatch: accuracy, speed and memory."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean
from typing import Any

from resdepth_colmap.evaluation.markdown import Measured, at, columns, grouped

KINDS = ("photometric", "geometric")
OPENMVS = {
    "middlebury": {"off_1": 0.261, "median": 0.00287, "cpu_s": 7.3},
    "rendered_rich": {"off_1": 0.062, "median": 0.00015, "cpu_s": 27.0},
    "rendered_weak": {"off_1": 0.095, "median": 0.00072, "cpu_s": 27.0},
}
"""OpenMVS 2.3 on a CPU, cited. Middlebury: full resolution, no filter, one neighbour,
holes are wrong. Rendered: unfiltered, five neighbours."""

TRUTH = [
    *columns("", {"data": "data"}),
    *grouped(
        {**dict(zip(KINDS, KINDS, strict=True)), "openmvs": "OpenMVS 2.3, cited"},
        [
            *columns(".1%", {"off_1": "off by > 1 %"}),
            *columns(".3%", {"median": "median error"}),
            *columns(".1f", {"cpu_s": "s a map"}),
        ],
    ),
    *columns(".1%", {"f1": "cloud: F1"}),
]
LIMITS = {"within_1": "0.01", "within_2": "0.02", "within_5": "0.05"}
NEAREST = {"worst": "within 1 %: worst image", "best": "best image"}
NEAR_COLMAP = [
    *columns("", {"maps": "maps"}),
    *columns(".1%", {key: f"within {key[-1]} %" for key in LIMITS}),
    *columns(".1%", NEAREST),
]
PER_UNIT = {"cpu_s_per_mp_source_iteration": "s a megapixel, source, iteration"}
SPEED = [
    *columns(".2f", {"megapixels": "megapixels"}),
    *columns(",", {"num_sources": "sources"}),
    *columns(".2f", {"cpu_s": "s", **PER_UNIT}),
]


def truth_rows(measured: Measured) -> Iterator[dict[str, Any]]:
    """Mean errors and processor seconds of our maps and OpenMVS's, by data set."""
    parts = {"middlebury": measured["middlebury"], **measured["rendered"]}
    for name, cited in OPENMVS.items():
        mean, seconds = parts[name]["mean"], parts[name]["cpu_s_per_map"]
        ours = {
            kind: {
                "off_1": 1 - mean[kind]["0.01"],
                "median": mean[kind]["median"],
                "cpu_s": seconds[kind],
            }
            for kind in KINDS
        }
        f1 = at(parts[name], "cloud/min_num_pixels=5/f1")
        yield {"data": name.replace("_", " "), **ours, "openmvs": cited, "f1": f1}


def near_colmap_rows(agreement: Measured, measured: Measured) -> Iterator[Any]:
    """Shares of COLMAP's filtered depths of `plant` that each kind of map has.

    Args:
        agreement: The record of COLMAP's unfiltered maps, and of them refined.
        measured: The record of the CPU PatchMatch.
    """
    images = agreement["images"].values()
    yield _near_row("COLMAP's, unfiltered", [it["unfiltered"] for it in images])
    yield _near_row("the same, refined", [it["refined"] for it in images])
    for kind in KINDS:
        shares = [
            {name: entry[kind][limit] for name, limit in LIMITS.items()}
            for entry in measured["plant"]["own_range"]["maps"].values()
        ]
        yield _near_row(f"CPU PatchMatch, {kind}", shares)


def speed_rows(measured: Measured, _memory: Measured) -> list[Any]:
    """Every other size with one source, and every other number of sources."""
    return [*measured["speed"]["sizes"][::2], *measured["speed"]["sources"][1::2]]


def memory_note(measured: Measured, memory: Measured) -> str:
    """Lower bound of the time; peak memory of the largest views; the start."""
    bounds = measured["speed"]["bounds"]
    bound_s = max(bounds["arithmetic_s"], bounds["memory_s"])
    size, series = max(memory["sizes"].items(), key=lambda it: int(it[0].split()[0]))
    peaks = sorted((run["views"], run["peak_memory_mb"]) for run in series["runs"])
    listed = ", ".join(f"{peak_mb:,.0f} MiB for {count}" for count, peak_mb in peaks)
    return (
        f"Lower bound for two sources: {bound_s:.2f} s, of {bounds['ours_s']:.2f} s "
        f"measured. Peak memory by the number of views of {size} px: {listed}. From "
        f"the call to the first progress: {memory['start']['cold_s']:.0f} s with "
        f"nothing compiled, {memory['start']['warm_s']:.1f} s later."
    )


def _near_row(label: str, images: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    nearest = [image["within_1"] for image in images]
    means = {key: fmean(image[key] for image in images) for key in LIMITS}
    return {"maps": label, **means, "worst": min(nearest), "best": max(nearest)}
