"""Tables in plain text, and paragraphs of a width."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from deltaopt.files.tables import text_table

WIDTH = 98


def table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows of equal length under each other, columns aligned to the left."""
    return "\n".join(text_table(rows))


def paragraph(*sentences: str) -> str:
    """Return sentences as one paragraph of lines."""
    return fill(" ".join(sentences), WIDTH, break_long_words=False, break_on_hyphens=False)
