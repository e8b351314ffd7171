"""Markdown tables and the numbers in them."""

NOT_KNOWN = "-"

HARDWARE = "two cores of an AMD EPYC, no GPU"
"""What the documents' figures were measured on."""


def markdown_table(header: str, rows: list[list[str]], num_texts: int = 1) -> str:
    """A table: its first columns are texts, to the left, the others numbers.

    Args:
        header: The heads of the columns, " | " between them.
        rows: The cells.
        num_texts: Columns of text.
    """
    num_numbers = header.count(" | ") + 1 - num_texts
    rule = "|".join(["---"] * num_texts + ["--:"] * num_numbers)
    lines = [f"| {header} |", f"|{rule}|"]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def number(value: float | None, scale: float = 1, digits: int = 3) -> str:
    """A number with so many digits, or a dash."""
    return NOT_KNOWN if value is None else f"{value * scale:.{digits}f}"


def count(value: int | None) -> str:
    """A whole number with commas, or a dash."""
    return NOT_KNOWN if value is None else f"{value:,}"


def percent(value: float | None, digits: int = 1) -> str:
    """A share in per cent, or a dash."""
    return NOT_KNOWN if value is None else f"{100 * value:.{digits}f} %"
