"""The pages of keys are those that the code prints, and every key is on one of them."""

from functools import cache
from pathlib import Path

import pytest

from studies.reference import pages

DOCS = Path(__file__).parents[2] / "docs"


NAMES = ("robot-keys.md", "scene-keys.md")
pages = cache(pages)


def test_these_are_all_pages():
    assert tuple(pages()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_page_is_what_the_command_prints(name):
    """If not: python -m studies reference -o docs"""
    assert (DOCS / name).read_text(encoding="utf-8") == pages()[name]


@pytest.mark.parametrize("name", NAMES)
def test_every_key_is_used_by_a_shipped_file(name):
    """The last cell of its row leads there."""
    rows = [line for line in pages()[name].splitlines() if line.startswith("|`")]
    unused = [row.split("|")[1] for row in rows if "](../problems/" not in row.split("|")[-2]]
    assert len(rows) > 40
    assert unused == []
