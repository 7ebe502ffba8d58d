"""Tables in HTML, of notebooks and of reports. All text is escaped: names come from files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def html_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a row of titles above, none if there are no titles, and a title in each row."""
    titles = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    above = f"<thead><tr>{titles}</tr></thead>" if head else ""
    lines = (
        f'<tr><th scope="row">{escape(first)}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        + "</tr>"
        for first, *rest in rows
    )
    return f"<table>{above}<tbody>\n" + "\n".join(lines) + "\n</tbody></table>"
