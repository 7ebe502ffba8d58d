"""What a table of a sweep says: which plans there are, and which are best."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.tables import text_table
from deltaopt.sweeps.table import Columns

_SHOWN = 5
_NUMBERS = re.compile(r"-?\d[\d.e-]*")
"""Sentences that differ in these alone are alike."""
_TOLD = ("duration", "parts_per_minute", "rms_share", "singularity", "limited_by")


def numbers(table: Columns, name: str) -> Array:
    """A column as numbers, (N,); nan for every text."""
    return np.array([each if isinstance(each, float) else np.nan for each in table[name]])


def is_varied(table: Columns, name: str) -> bool:
    """Whether a column has more than one value."""
    return len(set(map(str, table[name]))) > 1


def varied_keys(table: Columns, names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those of some columns with several values: of numbers, and of texts."""
    varied = [name for name in names if is_varied(table, name)]
    of_numbers = [name for name in varied if np.isfinite(numbers(table, name)).all()]
    return of_numbers, [name for name in varied if name not in of_numbers]


def not_dominated(first: Array, second: Array) -> Array:
    """Which of N pairs of numbers are such that no other is less in one and no more in the other,
    (N,) of truth."""
    found, least = np.zeros(len(first), dtype=bool), np.inf
    for k in np.lexsort((second, first)).tolist():
        if np.isfinite(first[k]) and second[k] < least:
            found[k], least = True, second[k]
    return found


def told(
    table: Columns,
    names: Sequence[str],
    column: str,
    series: Sequence[str] = (),
    worst: bool = False,
) -> Iterator[str]:
    """Lines on the plans: those with the least of a column, or the most of it for the ``worst``,
    and why others are none. The best of each of some ``series``, such as robots, comes first."""
    values, total = numbers(table, column), len(table["point"])
    planned = np.flatnonzero(np.isfinite(values))
    yield f"{len(planned)} of {total} points have a plan"
    order = planned[np.argsort(values[planned], kind="stable")]
    names = [*series, *names]
    ranked, heads = (order[::-1] if worst else order).tolist(), dict[tuple[Any, ...], int]()
    for k in ranked:
        heads.setdefault(tuple(table[name][k] for name in series), k)
    rows = list(dict.fromkeys([*heads.values(), *ranked]))[:_SHOWN]
    best = values[order[0]] if len(order) else 1.0
    shown = [*names, *(each for each in dict.fromkeys([column, *_TOLD]) if each not in names)]
    shown = [name for name in shown if any(_cell(table[name][k]) for k in rows)]
    if len(rows):
        head = [["worst first" if worst else "best first", *shown, "over the best"]]
        lines = [
            [str(int(table["point"][k])), *(_cell(table[name][k]) for name in shown)] for k in rows
        ]
        for line, k in zip(lines, rows, strict=True):
            line.append(f"{100 * (values[k] / best - 1):+.1f} %" if best else "")
        yield from text_table(head + lines, words=0)
    limits = Counter(each for each in table["limited_by"] if isinstance(each, str) and each)
    if limits:
        each = (f"{name} ({number})" for name, number in limits.most_common(_SHOWN))
        yield f"most of the time at: {', '.join(each)}"
    errors = dict[str, list[str]]()
    for sentence in (each for each in table["error"] if isinstance(each, str) and each):
        errors.setdefault(_NUMBERS.sub("", sentence), []).append(sentence)
    for alike in sorted(errors.values(), key=len, reverse=True)[:_SHOWN]:
        yield f"{len(alike)} of {total}: {alike[0]}"


def message(table: Columns, names: Sequence[str], column: str) -> str:
    """Where a column is least, and how much more it is elsewhere, in a sentence."""
    values = numbers(table, column)
    best = int(np.nanargmin(values))
    where = ", ".join(f"{name} = {_cell(table[name][best])}" for name in names)
    most = np.nanmax(values) / values[best] - 1
    return (
        f"{column} is least at {where}: {values[best]:.4g}; elsewhere up to {100 * most:.0f} % more"
    )


def quantiles(table: Columns) -> list[str]:
    """A table of the distribution of durations and of what motors and places allow."""
    shares = (0, 10, 50, 90, 99, 100)
    rows = [["", *(f"{share} %" for share in shares)]]
    for name in ("duration", "parts_per_minute", "rms_share", "singularity", "gap", "seconds"):
        values = numbers(table, name)
        values = values[np.isfinite(values)]
        if len(values):
            rows.append([name, *(f"{each:.4g}" for each in np.percentile(values, shares))])
    return text_table(rows, words=1)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.5g}"
    return str(value)
