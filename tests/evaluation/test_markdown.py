"""Laws of the tables."""

import pytest

from resdepth_colmap.evaluation.markdown import Column, at, formatted, grouped, table

ROWS = [
    {"name": "plant", "error": {"mae": 0.12345}, "share": 0.5, "count": 12345},
    {"name": "walnut", "error": {"mae": None}, "count": 7},
]
COLUMNS = (
    Column("scene", "name"),
    Column("MAE, mm", "error/mae", ".1f", 1000),
    Column("share", "share", ".0%"),
    Column("pixels", lambda row: row["count"], ","),
)


def test_each_row_shows_its_columns_and_a_dash_for_what_is_not_known() -> None:
    assert table(COLUMNS, ROWS).splitlines() == [
        "| scene | MAE, mm | share | pixels |",
        "|---|--:|--:|--:|",
        "| plant | 123.5 | 50 % | 12,345 |",
        "| walnut | - | - | 7 |",
    ]


def test_a_table_without_rows_is_its_head() -> None:
    assert len(table(COLUMNS, []).splitlines()) == 2


def test_grouped_columns_look_into_their_part_of_the_row() -> None:
    columns = grouped({"a": "first", "b": "second"}, (Column("MAE", "mae", ".1f"),))
    assert table(columns, [{"a": {"mae": 1}, "b": {"mae": 2}}]).splitlines() == [
        "| MAE: first | MAE: second |",
        "|--:|--:|",
        "| 1.0 | 2.0 |",
    ]


@pytest.mark.parametrize(
    ("value", "form", "expected"),
    [
        (0.256, ".1%", "25.6 %"),
        (1.5, "+.2f", "+1.50"),
        (None, ".1f", "-"),
        ("text", "", "text"),
        (0, ",", "0"),
    ],
)
def test_a_value_has_its_form(value: object, form: str, expected: str) -> None:
    assert formatted(value, form) == expected


def test_a_path_ends_where_a_key_is_missing() -> None:
    assert at({"a": {"b": 1}}, "a/b") == 1
    assert at({"a": {"b": 1}}, "a/c") is None
    assert at({"a": 3}, "a/b/c") is None
