"""The comparison of plans in text: table, CSV, and which to use when, from its numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from math import isfinite
from textwrap import fill

import numpy as np

from deltaopt.studies.plan_measures import Quality
from deltaopt.studies.plans import LINEAR, PlanStudy, Row

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
    "pose",
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
"""Columns of the table that are words: to the left."""
POSES = ("flat", "forward", "explicit", "multiplier")
BEST_CLOSURE = {"explicit": "constraints at knots", "multiplier": "constraints at knots"}
"""What stands for a redundant pose in sentences."""


def csv(study: PlanStudy) -> str:
    """One line per row, full precision, empty where nothing was measured."""
    return "\n".join([",".join(COLUMNS), *(_csv_line(row) for row in study.rows)]) + "\n"


def tables(study: PlanStudy) -> str:
    """For each case its reference and the coarsest and finest mesh of each method."""
    return "\n\n".join(_table(study, case) for case in study.references)


def verdict(study: PlanStudy) -> str:
    """Which to use when, in the numbers of this study."""
    sentences = [_convergence(study), _same(study), _speed(study), _drift(study), _degree(study)]
    return fill(" ".join([*sentences, _advice(study)]), width=98)


def finest(study: PlanStudy, case: str, pose: str, compiled: bool) -> Row | None:
    """The finest converged mesh of a pose of degree 1 with its best closure."""
    rows = [
        row
        for row in study.rows
        if (row.case, row.method.pose, row.compiled) == (case, pose, compiled)
        and row.method.closure == BEST_CLOSURE.get(pose, "")
        and row.method.transcription == LINEAR
        and not row.failure
    ]
    return rows[-1] if rows else None


def compiled_modes(study: PlanStudy) -> list[bool]:
    return [False, True] if any(row.compiled for row in study.rows) else [False]


def _convergence(study: PlanStudy) -> str:
    rows = [row for row in study.rows if not row.compiled]
    failed = [row for row in rows if row.failure]
    linear = [row for row in rows if row.method.transcription == LINEAR and not row.failure]
    most = max(linear, key=lambda row: row.iterations)
    return (
        f"{len(rows) - len(failed)} of {len(rows)} problems were solved"
        f"{_failures(failed)}; with degree 1 in at most {most.iterations} iterations"
        f" ({most.method} on {most.case}, {most.intervals} intervals)."
    )


def _failures(failed: list[Row]) -> str:
    if not failed:
        return ""
    names = sorted({f"{row.method} on {row.case} ({row.intervals} intervals)" for row in failed})
    return f" (not: {'; '.join(names)})"


def _same(study: PlanStudy) -> str:
    spreads = []
    for case in study.references:
        rows = [finest(study, case, pose, False) for pose in POSES]
        durations = [row.quality.safe_duration for row in rows if row is not None]
        spreads.append(max(durations) / min(durations) - 1)
    return (
        "On the finest mesh of each the safe durations of the four poses differ by at most"
        f" {max(spreads):.0e}."
    )


def _speed(study: PlanStudy) -> str:
    """Times of the finest meshes, as ratios per variable mesh to flat's, median over cases."""
    sentences = []
    for compiled in compiled_modes(study):
        ratios = {pose: _ratio(study, pose, compiled) for pose in POSES[1:]}
        listed = ", ".join(f"{pose} {value:.1f}" for pose, value in ratios.items())
        mode = "compiled" if compiled else "interpreted"
        share = _algebra_share(study, compiled)
        listed_share = ", ".join(f"{pose} {value:.0%}" for pose, value in share.items())
        sentences.append(
            f"For one iteration on 40 intervals {mode} functions take, flat being 1: {listed};"
            f" linear algebra's share of it is {listed_share}."
        )
    return " ".join(sentences)


def _ratio(study: PlanStudy, pose: str, compiled: bool) -> float:
    """Seconds per iteration over flat's on the finest uniform mesh, median over cases."""
    values = []
    for case in study.references:
        own, flat = (_uniform(study, case, p, compiled) for p in (pose, "flat"))
        if own and flat:
            values.append(own.seconds / own.iterations / (flat.seconds / flat.iterations))
    return float(np.median(values)) if values else float("nan")


def _algebra_share(study: PlanStudy, compiled: bool) -> dict[str, float]:
    shares = {}
    for pose in POSES:
        rows = [_uniform(study, case, pose, compiled) for case in study.references]
        parts = [1 - row.evaluation_seconds / row.seconds for row in rows if row]
        shares[pose] = float(np.median(parts)) if parts else float("nan")
    return shares


def _uniform(study: PlanStudy, case: str, pose: str, compiled: bool) -> Row | None:
    """The finest uniform mesh of a pose of degree 1 with its best closure."""
    rows = [
        row
        for row in study.rows
        if (row.case, row.method.pose, row.compiled, row.refined) == (case, pose, compiled, False)
        and row.method.closure == BEST_CLOSURE.get(pose, "")
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
    return (
        f"Degree 2 reaches a smaller gap than degree 1 in {better} of {total} cases: torques of"
        " fastest motions jump, and a polynomial of higher degree swings where they do."
    )


def _of(study: PlanStudy, case: str, degree: int) -> Iterable[Row]:
    return (r for r in study.rows if r.case == case and r.method.transcription.degree == degree)


def _advice(study: PlanStudy) -> str:
    """From the median ratios of time per iteration."""
    compiled = compiled_modes(study)[-1]
    ratios = {pose: _ratio(study, pose, compiled) for pose in POSES[1:]}
    mode = "compiled" if compiled else "interpreted"
    if min(ratios.values()) > 1.05:
        first = f"Use flat where the kinematics has a closed form: no pose is faster ({mode})"
    else:
        fastest = min(ratios, key=lambda pose: ratios[pose])
        first = f"{fastest.capitalize()} is the fastest per iteration ({mode})"
    explicit, multiplier = ratios["explicit"], ratios["multiplier"]
    interpreted = [_ratio(study, pose, False) for pose in ("explicit", "multiplier")]
    second = (
        f"In redundant coordinates the multiplier form takes {multiplier / explicit:.2f} of the"
        f" explicit form's time {mode}"
    )
    if compiled:
        second += f" and {interpreted[1] / interpreted[0]:.2f} interpreted"
    return f"{first}. {second}."


def _table(study: PlanStudy, case: str) -> str:
    reference = study.references[case]
    head = (
        f"{case}: reference {reference.duration:.7f} s, estimated to be at most"
        f" {reference.gap:.0e} above the optimum ({reference.intervals} intervals)"
    )
    rows = [row for row in study.rows if row.case == case and not row.compiled]
    machine = {_key(row): row for row in study.rows if row.case == case and row.compiled}
    cells: list[tuple[str, ...]] = [HEADER]
    for i, row in enumerate(rows):
        last = i + 1 == len(rows) or rows[i + 1].method != row.method
        first = i == 0 or rows[i - 1].method != row.method
        if first or last or row.failure:
            cells.append(_cells(row, machine.get(_key(row))))
    widths = [max(len(line[i]) for line in cells) for i in range(len(HEADER))]
    return "\n".join([head, "", *(_line(line, widths) for line in cells)])


def _key(row: Row) -> tuple[str, int, bool]:
    return str(row.method), row.intervals, row.refined


def _cells(row: Row, fast: Row | None) -> tuple[str, ...]:
    shown, q = fast or row, row.quality
    words = (
        row.method.pose,
        row.method.closure,
        str(row.method.transcription.degree),
        str(row.intervals),
    )
    if row.failure:
        return (*words, "failed", *(len(HEADER) - 5) * ("",))
    return (
        *words,
        str(row.iterations),
        str(row.variables),
        f"{row.seconds:.3f}",
        f"{fast.seconds:.3f}" if fast else "-",
        f"{shown.evaluation_seconds:.3f}",
        f"{shown.seconds - shown.evaluation_seconds:.3f}",
        f"{row.gap:.1e}",
        f"{q.kinematic_error:.0e}",
        f"{q.dynamic_error:.0e}",
        f"{q.arrival_distance:.0e}",
    )


def _line(cells: tuple[str, ...], widths: list[int]) -> str:
    aligned = [
        cell.ljust(width) if i < WORDS else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]
    return "  ".join(aligned).rstrip()


def _csv_line(row: Row) -> str:
    method = row.method
    values: list[object] = [
        row.case,
        method.pose,
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
