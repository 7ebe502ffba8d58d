"""The comparison of the dynamics in text: table, CSV, and what its numbers say."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from textwrap import fill

from deltaopt.codegen.c_compiler import compiler
from deltaopt.compare.dynamics.study import Row, Study
from deltaopt.files.csv_table import csv_text
from deltaopt.files.tables import text_table

_SAME = "the same cost indeed"
_NOT_SAME = "the equations are the same, the expressions for them are not"
PAPER_SHARE = 0.83
"""Time of K and L_E with a C from eq. (8), over that of L_I, section 5.4."""

TIE = 0.05
"""Shares closer to 1 count as equal."""

ORIGINS = {", printed": "printed", "": "derived"}
"""Where L_E's and L_I's M, Q̂* and Q are from: what a model's name ends in, and words."""

WORDS = 4
"""Columns of the table that are words, and aligned to the left."""
TABLE: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("task", lambda row: row.task),
    ("model", lambda row: row.model),
    ("C or solver", lambda row: row.variant),
    ("linear systems", lambda row: row.systems),
    ("operations", lambda row: str(row.operations)),
    ("interp. µs", lambda row: f"{row.interpreted.microseconds:.2f}"),
    ("ratio", lambda row: f"{row.interpreted.ratio:.2f}"),
    ("compiled µs", lambda row: f"{row.compiled.microseconds:.2f}" if row.compiled else "-"),
    ("ratio", lambda row: f"{row.compiled.ratio:.2f}" if row.compiled else "-"),
    ("median error", lambda row: f"{row.median_error:.1e}"),
    ("largest", lambda row: f"{row.largest_error:.1e}"),
)
"""Of the table: title, and the cell of a row."""
COLUMNS: dict[str, Callable[[Row], object]] = {
    "task": lambda row: row.task,
    "model": lambda row: row.model,
    "variant": lambda row: row.variant,
    "systems": lambda row: row.systems,
    "operations": lambda row: row.operations,
    "interpreted_us": lambda row: row.interpreted.microseconds,
    "interpreted_ratio": lambda row: row.interpreted.ratio,
    "compiled_us": lambda row: row.compiled and row.compiled.microseconds,
    "compiled_ratio": lambda row: row.compiled and row.compiled.ratio,
    "median_error": lambda row: row.median_error,
    "largest_error": lambda row: row.largest_error,
}
"""Of the CSV file: title, and the value of a row."""


def table(study: Study) -> str:
    """Return the table in aligned columns, a blank line between tasks."""
    titles, cells = zip(*TABLE, strict=True)
    lines = text_table([titles, *([cell(row) for cell in cells] for row in study.rows)], WORDS)
    first = sum(row.task == study.rows[0].task for row in study.rows)
    return "\n".join([lines[0], "", *lines[1 : first + 1], "", *lines[first + 1 :]])


def csv(study: Study) -> str:
    """Return one line per row of the table, in full precision, empty where nothing was measured."""
    return csv_text(
        list(COLUMNS), ([value(row) for value in COLUMNS.values()] for row in study.rows)
    )


def notes(study: Study) -> str:
    """Say how the numbers came about."""
    floor = ", ".join(f"{value:.1e} ({task})" for task, value in study.floor.items())
    found = compiler() if any(row.compiled for row in study.rows) else None
    machine = (
        f"{' '.join(found.flags)}; LAPACK cannot be generated as C."
        if found
        else "nothing, for no C compiler was found."
    )
    return fill(
        f"{study.states} random states of the paper's Delta, median of {study.rounds} rounds in"
        " which every model runs in turn; ratios are to L_E in closed form in the same round."
        " In the interpreter a solver called at run time is machine code, what is written out in"
        f" scalars is not. Multipliers are not computed. Compiled: {machine}"
        " Operations: elementary ones, a linear system solved at run time (sparse QR,"
        " LAPACK LU) counted as a dense LU, 2/3 n³ + 2 n². Partition: independent coordinates"
        f" {', '.join(str(i + 1) for i in study.independent)} of 1 to 12, pivoted once. Error:"
        f" relative, against {study.digits} digits; rounding of the state alone makes {floor}.",
        width=98,
    )


def answer(study: Study) -> str:
    """Say which model to use for what: the cheapest for each task, and how accurate they are."""
    compiled = _modes(study)[-1]
    return fill(" ".join([*_cheapest(study, compiled), _accuracy(study)]), width=98)


def _cheapest(study: Study, compiled: bool) -> Iterator[str]:
    """A sentence on each task, with ratios to L_E in closed form as CasADi derives it."""
    mode = "compiled" if compiled else "interpreted"
    for task in study.floor:
        rows = [row for row in study.rows if row.task == task]
        best, implicit = (
            min(those, key=lambda row: _seconds(row, compiled))
            for those in (rows, [row for row in rows if row.model.startswith("L_I")])
        )
        unit = _seconds(study.row(task, "L_E", "closed form"), compiled)
        ratio, other = (_seconds(row, compiled) / unit for row in (best, implicit))
        yield (
            f"For {task} dynamics use {best.model}, {best.variant}: {ratio:.2f} of the time of L_E"
            f" in closed form ({mode}), and L_I at its fastest takes {other:.2f}."
        )


def verdict(study: Study) -> str:
    """Say whether Table I and the 83 % hold, in the numbers of this study."""
    sentences = [
        _same_cost(study),
        f"L_E took {PAPER_SHARE:.0%} of L_I's time in the paper; here L_I is given its fastest"
        " solver each time, and the shares follow.",
        _ranking(study, "null space", "C from the null space, eq. (8), the paper's way"),
        _ranking(study, "closed form", "C in closed form, eq. (55)"),
        _forward(study),
        _conclusion(study),
    ]
    return fill(" ".join(sentences), width=98)


def share(study: Study, task: str, variant: str, origin: str, compiled: bool) -> float:
    """Return the time of L_E with a constraint matrix over that of L_I with its fastest solver.

    ``origin``: one of ``ORIGINS``, where M, Q̂* and Q are from.
    """
    multiplier = [_seconds(row, compiled) for row in _rows(study, task, f"L_I{origin}")]
    return _seconds(study.row(task, f"L_E{origin}", variant), compiled) / min(multiplier)


def _shares(study: Study, task: str, variant: str) -> dict[tuple[str, bool], float]:
    """By origin and mode."""
    return {
        (origin, compiled): share(study, task, variant, origin, compiled)
        for origin in ORIGINS
        for compiled in _modes(study)
    }


def _same_cost(study: Study) -> str:
    """K against L_E."""
    shares = {
        (origin, compiled): _seconds(study.row("inverse", "K, Kane", "closed form"), compiled)
        / _seconds(study.row("inverse", f"L_E{origin}", "closed form"), compiled)
        for origin in ORIGINS
        for compiled in _modes(study)
    }
    same = all(abs(value - 1) <= TIE for value in shares.values())
    return (
        "The paper gives K and L_E the same cost, for they end in the same equations. Inverse"
        " dynamics by K, C in closed form, takes of L_E's time, with M, Q̂* and Q as printed in"
        f" eq. (66) to (83) or as derived by CasADi, {_listed(shares)}:"
        f" {_SAME if same else _NOT_SAME}."
    )


def _ranking(study: Study, variant: str, with_C: str) -> str:
    """The 83 % for one constraint matrix."""
    shares = _shares(study, "inverse", variant)
    return f"With {with_C}, they are {_listed(shares)}: {_order(shares)}."


def _forward(study: Study) -> str:
    """The sentence on the models' shares of the time for forward dynamics."""
    closed, null = (_shares(study, "forward", v) for v in ("closed form", "null space"))
    return (
        f"For forward dynamics they are {_listed(closed)} with C in closed form, and"
        f" {_listed(null)} with C from the null space."
    )


def _listed(shares: dict[tuple[str, bool], float]) -> str:
    """Percentages, each with where it belongs."""
    by_origin = (
        f"{words} "
        + ", ".join(
            f"{value:.0%} {'compiled' if mode else 'interpreted'}"
            for (whose, mode), value in shares.items()
            if whose == origin
        )
        for origin, words in ORIGINS.items()
    )
    return "; ".join(by_origin)


def _accuracy(study: Study) -> str:
    worst = {
        name: max(
            row.median_error / study.floor[row.task]
            for task in study.floor
            for row in _rows(study, task, name)
        )
        for name in ("L_E", "L_I")
    }
    apart = worst["L_I"] / worst["L_E"]
    judged = (
        "on these states, none of them near a singularity, accuracy gives no reason to choose"
        if 0.25 < apart < 4
        else "accuracy tells them apart already on regular states"
    )
    return (
        f"Median errors are at most {worst['L_E']:.1f} times (L_E) and {worst['L_I']:.1f} times"
        f" (L_I) what rounding the state alone makes: {judged}."
    )


def _conclusion(study: Study) -> str:
    judged = {
        variant: {_judged(value) for value in _shares(study, "inverse", variant).values()}
        for variant in ("closed form", "null space")
    }
    everything = set.union(*judged.values())
    if everything == {"holds"}:
        return "So the paper's ranking of computing cost, L_E before L_I, holds throughout."
    if everything == {"is reversed"}:
        return "So the paper's ranking of computing cost is reversed: L_I comes before L_E."
    return (
        "So the paper's ranking of computing cost is no property of the models L_E and L_I: which"
        " is faster depends on how C is found and on how the big, sparse system is solved."
    )


def _order(shares: dict[tuple[str, bool], float]) -> str:
    """Whether L_E comes before L_I, in words."""
    judged = {_judged(value) for value in shares.values()}
    if len(judged) == 1:
        return f"the order {judged.pop()}"
    return "the order holds in some cases only"


def _judged(value: float) -> str:
    """A share of time in words."""
    if abs(value - 1) <= TIE:
        return "is a tie"
    return "holds" if value < 1 else "is reversed"


def _rows(study: Study, task: str, model: str) -> list[Row]:
    return [row for row in study.rows if (row.task, row.model) == (task, model)]


def _modes(study: Study) -> list[bool]:
    """Interpreted, and compiled if it was."""
    return [False, True] if any(row.compiled for row in study.rows) else [False]


def _seconds(row: Row, compiled: bool) -> float:
    """Infinite where it was not measured."""
    if not compiled:
        return row.interpreted.seconds
    return row.compiled.seconds if row.compiled else float("inf")
