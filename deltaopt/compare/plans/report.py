"""The comparison of plans in text: table, CSV, and which to use when, from its numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from math import inf, isfinite
from textwrap import fill

import numpy as np

from deltaopt.compare.plans.measures import Quality
from deltaopt.compare.plans.study import PlanStudy, Row
from deltaopt.files.tables import text_table
from deltaopt.planning.nlp.transcription import LINEAR

QUALITIES = tuple(f.name for f in fields(Quality))
COLUMNS = (
    "case",
    "pose",
    "closure",
    "degree",
    "intervals",
    "refined",
    "compiled",
    "seconds",
    "evaluation_seconds",
    "algebra_seconds",
    "iterations",
    "variables",
    "jacobian_nonzeros",
    "hessian_nonzeros",
    "active_rows",
    "rank",
    "gap",
    *QUALITIES,
    "failure",
)
HEADER = (
    "formulation",
    "loop closure",
    "degree",
    "N",
    "iter.",
    "var.",
    "interp. s",
    "comp. s",
    "functions",
    "algebra",
    "gap",
    "E_K",
    "E_D",
    "arrival m",
)
WORDS = 2
"""Columns of the table that are words, and aligned to the left."""
FORMULATIONS = ("flat", "forward", "explicit", "multiplier")
ENOUGH = 2e-3
"""Gap at which times are compared: all formulations reach it before their meshes end."""
BEST_CLOSURE = {"explicit": "constraints at knots", "multiplier": "constraints at knots"}
"""The loop closure that stands for a redundant formulation in sentences."""


def csv(study: PlanStudy) -> str:
    """Return one line per row, in full precision, empty where nothing was measured."""
    return "\n".join([",".join(COLUMNS), *(_csv_line(row) for row in study.rows)]) + "\n"


def tables(study: PlanStudy) -> str:
    """Return for each case its reference and the finest uniform and refined mesh of each method."""
    return "\n\n".join(_table(study, case) for case in study.references)


def verdict(study: PlanStudy) -> str:
    """Say which formulation to use when, in the numbers of this study."""
    sentences = [_convergence(study), _rank(study), _same(study), _speed(study), _drift(study)]
    sentences.append(_degree(study))
    return fill(" ".join([*sentences, _advice(study)]), width=98)


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
    most = ", ".join(
        f"{formulation} {_most_iterations(rows, formulation)}" for formulation in FORMULATIONS
    )
    return (
        f"{len(rows) - len(failed)} of {len(rows)} problems were solved{_failures(failed)}."
        f" With degree 1 and its steadiest closure each formulation needs at most, on any mesh and"
        f" case, so many iterations: {most}."
    )


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


def _same(study: PlanStudy) -> str:
    spreads = [spread(study, case) for case in study.references]
    return f"The best safe durations of the four formulations differ by at most {max(spreads):.0e}."


def spread(study: PlanStudy, case: str) -> float:
    """Return by what fraction the best safe durations of the formulations differ."""
    rows = [best(study, case, formulation) for formulation in FORMULATIONS]
    durations = [row.quality.safe_duration for row in rows if row is not None]
    return max(durations) / min(durations) - 1


def most_iterations(study: PlanStudy, case: str, formulation: str) -> int:
    """Return the most iterations on any mesh of a case, with degree 1 and closure at the knots."""
    rows = [
        row
        for row in study.rows
        if (row.case, row.method.formulation) == (case, formulation)
        and row.method.closure == BEST_CLOSURE.get(formulation, "")
        and row.method.transcription == LINEAR
    ]
    return max(row.iterations for row in rows)


def _agreement(study: PlanStudy, case: str) -> str:
    """Of the formulations on one case, with degree 1 and closure at the knots."""
    rows = {formulation: best(study, case, formulation) for formulation in FORMULATIONS}
    durations = ", ".join(
        f"{formulation} {row.quality.safe_duration:.7f}" for formulation, row in rows.items() if row
    )
    most = ", ".join(
        f"{formulation} {most_iterations(study, case, formulation)}" for formulation in FORMULATIONS
    )
    return (
        f"best safe durations, s: {durations}; they differ by {spread(study, case):.0e}\n"
        f"most iterations on any mesh: {most}"
    )


def _speed(study: PlanStudy) -> str:
    """Times of the finest meshes, as ratios per variable mesh to flat's, median over cases."""
    sentences = []
    for compiled in compiled_modes(study):
        ratios = {
            formulation: _ratio(study, formulation, compiled) for formulation in FORMULATIONS[1:]
        }
        listed = ", ".join(f"{formulation} {value:.1f}" for formulation, value in ratios.items())
        mode = "compiled" if compiled else "interpreted"
        share = _algebra_share(study, compiled)
        listed_share = ", ".join(
            f"{formulation} {value:.0%}" for formulation, value in share.items()
        )
        sentences.append(
            f"An iteration on the finest uniform mesh with {mode} functions takes, flat being 1:"
            f" {listed}; of that linear algebra takes {listed_share}."
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


def _algebra_share(study: PlanStudy, compiled: bool) -> dict[str, float]:
    shares = {}
    for formulation in FORMULATIONS:
        rows = [uniform(study, case, formulation, compiled) for case in study.references]
        parts = [1 - row.evaluation_seconds / row.seconds for row in rows if row]
        shares[formulation] = float(np.median(parts)) if parts else float("nan")
    return shares


def uniform(study: PlanStudy, case: str, formulation: str, compiled: bool) -> Row | None:
    """Return the row of the finest uniform mesh of a formulation of degree 1 with its best
    closure."""
    rows = [
        row
        for row in study.rows
        if (row.case, row.method.formulation, row.compiled, row.refined)
        == (case, formulation, compiled, False)
        and row.method.closure == BEST_CLOSURE.get(formulation, "")
        and row.method.transcription == LINEAR
        and not row.failure
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
    better, total = 0, 0
    for case in study.references:
        linear = [row for row in _of(study, case, 1) if not row.failure]
        quadratic = [row for row in _of(study, case, 2) if not row.failure]
        if linear and quadratic:
            total += 1
            better += min(r.gap for r in quadratic) < min(r.gap for r in linear)
    return f"Degree 2 reaches a smaller gap than degree 1 in {better} of {total} cases."


def _of(study: PlanStudy, case: str, degree: int) -> Iterable[Row]:
    return (r for r in study.rows if r.case == case and r.method.transcription.degree == degree)


def _advice(study: PlanStudy) -> str:
    """By the time to a gap."""
    compiled = compiled_modes(study)[-1]
    mode = "compiled" if compiled else "interpreted"
    times = {
        formulation: _time_to_gap(study, formulation, compiled) for formulation in FORMULATIONS[1:]
    }
    listed = ", ".join(f"{formulation} {_range(values)}" for formulation, values in times.items())
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
    rows = [
        row.seconds
        for row in study.rows
        if (row.case, row.method.formulation, row.compiled) == (case, formulation, compiled)
        and row.method.closure == BEST_CLOSURE.get(formulation, "")
        and not row.failure
        and row.gap <= ENOUGH
    ]
    return min(rows, default=inf)


def _table(study: PlanStudy, case: str) -> str:
    reference = study.references[case]
    head = (
        f"{case}: reference {reference.duration:.7f} s, estimated to be at most"
        f" {reference.gap:.0e} above the optimum ({reference.origin})"
    )
    last_mode = compiled_modes(study)[-1]
    rows = [row for row in study.rows if row.case == case and row.compiled == last_mode]
    slow = {_key(row): row for row in study.rows if row.case == case and not row.compiled}
    cells: list[tuple[str, ...]] = [HEADER]
    for i, row in enumerate(rows):
        last = i + 1 == len(rows) or rows[i + 1].method != row.method
        uniform = i + 1 < len(rows) and rows[i + 1].refined and not row.refined
        if uniform or last or row.failure:
            cells.append(_cells(row, slow.get(_key(row))))
    return "\n".join([head, _agreement(study, case), "", *text_table(cells, WORDS)])


def _key(row: Row) -> tuple[str, int, bool]:
    return str(row.method), row.intervals, row.refined


def _cells(row: Row, slow: Row | None) -> tuple[str, ...]:
    """``slow``: the same in the interpreter, where it was solved there."""
    words = (
        row.method.formulation,
        row.method.closure,
        str(row.method.transcription.degree),
        str(row.intervals),
    )
    if row.failure:
        return (*words, "failed", *(len(HEADER) - 5) * ("",))
    q = row.quality
    return (
        *words,
        str(row.iterations),
        str(row.variables),
        f"{slow.seconds:.3f}" if slow else "-",
        f"{row.seconds:.3f}" if row.compiled else "-",
        f"{row.evaluation_seconds:.3f}",
        f"{row.seconds - row.evaluation_seconds:.3f}",
        f"{row.gap:.1e}",
        f"{q.kinematic_error:.0e}",
        f"{q.dynamic_error:.0e}",
        f"{q.arrival_distance:.0e}",
    )


def _csv_line(row: Row) -> str:
    method = row.method
    values: list[object] = [
        row.case,
        method.formulation,
        method.closure,
        method.transcription.degree,
        row.intervals,
        int(row.refined),
        int(row.compiled),
        row.seconds,
        row.evaluation_seconds,
        row.seconds - row.evaluation_seconds,
        row.iterations,
        row.variables,
        row.jacobian_nonzeros,
        row.hessian_nonzeros,
        "" if row.active_rows is None else row.active_rows,
        "" if row.rank is None else row.rank,
        row.gap,
        *(getattr(row.quality, name) for name in QUALITIES),
        '"' + row.failure.replace('"', "'") + '"' if row.failure else "",
    ]
    return ",".join("" if isinstance(v, float) and not isfinite(v) else str(v) for v in values)
