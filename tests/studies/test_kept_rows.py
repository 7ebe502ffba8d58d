"""Rows of campaigns, such as multistart."""

from __future__ import annotations

from dataclasses import replace

from studies import multistart
from studies.gap_moves import INSIDE
from studies.kept_rows import kept_rows, read_rows

ROW = multistart.Row(3, "a, b", INSIDE, 0.2, 0.19, 0.01, 0.08, 2, True, "")


def test_rows_of_a_file_go_on_where_they_were_interrupted(tmp_path):
    file, made = tmp_path / "rows.csv", []

    def of(number):
        made.append(number)
        return replace(ROW, number=number, one=0.1 * number)

    def rows(numbers):
        return kept_rows(file, multistart.Row, numbers, lambda r: r.number, of, lambda _: None)

    first = rows([1, 2])
    text = file.read_text(encoding="utf-8")
    file.write_text(text[:-9], encoding="utf-8")  # in the midst of the second row
    assert rows([1, 2, 3]) == [*first, replace(ROW, number=3, one=0.1 * 3)]
    assert made == [1, 2, 2, 3]
    assert read_rows(file, multistart.Row) == rows([1, 2, 3])
