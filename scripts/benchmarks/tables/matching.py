"""The tables of the CPU PatchMatch: beside COLMAP's maps, the truth, and OpenMVS."""

from collections.abc import Mapping
from typing import Any

from resdepth_colmap.evaluation.markdown import (
    HARDWARE,
    NOT_KNOWN,
    count,
    markdown_table,
    number,
    percent,
)

Measured = Mapping[str, Any]

KINDS = ("photometric", "geometric")
OPENMVS = "OpenMVS 2.3 (CPU)"
OPENMVS_MIDDLEBURY = {"off_1": 0.261, "off_2": 0.196, "median": 0.00287, "cpu_s": 7.3}
"""Cited: full resolution, no post-filter, one neighbour; holes are wrong."""

OPENMVS_RENDERED = {
    "rendered_rich": {"0.01": 0.938, "median": 0.00015, "cpu_s": 27.0},
    "rendered_weak": {"0.01": 0.905, "median": 0.00072, "cpu_s": 27.0},
}
"""Cited: unfiltered, five neighbours."""


def matching_table(measured: Measured) -> str:
    """All parts that were measured."""
    parts = [
        f"Measured by `{measured['command']}` on {measured['date']}, {HARDWARE}; one "
        "thread, processor seconds."
    ]
    for name, render in PARTS.items():
        if name in measured:
            parts += render(measured[name])
    return "\n\n".join(parts)


def _colmap_parts(title: str, part: Measured) -> list[str]:
    rows = [
        [name, percent(entry["pixels"]), *_within(entry)]
        for name, entry in part["maps"].items()
    ]
    rows.append(["**mean**", "", *_within(part["mean"])])
    header = "image | pixels | " + " | ".join(
        f"{kind}: within {limit}" for kind in KINDS for limit in ("1 %", "2 %", "5 %")
    )
    return [title, markdown_table(header, rows), _seconds_sentence(part)]


def _plant(part: Measured) -> list[str]:
    own, known = part["own_range"], part["range_of_maps"]
    near, far = (known["options"][key] for key in ("depth_min", "depth_max"))
    return [
        *_colmap_parts(
            "`plant`, which has no sparse points: pixels of COLMAP's geometric maps, "
            "depth range by our rule:",
            own,
        ),
        *_colmap_parts(
            f"The same between {near:.2f} and {far:.2f}, by the depths of those maps:",
            known,
        ),
    ]


def _middlebury(part: Measured) -> list[str]:
    rows = []
    for name, entry in {**part["maps"], "**mean**": part["mean"]}.items():
        cells = [_truth_cells(entry[kind]) for kind in KINDS]
        rows.append([name, *(cell for group in cells for cell in group)])
    cited = OPENMVS_MIDDLEBURY
    rows.append(
        [
            f"{OPENMVS}, cited: mean",
            percent(cited["median"], digits=3),
            percent(cited["off_1"]),
            percent(cited["off_2"]),
            *[NOT_KNOWN] * 5,
        ]
    )
    header = "scene | " + " | ".join(
        f"{kind}: {column}"
        for kind in KINDS
        for column in ("median error", "off by > 1 %", "> 2 %", "MAE, m")
    )
    return [
        "Middlebury, two views, where both see the surface:",
        markdown_table(header, rows),
        f"{_seconds_sentence(part)} {OPENMVS}: {cited['cpu_s']} s.",
    ]


def _truth_cells(errors: Measured) -> list[str]:
    return [
        percent(errors["median"], digits=3),
        percent(1 - errors["0.01"]),
        percent(1 - errors["0.02"]),
        number(errors["mae"]),
    ]


def _rendered(part: Measured) -> list[str]:
    scenes = {name: part[name] for name in OPENMVS_RENDERED if name in part}
    rows, clouds = [], []
    for name, scene in scenes.items():
        spoken = name.replace("_", " ")
        for kind in KINDS:
            errors, seconds = scene["mean"][kind], scene["cpu_s_per_map"][kind]
            rows.append([spoken, kind, *_rendered_cells(errors, seconds)])
        cited = OPENMVS_RENDERED[name]
        cells = _rendered_cells(cited, cited["cpu_s"])
        rows.append([spoken, f"{OPENMVS}, cited", *cells])
        clouds += _cloud_rows(spoken, scene)
    return [
        "Six rendered views with exact depth, five sources each, all true pixels; the "
        "seconds of the geometric pass come on top of those of the photometric one:",
        markdown_table(
            "scene | maps | within 1 % | median error | s a view", rows, num_texts=2
        ),
        "The filtered geometric maps at 1 % of the depth, and the cloud that COLMAP's "
        "`stereo_fusion` makes of them (its default options; `min_num_pixels` as said) "
        "at 1 % of the mean depth:",
        markdown_table(
            "scene | what | accuracy | completeness | F1 | points", clouds, num_texts=2
        ),
    ]


def _rendered_cells(errors: Measured, seconds: float | None) -> list[str]:
    return [
        percent(errors["0.01"]),
        percent(errors["median"], digits=3),
        number(seconds, digits=1),
    ]


def _cloud_rows(name: str, scene: Measured) -> list[list[str]]:
    kept = scene["mean"]["filtered"]
    shares = [percent(kept["accuracy"]), percent(kept["completeness"])]
    rows = [[name, "filtered maps", *shares, NOT_KNOWN, NOT_KNOWN]]
    for options, cloud in scene["cloud"].items():
        if not isinstance(cloud, Mapping):
            continue
        shares = [percent(cloud[key]) for key in ("accuracy", "completeness", "f1")]
        rows.append([name, f"cloud, `{options}`", *shares, count(cloud["points"])])
    return rows


def _speed(part: Measured) -> list[str]:
    rows = [
        [
            f"{run['megapixels']:.2f}",
            str(run["num_sources"]),
            number(run["cpu_s"], digits=2),
            number(run["cpu_s_per_mp_source_iteration"], digits=2),
        ]
        for run in (*part["sizes"], *part["sources"])
    ]
    bounds = part["bounds"]
    threads = "; ".join(
        f"{run['threads']} of them: {run['wall_s']:.2f} s on the wall, "
        f"{run['cpu_s']:.2f} s of processors"
        for run in part["threads"]
    )
    return [
        f"Speed of the photometric pass on noise, {part['num_iterations']} iterations:",
        markdown_table(
            "megapixels | sources | s | s a megapixel, source and iteration",
            rows,
            num_texts=0,
        ),
        f"Threads: {threads}; beside other jobs (load {part['load'][0]:.1f}).",
        f"Bounds: {bounds['evaluations_per_px_source_iteration']:.1f} window costs a "
        "pixel, source and iteration at "
        f"{bounds['ns_per_evaluation_in_cache']:.0f} ns with all data in the nearest "
        f"cache make {bounds['arithmetic_s']:.2f} s; streaming what has to come from "
        f"memory at {bounds['gb_per_s']:.1f} GB/s, {bounds['memory_s']:.3f} s. We take "
        f"{bounds['ours_s']:.2f} s: {bounds['ours_over_bound']:.2f} times the nearer "
        "bound, which is arithmetic."
        if bounds["arithmetic_s"] >= bounds["memory_s"]
        else f"Bounds: memory, {bounds['memory_s']:.3f} s; we take "
        f"{bounds['ours_s']:.2f} s, {bounds['ours_over_bound']:.2f} times that.",
    ]


def _within(entry: Measured) -> list[str]:
    return [
        percent(entry[kind][limit]) if kind in entry else NOT_KNOWN
        for kind in KINDS
        for limit in ("0.01", "0.02", "0.05")
    ]


def _seconds_sentence(part: Measured) -> str:
    first, second = (part["cpu_s_per_map"][kind] for kind in KINDS)
    return (
        f"Processor seconds a map: {number(first, digits=1)} photometric, "
        f"{number(second, digits=1)} more geometric."
    )


PARTS = {
    "middlebury": _middlebury,
    "rendered": _rendered,
    "plant": _plant,
    "speed": _speed,
}
"""In the order of the document."""
