"""Laws of the tables of the matcher."""

from typing import Any

from scripts.benchmarks.tables.matching import matching_table

ERRORS = {"0.01": 0.75, "0.02": 0.875, "0.05": 0.95, "median": 0.00123, "mae": 0.0456}
MAPS = {"pixels": 0.5, "photometric": ERRORS, "geometric": {**ERRORS, "0.02": 0.9375}}
SECONDS = {"photometric": 12.34, "geometric": None}


def part(**more: Any) -> dict[str, Any]:
    return {"maps": {"a.jpg": MAPS}, "mean": MAPS, "cpu_s_per_map": SECONDS, **more}


def rendered() -> dict[str, Any]:
    filtered = {"accuracy": 0.99, "completeness": 0.9, "kept": 0.91}
    cloud = {"points": 12345, "accuracy": 0.9, "completeness": 0.8, "f1": 0.847}
    clouds = {"true_points": 1000, "min_num_pixels=5": cloud}
    scene = part(mean={**MAPS, "filtered": filtered}, cloud=clouds)
    return {"rendered_rich": scene, "rendered_weak": scene}


def speed() -> dict[str, Any]:
    run = {
        "megapixels": 0.3,
        "num_sources": 2,
        "cpu_s": 4.0,
        "cpu_s_per_mp_source_iteration": 3.21,
    }
    bounds = {
        "evaluations_per_px_source_iteration": 9.5,
        "ns_per_evaluation_in_cache": 50.0,
        "ns_per_window_in_cache": 40.0,
        "gb_per_s": 10.0,
        "arithmetic_s": 2.0,
        "memory_s": 0.01,
        "ours_s": 4.0,
        "ours_over_bound": 2.0,
    }
    threads = [{"threads": 1, "cpu_s": 4.0, "wall_s": 5.0}]
    lists = {"threads": threads, "sources": [run], "sizes": [run], "load": [1.0, 2.0]}
    return {**lists, "bounds": bounds, "num_iterations": 2}


def measured() -> dict[str, Any]:
    options = {"depth_min": 1.5, "depth_max": 12.0}
    plant = {label: part(options=options) for label in ("own_range", "range_of_maps")}
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "plant": plant,
        "middlebury": part(),
        "rendered": rendered(),
        "speed": speed(),
    }


def test_every_table_is_whole() -> None:
    text = matching_table(measured())
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 6
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_maps_are_told_by_both_passes_and_means_have_a_row() -> None:
    text = matching_table({**measured(), "plant": measured()["plant"]})
    within = "75.0 % | 87.5 % | 95.0 % | 75.0 % | 93.8 % | 95.0 %"
    assert f"| a.jpg | 50.0 % | {within} |" in text
    assert f"| **mean** |  | {within} |" in text
    assert "12.3 photometric, - more geometric" in text
    assert "between 1.50 and 12.00" in text


def test_cited_figures_stand_beside_ours() -> None:
    text = matching_table(measured())
    assert "| a.jpg | 0.123 % | 25.0 % | 12.5 % | 0.046 |" in text
    assert "cited: mean | 0.287 % | 26.1 % | 19.6 % |" in text
    assert "| rendered weak | OpenMVS 2.3 (CPU), cited | 90.5 % | 0.072 % | 27.0 |" in (
        text
    )
    cells = "`min_num_pixels=5` | 90.0 % | 80.0 % | 84.7 % | 12,345 |"
    assert f"| rendered rich | cloud, {cells}" in text


def test_the_nearer_bound_is_named() -> None:
    text = matching_table(measured())
    assert "2.00 times the nearer bound, which is arithmetic" in text
    slow_memory = speed()
    slow_memory["bounds"] |= {"memory_s": 3.0, "ours_over_bound": 1.33}
    assert "Bounds: memory, 3.000 s; we take 4.00 s, 1.33 times" in matching_table(
        {**measured(), "speed": slow_memory}
    )


def test_what_was_not_measured_is_left_out() -> None:
    text = matching_table({"command": "x", "date": "2026-01-02"})
    assert "|" not in text
