"""The comparison of plans in text: table, CSV, and which to use when, from its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from math import inf, isfinite
from textwrap import fill

import numpy as np

from deltaopt.compare.plans.measures import Quality
from deltaopt.compare.plans.study import PlanStudy, Row
from deltaopt.files.csv_table import csv_text
from deltaopt.files.tables import text_table
from deltaopt.planning.nlp.transcription import LINEAR


def _quality(name: str, row: Row) -> object:
    return getattr(row.quality, name)


COLUMNS: dict[str, Callable[[Row], object]] = {
    "case": lambda row: row.case,
    "pose": lambda row: row.method.formulation,
    "closure": lambda row: row.method.closure,
    "degree": lambda row: row.method.transcription.degree,
    "intervals": lambda row: row.intervals,
    "refined": lambda row: int(row.refined),
    "compiled": lambda row: int(row.compiled),
    "seconds": lambda row: row.seconds,
    "evaluation_seconds": lambda row: row.evaluation_seconds,
    "algebra_seconds": lambda row: row.seconds - row.evaluation_seconds,
    "iterations": lambda row: row.iterations,
    "variables": lambda row: row.variables,
    "jacobian_nonzeros": lambda row: row.jacobian_nonzeros,
    "hessian_nonzeros": lambda row: row.hessian_nonzeros,
    "active_rows": lambda row: row.active_rows,
    "rank": lambda row: row.rank,
    "gap": lambda row: row.gap,
    **{each.name: partial(_quality, each.name) for each in fields(Quality)},
    "failure": lambda row: row.failure,
}
"""Of the CSV file: title, and the value of a row."""
TABLE: tuple[tuple[str, Callable[[Row, Row | None], str]], ...] = (
    ("formulation", lambda row, slow: row.method.formulation),
    ("loop closure", lambda row, slow: row.method.closure),
    ("degree", lambda row, slow: str(row.method.transcription.degree)),
    ("N", lambda row, slow: str(row.intervals)),
    ("iter.", lambda row, slow: str(row.iterations)),
    ("var.", lambda row, slow: str(row.variables)),
    ("interp. s", lambda row, slow: f"{slow.seconds:.3f}" if slow else "-"),
    ("comp. s", lambda row, slow: f"{row.seconds:.3f}" if row.compiled else "-"),
    ("functions", lambda row, slow: f"{row.evaluation_seconds:.3f}"),
    ("algebra", lambda row, slow: f"{row.seconds - row.evaluation_seconds:.3f}"),
    ("gap", lambda row, slow: f"{row.gap:.1e}"),
    ("E_K", lambda row, slow: f"{row.quality.kinematic_error:.0e}"),
    ("E_D", lambda row, slow: f"{row.quality.dynamic_error:.0e}"),
    ("arrival m", lambda row, slow: f"{row.quality.arrival_distance:.0e}"),
)
"""Of the table: title, and the cell of a row, beside the same in the interpreter, where it was
solved there."""
NAMED = 4
"""How many of them say what was solved: where it failed nothing else is known."""
WORDS = 2
"""Columns of the table that are words, and aligned to the left."""
FORMULATIONS = ("flat", "forward", "explicit", "multiplier")
ENOUGH = 2e-3
"""Gap at which times are compared: all formulations reach it before their meshes end."""
BEST_CLOSURE = {"explicit": "constraints at knots", "multiplier": "constraints at knots"}
"""The loop closure that stands for a redundant formulation in sentences."""


def csv(study: PlanStudy) -> str:
    """Return one line per row, in full precision, empty where nothing was measured."""
    return csv_text(
        list(COLUMNS),
        ([_known(value(row)) for value in COLUMNS.values()] for row in study.rows),
    )


def _known(value: object) -> object:
    """A value of a row; None, which leaves its place empty, for a number that was not found."""
    return None if isinstance(value, float) and not isfinite(value) else value


def tables(study: PlanStudy) -> str:
    """Return for each case its reference and the finest uniform and refined mesh of each method."""
    return "\n\n".join(_table(study, case) for case in study.references)


def answer(study: PlanStudy) -> str:
    """Say which formulation to use when, in the numbers of this study."""
    apart = max(spread(study, case) for case in study.references)
    same = f"The best safe durations of the four formulations differ by at most {apart:.0e}."
    return fill(f"{_advice(study)} {same}", width=98)


def verdict(study: PlanStudy) -> str:
    """Say what the numbers of this study rest on."""
    about = (_convergence, _rank, _speed, _drift, _degree)
    return fill(" ".join(sentence(study) for sentence in about), width=98)


def best(study: PlanStudy, case: str, formulation: str) -> Row | None:
    """Return the row of the smallest gap of a formulation with degree 1; None if none was
    solved."""
    rows = [
        row
        for row in study.rows
        if (row.case, row.method.formulation) == (case, formulation)
        and row.method.transcription == LINEAR
        and not row.failure
    ]
    return min(rows, key=lambda row: row.gap, default=None)


def compiled_modes(study: PlanStudy) -> list[bool]:
    return [False, True] if any(row.compiled for row in study.rows) else [False]


def _convergence(study: PlanStudy) -> str:
    last_mode = compiled_modes(study)[-1]
    rows = [row for row in study.rows if row.compiled == last_mode]
    failed = [row for row in rows if row.failure]
    most = _listed({name: _most_iterations(rows, name) for name in FORMULATIONS})
    return (
        f"{len(rows) - len(failed)} of {len(rows)} problems were solved{_failures(failed)}."
        f" With degree 1 and its steadiest closure each formulation needs at most, on any mesh and"
        f" case, so many iterations: {most}."
    )


def _listed(found: Mapping[str, object]) -> str:
    """What was found of formulations: "forward 1.2, explicit 3"."""
    return ", ".join(f"{formulation} {each}" for formulation, each in found.items())


def _most_iterations(rows: list[Row], formulation: str) -> str:
    """Of the closure whose largest number is least among those that never failed."""
    worst: dict[str, int] = {}
    broken = {r.method.closure for r in rows if r.method.formulation == formulation and r.failure}
    for row in rows:
        if row.method.formulation == formulation and row.method.transcription == LINEAR:
            key = row.method.closure
            worst[key] = max(worst.get(key, 0), row.iterations)
    whole = {key: value for key, value in worst.items() if key not in broken} or worst
    best = min(whole, key=lambda key: whole[key])
    return f"{whole[best]}" + (f" ({best})" if best else "")


def _failures(failed: list[Row]) -> str:
    if not failed:
        return ""
    names = sorted({f"{row.method} on {row.case} ({row.intervals} intervals)" for row in failed})
    return f" (not: {'; '.join(names)})"


def _rank(study: PlanStudy) -> str:
    rows = [row for row in study.rows if row.rank is not None and row.active_rows is not None]
    deficient = [row for row in rows if (row.rank or 0) < (row.active_rows or 0)]
    degrees = sorted({row.method.transcription.degree for row in deficient})
    if not deficient:
        return f"No active Jacobian of {len(rows)} lacks rank."
    return (
        f"{len(deficient)} active Jacobians of {len(rows)} lack rank, all of degree"
        f" {' and '.join(map(str, degrees))}."
    )


def spread(study: PlanStudy, case: str) -> float:
    """Return by what fraction the best safe durations of the formulations differ."""
    rows = [best(study, case, formulation) for formulation in FORMULATIONS]
    durations = [row.quality.safe_duration for row in rows if row is not None]
    return max(durations) / min(durations) - 1


def most_iterations(study: PlanStudy, case: str, formulation: str) -> int:
    """Return the most iterations on any mesh of a case, with degree 1 and closure at the knots."""
    rows = _solved(study, case, formulation)
    return max(row.iterations for row in rows if row.method.transcription == LINEAR)


def _agreement(study: PlanStudy, case: str) -> str:
    """Of the formulations on one case, with degree 1 and closure at the knots."""
    rows = {name: best(study, case, name) for name in FORMULATIONS}
    durations = _listed({n: f"{r.quality.safe_duration:.7f}" for n, r in rows.items() if r})
    most = _listed({name: most_iterations(study, case, name) for name in FORMULATIONS})
    return (
        f"best safe durations, s: {durations}; they differ by {spread(study, case):.0e}\n"
        f"most iterations on any mesh: {most}"
    )


def _speed(study: PlanStudy) -> str:
    """Times of the finest meshes, as ratios per variable mesh to flat's, median over cases."""
    sentences = []
    for compiled in compiled_modes(study):
        ratios = {p: f"{_ratio(study, p, compiled):.1f}" for p in FORMULATIONS[1:]}
        shares = {p: f"{_algebra_share(study, p, compiled):.0%}" for p in FORMULATIONS}
        mode = "compiled" if compiled else "interpreted"
        sentences.append(
            f"An iteration on the finest uniform mesh with {mode} functions takes, flat being 1:"
            f" {_listed(ratios)}; of that linear algebra takes {_listed(shares)}."
        )
    return " ".join(sentences)


def _ratio(study: PlanStudy, formulation: str, compiled: bool) -> float:
    """Seconds per iteration over flat's on the finest uniform mesh, median over cases."""
    values = []
    for case in study.references:
        own, flat = (uniform(study, case, p, compiled) for p in (formulation, "flat"))
        if own and flat:
            values.append(own.seconds / own.iterations / (flat.seconds / flat.iterations))
    return float(np.median(values)) if values else float("nan")


def _algebra_share(study: PlanStudy, formulation: str, compiled: bool) -> float:
    """Of the time on the finest uniform mesh, median over cases."""
    rows = [uniform(study, case, formulation, compiled) for case in study.references]
    parts = [1 - row.evaluation_seconds / row.seconds for row in rows if row]
    return float(np.median(parts)) if parts else float("nan")


def uniform(study: PlanStudy, case: str, formulation: str, compiled: bool) -> Row | None:
    """Return the row of the finest uniform mesh of a formulation of degree 1 with its best
    closure."""
    rows = [
        row
        for row in _solved(study, case, formulation)
        if (row.compiled, row.refined, row.method.transcription) == (compiled, False, LINEAR)
    ]
    return rows[-1] if rows else None


def _drift(study: PlanStudy) -> str:
    closures: dict[str, list[float]] = {}
    for row in study.rows:
        if row.method.closure and not row.failure and row.method.transcription == LINEAR:
            closures.setdefault(row.method.closure, []).append(row.quality.at_knots)
    listed = ", ".join(f"{max(values):.0e} ({name})" for name, values in closures.items())
    return f"At the knots the loops are open by at most, in m and m/s: {listed}."


def _degree(study: PlanStudy) -> str:
    """Whether degree 2 pays."""
    gaps = [[_least_gap(study, case, degree) for degree in (1, 2)] for case in study.references]
    both = [(linear, quadratic) for linear, quadratic in gaps if isfinite(linear + quadratic)]
    better = sum(quadratic < linear for linear, quadratic in both)
    return f"Degree 2 reaches a smaller gap than degree 1 in {better} of {len(both)} cases."


def _least_gap(study: PlanStudy, case: str, degree: int) -> float:
    rows = [r for r in study.rows if r.case == case and r.method.transcription.degree == degree]
    return min((row.gap for row in rows if not row.failure), default=inf)


def _advice(study: PlanStudy) -> str:
    """By the time to a gap."""
    compiled = compiled_modes(study)[-1]
    mode = "compiled" if compiled else "interpreted"
    times = {p: _time_to_gap(study, p, compiled) for p in FORMULATIONS[1:]}
    listed = _listed({p: _range(values) for p, values in times.items()})
    ratios = {
        m: _ratio(study, "multiplier", m) / _ratio(study, "explicit", m)
        for m in compiled_modes(study)
    }
    shares = " and ".join(
        f"{value:.2f} {'compiled' if m else 'interpreted'}" for m, value in ratios.items()
    )
    whole = [value for values in times.values() for value in values]
    first = (
        "use flat where the kinematics has a closed form"
        if whole and min(whole) > 1
        else "flat is not the fastest in every case"
    )
    return (
        f"A motion within {ENOUGH:g} of the optimum takes ({mode}, the quickest mesh, flat being"
        f" 1): {listed}. So {first}; in redundant coordinates an iteration of the multiplier form"
        f" takes, the explicit form's being 1, {shares}."
    )


def _range(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}" if values else "nowhere"


def _time_to_gap(study: PlanStudy, formulation: str, compiled: bool) -> list[float]:
    """Seconds of the quickest solve with a gap of at most ``ENOUGH`` over flat's, for the cases
    where both got there."""
    values = []
    for case in study.references:
        own, flat = (_quickest(study, case, p, compiled) for p in (formulation, "flat"))
        if isfinite(own) and isfinite(flat):
            values.append(own / flat)
    return values


def _quickest(study: PlanStudy, case: str, formulation: str, compiled: bool) -> float:
    rows = _solved(study, case, formulation)
    enough = (row.seconds for row in rows if row.compiled == compiled and row.gap <= ENOUGH)
    return min(enough, default=inf)


def _solved(study: PlanStudy, case: str, formulation: str) -> list[Row]:
    """The rows of a formulation with the closure that stands for it, where it was solved."""
    closure = BEST_CLOSURE.get(formulation, "")
    wanted = (case, formulation, closure, "")
    return [
        row
        for row in study.rows
        if (row.case, row.method.formulation, row.method.closure, row.failure) == wanted
    ]


def _table(study: PlanStudy, case: str) -> str:
    reference = study.references[case]
    head = (
        f"{case}: reference {reference.duration:.7f} s, estimated to be at most"
        f" {reference.gap:.0e} above the optimum ({reference.origin})"
    )
    last_mode = compiled_modes(study)[-1]
    rows = [row for row in study.rows if row.case == case and row.compiled == last_mode]
    slow = {_key(row): row for row in study.rows if row.case == case and not row.compiled}
    cells = [[title for title, _ in TABLE]]
    for i, row in enumerate(rows):
        last = i + 1 == len(rows) or rows[i + 1].method != row.method
        uniform = i + 1 < len(rows) and rows[i + 1].refined and not row.refined
        if uniform or last or row.failure:
            cells.append(_cells(row, slow.get(_key(row))))
    return "\n".join([head, _agreement(study, case), "", *text_table(cells, WORDS)])


def _key(row: Row) -> tuple[str, int, bool]:
    return str(row.method), row.intervals, row.refined


def _cells(row: Row, slow: Row | None) -> list[str]:
    if row.failure:
        named = [cell(row, slow) for _, cell in TABLE[:NAMED]]
        return [*named, "failed", *[""] * (len(TABLE) - NAMED - 1)]
    return [cell(row, slow) for _, cell in TABLE]
