"""Markdown tables of plain values, described column by column."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

Measured = Mapping[str, Any]
"""A measurement, as JSON holds it."""

NOT_KNOWN = "-"


class Column(NamedTuple):
    """A column of a table.

    Attributes:
        title: Its head.
        value: What a row shows there: a key, a path of keys with "/" between them, or
            a function of the row.
        form: Python's format specification of a number; "" = text, aligned left.
        scale: Factor of the number, for its unit.
    """

    title: str
    value: str | Callable[[Any], Any]
    form: str = ""
    scale: float = 1

    def cell(self, row: Any) -> str:
        """What the row shows; a dash for a value that is missing or None."""
        value = self.value(row) if callable(self.value) else at(row, self.value)
        return formatted(value, self.form, self.scale)


def columns(form: str, titles: Mapping[str, str], scale: float = 1) -> list[Column]:
    """Columns of one form.

    Args:
        form: See `Column`.
        titles: The head of each by the path of its value.
        scale: See `Column`.
    """
    return [Column(title, path, form, scale) for path, title in titles.items()]


def grouped(groups: Mapping[str, str], parts: Sequence[Column]) -> list[Column]:
    """The same columns for each part of a row.

    Args:
        groups: Title of each part by its key.
        parts: Columns of a part; their values are paths.
    """
    return [
        column._replace(title=f"{column.title}: {title}", value=f"{key}/{column.value}")
        for key, title in groups.items()
        for column in parts
    ]


def table(shown: Sequence[Column], rows: Iterable[Any]) -> str:
    """A table with one line a row.

    Args:
        shown: The columns.
        rows: Mappings, or what the functions of the columns take.
    """
    rule = "|".join("--:" if column.form else "---" for column in shown)
    lines = [_line([column.title for column in shown]), f"|{rule}|"]
    return "\n".join(
        lines + [_line([column.cell(row) for column in shown]) for row in rows]
    )


def formatted(value: Any, form: str = "", scale: float = 1) -> str:
    """A value as text; None is a dash.

    Args:
        value: A number, or a text if `form` is "".
        form: Python's format specification; a per cent sign gets a space before it.
        scale: Factor of the number.
    """
    if value is None:
        return NOT_KNOWN
    if not form:
        return str(value)
    return format(value if scale == 1 else value * scale, form).replace("%", " %")


def at(row: Any, path: str) -> Any:
    """The value at a path of keys, "/" between them; None where a key is missing."""
    for key in path.split("/"):
        row = row.get(key) if isinstance(row, Mapping) else None
    return row


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
