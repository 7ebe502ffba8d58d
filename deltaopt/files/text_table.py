"""Tables in plain text: columns under each other, two spaces between them."""

from __future__ import annotations

from collections.abc import Sequence


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
