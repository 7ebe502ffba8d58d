"""The comparison of the dynamics in text: table, CSV, and what its numbers say."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from textwrap import fill

from deltaopt.codegen.c_compiler import compiler
from deltaopt.compare.dynamics.study import ModelRow, Study
from deltaopt.files.csv_table import csv_text
from deltaopt.files.tables import text_table
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES

PAPER_SHARE = 0.83
"""Time of K and L_E with a C from eq. (8), over that of L_I, section 5.4."""

ORIGINS = {"": "as derived", ", printed": "as printed in eq. (66) to (83)"}
"""Where L_E's and L_I's M, Q̂* and Q are from: what a model's name ends in, and words."""

WORDS = 4
"""Columns of the table that are words, and aligned to the left."""
TABLE: tuple[tuple[str, str, str, Callable[[ModelRow], object]], ...] = (
    ("task", "", "task", lambda row: row.task),
    ("model", "", "model", lambda row: row.model),
    ("C or solver", "", "variant", lambda row: row.variant),
    ("linear systems", "", "systems", lambda row: row.systems),
    ("operations", "", "operations", lambda row: row.operations),
    ("interp. µs", ".2f", "interpreted_us", lambda row: row.interpreted.microseconds),
    ("ratio", ".2f", "interpreted_ratio", lambda row: row.interpreted.ratio),
    ("compiled µs", ".2f", "compiled_us", lambda row: row.compiled and row.compiled.microseconds),
    ("ratio", ".2f", "compiled_ratio", lambda row: row.compiled and row.compiled.ratio),
    ("median error", ".1e", "median_error", lambda row: row.median_error),
    ("largest", ".1e", "largest_error", lambda row: row.largest_error),
)
"""Of each column: title and format in the table, title in the CSV file, and the value of a row;
None where nothing was measured."""


def table(study: Study) -> str:
    """Return the table in aligned columns, a blank line between tasks."""
    titles, formats, _, values = zip(*TABLE, strict=True)
    cells = [
        [_cell(of(row), by) for of, by in zip(values, formats, strict=True)] for row in study.rows
    ]
    lines = text_table([titles, *cells], WORDS)
    first = sum(row.task == study.rows[0].task for row in study.rows)
    return "\n".join([lines[0], "", *lines[1 : first + 1], "", *lines[first + 1 :]])


def csv(study: Study) -> str:
    """Return one line per row of the table, in full precision, empty where nothing was measured."""
    _, _, titles, values = zip(*TABLE, strict=True)
    return csv_text(list(titles), ([of(row) for of in values] for row in study.rows))


def _cell(value: object, by: str) -> str:
    return "-" if value is None else format(value, by)


def notes(study: Study) -> str:
    """Say how the numbers came about."""
    floor = ", ".join(f"{value:.1e} ({task})" for task, value in study.floor.items())
    found = compiler() if any(row.compiled for row in study.rows) else None
    machine = (
        f"{' '.join(found.flags)}; LAPACK cannot be generated as C."
        if found
        else "nothing, for no C compiler was found."
    )
    independent = ", ".join(str(i + 1) for i in MOTOR_ANGLES.independent)
    return fill(
        f"{study.states} random states of the paper's Delta, median of {study.rounds} rounds in"
        " which every model runs in turn; ratios are to L_E in closed form in the same round."
        " In the interpreter a solver called at run time is machine code, what is written out in"
        f" scalars is not. Multipliers are not computed. Compiled: {machine}"
        " Operations: elementary ones, a linear system solved at run time (sparse QR,"
        " LAPACK LU) counted as a dense LU, 2/3 n³ + 2 n². Partition: independent coordinates"
        f" {independent} of 1 to 12, pivoted once. Error:"
        f" relative, against {study.digits} digits; rounding of the state alone makes {floor}.",
        width=98,
    )


def answer(study: Study) -> str:
    """Say which model to use for what: the cheapest for each task, and how accurate they are."""
    errors = (
        f"{max(row.median_error / study.floor[row.task] for row in own):.1f} times ({name})"
        for name in ("L_E", "L_I")
        for own in [[row for row in study.rows if row.model == name]]
    )
    accuracy = (
        f"Median errors are at most {' and '.join(errors)} what rounding the state alone makes; no"
        " state is near a singularity."
    )
    return fill(" ".join([*_cheapest(study), accuracy]), width=98)


def _cheapest(study: Study) -> Iterator[str]:
    """A sentence on each task, with ratios to L_E in closed form as CasADi derives it."""
    for task in study.floor:
        rows = [row for row in study.rows if row.task == task]
        best = min(rows, key=lambda row: row.seconds)
        unit = study.row(task, "L_E", "closed form").seconds
        yield (
            f"For {task} dynamics use {best.model}, {best.variant}: {best.seconds / unit:.2f} of"
            f" the time of L_E in closed form, and L_I at its fastest takes"
            f" {_multiplier(study, task) / unit:.2f}."
        )


def verdict(study: Study) -> str:
    """Say whether the paper's 83 % hold, in the numbers of this study."""
    shares = "; ".join(
        f"{task} dynamics, {words}, "
        + " and ".join(
            f"{_share(study, task, variant, origin):.0%} with {with_C}"
            for variant, with_C in (("closed form", "eq. (55)"), ("null space", "eq. (8)"))
        )
        for task in study.floor
        for origin, words in ORIGINS.items()
    )
    return fill(
        f"L_E took {PAPER_SHARE:.0%} of L_I's time in the paper, with C from eq. (8). Here, where"
        f" L_I has its fastest solver each time: {shares}.",
        width=98,
    )


def _share(study: Study, task: str, variant: str, origin: str) -> float:
    """The time of L_E over that of L_I at its fastest, both with the same M, Q̂* and Q."""
    own = study.row(task, f"L_E{origin}", variant).seconds
    return own / _multiplier(study, task, origin)


def _multiplier(study: Study, task: str, origin: str = "") -> float:
    """Seconds of L_I with the fastest solver."""
    rows = (row for row in study.rows if (row.task, row.model) == (task, f"L_I{origin}"))
    return min(row.seconds for row in rows)
