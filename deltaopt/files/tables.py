"""Tables in plain text, in HTML for notebooks and reports; numbers for JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import isfinite


def text_table(rows: Sequence[Sequence[str]], words: int | None = None) -> list[str]:
    """The lines of a table whose rows have equally many cells. ``words``: how many columns, from
    the left, are words and begin under each other; numbers, the others, end there. All by default.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    left = len(widths) if words is None else words
    return [
        "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a row of titles above, and a title in each row. All text is escaped: names come
    from files."""
    titles = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    lines = (
        f'<tr><th scope="row">{escape(first)}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        + "</tr>"
        for first, *rest in rows
    )
    return (
        f"<table><thead><tr>{titles}</tr></thead><tbody>\n"
        + "\n".join(lines)
        + "\n</tbody></table>"
    )


def finite(value: object) -> object:
    """The value, or None for infinity and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not isfinite(value) else value
