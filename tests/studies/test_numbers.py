"""The numbers of the pages: what is marked stands in what commands printed."""

from __future__ import annotations

import pytest

from studies.numbers import Output, blocks, lacking

OUTPUT = Output(
    "a", "python -m studies line", ("deltaopt",), "0", "x  0.1409 s\ny 1,234 of 1e-03\n"
)


@pytest.mark.parametrize(
    ("block", "missing"),
    [
        ("0.1409 s and 1,234 by `-n 7`, eq. (55)", ""),
        ("0.14 s", ""),
        ("0.15 s of 1e-3", "0.15"),
        ("| 1234 | 0.1408 |", "0.1408"),
        ("```\nx 0.1409 s\n```", ""),
        ("```\nx 0.1408 s\n```", "x 0.1408 s"),
    ],
)
def test_what_was_not_printed_is_named(block, missing):
    ((names, found),) = blocks(f"<!-- from: outputs/a.txt -->\n{block}\n\n")
    expected = [f"'{missing}' is not printed by a"] if missing else []
    assert list(lacking(names, found, {"a": OUTPUT})) == expected


def test_a_mark_ends_with_its_block():
    marked, plain = blocks("<!-- from: a, b -->\n| 1 |\n\n8 of 9\n")
    assert (marked[0], plain[0]) == (("a", "b"), ())
    missing = ["there is no docs/outputs/b.txt", "'1' is not printed by a, b"]
    assert list(lacking(marked[0], "1", {"a": OUTPUT})) == missing
