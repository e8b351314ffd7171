"""Laws of the tables of the matcher."""

from typing import Any

from resdepth_colmap.evaluation.matching_tables import matching_table

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


def more_sources() -> dict[str, Any]:
    after = {**ERRORS, "cpu_s": 39.4}
    worse = {"before_kind": "geometric", "before": ERRORS, "geometric": after}
    worst = {**worse, "before_kind": "photometric"}
    return {"num_sources": 20, "maps": {"a.jpg": worst, "b.jpg": worse}}


def disagreement() -> dict[str, Any]:
    counted = {"share": 0.5, "agree": 0.75}
    group = dict.fromkeys(
        (
            *("share", "confirming_theirs", "confirming_ours", "ours_confirmed"),
            *("texture", "near_step", "alike", "seeing"),
        ),
        0.25,
    )
    preferred = {"ours": 0.125, "theirs": 0.25, "tie": 0.625, "neither": 0.5}
    costs = ("own_6", "own_20", "colmap_6", "colmap_20")
    entry = {
        "by_count": dict.fromkeys(("1", "2", "3 or more"), counted),
        "alike": {"of_median": 0.9, "where_alike": 0.8, "alike": 0.7},
        "groups": {"agree": group, "disagree": {**group, "texture": 7.5}},
        "costs": dict.fromkeys(costs, preferred),
    }
    points = {"points": 4, "ours": 3, "theirs": 1}
    maps = {
        "a.jpg": {**entry, "points": points},
        "b.jpg": {**entry, "costs": {}, "points": dict.fromkeys(points, 0)},
    }
    return {"num_asked": 1000, "margin": 0.05, "maps": maps, "mean": entry}


def chance() -> dict[str, Any]:
    entry = {"dense": 0.75, "agree_dense": 0.875, "agree_sparse": 0.5, "chance": 0.25}
    return {"maps": {"a.jpg": entry}, "mean": entry}


def left_out() -> dict[str, Any]:
    theirs = {"agree": 0.75, "nearer": 0.125, "farther": 0.125, "apart": 0.857}
    ours = {"agree": 0.5, "nearer": 0.375, "farther": 0.125, "apart": 0.8}
    entry = {"theirs": theirs, "ours": ours}
    return {"maps": {"a.jpg": entry}, "mean": entry}


def from_theirs() -> dict[str, Any]:
    entry = {"before": 0.5, "after": 0.75, "stay": 0.25, "return": 0.625}
    return {"num_rows": 120, "maps": {"a.jpg": entry}, "mean": entry}


def measured() -> dict[str, Any]:
    options = {"depth_min": 1.5, "depth_max": 12.0}
    plant = {label: part(options=options) for label in ("own_range", "range_of_maps")}
    return {
        "command": "python bench.py",
        "date": "2026-01-02",
        "meeting_room": part(mean_twice=MAPS, chance=0.125),
        "left_out": left_out(),
        "chance": chance(),
        "more_sources": more_sources(),
        "disagreement": disagreement(),
        "from_theirs": from_theirs(),
        "plant": plant,
        "middlebury": part(),
        "rendered": rendered(),
        "speed": speed(),
    }


def test_every_table_is_whole() -> None:
    text = matching_table(measured())
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 14
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_maps_are_told_by_both_passes_and_means_have_a_row() -> None:
    text = matching_table({**measured(), "plant": measured()["plant"]})
    within = "75.0 % | 87.5 % | 95.0 % | 75.0 % | 93.8 % | 95.0 %"
    assert f"| a.jpg | 50.0 % | {within} |" in text
    assert f"| **mean** |  | {within} |" in text
    assert "12.3 photometric, - more geometric" in text
    assert "between 1.50 and 12.00" in text
    assert "87.5 % (photometric) and 93.8 % (geometric)" in text


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


def test_more_sources_stand_below_six() -> None:
    lines = matching_table(measured()).splitlines()
    first = lines.index("| a.jpg | 6, photometric | 75.0 % | 87.5 % | 95.0 % | - |")
    assert lines[first + 1 : first + 3] == [
        "| a.jpg | 6, then 20 | 75.0 % | 87.5 % | 95.0 % | 39.4 |",
        "| b.jpg | 6, geometric | 75.0 % | 87.5 % | 95.0 % | - |",
    ]


def test_the_disagreement_is_told_image_by_image_and_in_the_mean() -> None:
    text = matching_table(measured())
    cells = "50.0 % | 75.0 % | " * 3
    for name in ("a.jpg", "b.jpg", "**mean**"):
        assert f"| {name} | {cells}90.0 % | 80.0 % |" in text
    preferred = " | ".join(["12.5 % / 25.0 %"] * 4)
    assert f"| a.jpg | {preferred} |" in text
    assert f"| b.jpg | {preferred} |" not in text  # it differs nowhere
    assert "of 255 | 0.2 | 7.5 |" in text
    assert "Of 4 sparse points" in text
    assert "3 within 1 %, COLMAP's through 1" in text
    assert "a.jpg 3 / 1 of 4." in text


def test_where_the_matcher_goes_from_their_map_is_told() -> None:
    text = matching_table(measured())
    assert "in the 120 rows" in text
    assert "| **mean** | 50.0 % | 75.0 % | 25.0 % | 62.5 % |" in text


def test_what_was_not_measured_is_left_out() -> None:
    text = matching_table({"command": "x", "date": "2026-01-02"})
    assert "|" not in text


def test_chance_is_told_beside_agreement() -> None:
    text = matching_table(measured())
    assert "| **mean** | 75.0 % | 87.5 % | 50.0 % | 25.0 % |" in text


def test_what_a_left_out_map_says_stands_beside_what_ours_does() -> None:
    theirs, ours = (
        "75.0 % | 12.5 % | 12.5 % | 85.7 %",
        "50.0 % | 37.5 % | 12.5 % | 80.0 %",
    )
    text = matching_table(measured())
    for name in ("a.jpg", "**mean**"):
        assert f"| {name} | {theirs} | {ours} |" in text
