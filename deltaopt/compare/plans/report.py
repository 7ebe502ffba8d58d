"""The comparison of plans in text: tables, CSV, and which to use when, from its numbers."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite
from textwrap import fill

from deltaopt.compare.plans.study import PlanStudy, SolveRow
from deltaopt.files.csv_table import csv_text
from deltaopt.files.tables import finite, text_table
from deltaopt.planning.nlp.transcription import LINEAR

TABLE: tuple[tuple[str, Callable[[SolveRow], str]], ...] = (
    ("formulation", lambda row: row.method.formulation),
    ("loop closure", lambda row: row.method.closure),
    ("degree", lambda row: str(row.method.transcription.degree)),
    ("N", lambda row: str(row.intervals)),
    ("iter.", lambda row: str(row.iterations)),
    ("var.", lambda row: str(row.variables)),
    ("s", lambda row: f"{row.seconds:.3f}"),
    ("functions", lambda row: f"{row.evaluation_seconds:.3f}"),
    ("algebra", lambda row: f"{row.seconds - row.evaluation_seconds:.3f}"),
    ("gap", lambda row: f"{row.gap:.1e}"),
    ("E_K", lambda row: f"{row.quality.kinematic_error:.0e}"),
    ("E_D", lambda row: f"{row.quality.dynamic_error:.0e}"),
    ("arrival m", lambda row: f"{row.quality.arrival_distance:.0e}"),
)
"""Title, and the cell of a row."""
NAMED = 4
"""How many of them say what was solved: where it failed nothing else is known."""
WORDS = 2
"""Columns of the table that are words, and aligned to the left."""
FORMULATIONS = ("flat", "forward", "explicit", "multiplier")
ENOUGH = 2e-3
"""Gap at which times are compared: all formulations reach it before their meshes end."""
STEADIEST = ("", "constraints at knots")
"""The loop closure that stands for a redundant formulation in sentences."""


def csv(study: PlanStudy) -> str:
    """Return one line per row, in full precision, empty where nothing was measured."""
    lines = [_content(row) for row in study.rows]
    return csv_text(list(lines[0]), ([*map(finite, line.values())] for line in lines))


def _content(row: SolveRow) -> dict[str, object]:
    """What is known of a row, by the names of columns."""
    of_method = {
        "formulation": row.method.formulation,
        "closure": row.method.closure,
        "degree": row.method.transcription.degree,
    }
    own = {name: value for name, value in vars(row).items() if name not in ("method", "quality")}
    return of_method | own | vars(row.quality)


def answer(study: PlanStudy) -> str:
    """Say which formulation to use when, and how alike their motions are."""
    times = {name: _times_to_gap(study, name) for name in FORMULATIONS[1:]}
    listed = ", ".join(f"{name} {_range(values)}" for name, values in times.items())
    apart = max(spread(study, case) for case in study.references)
    failed = [row for row in study.rows if row.failure]
    names = sorted({f"{row.method} on {row.case} ({row.intervals} intervals)" for row in failed})
    return fill(
        f"A motion within {ENOUGH:g} of the optimum takes (the quickest mesh, flat being 1):"
        f" {listed}. The best safe durations of the four formulations differ by at most"
        f" {apart:.0e}. {len(study.rows) - len(failed)} of {len(study.rows)} problems were solved"
        f"{' (not: ' * bool(names)}{'; '.join(names)}{')' * bool(names)}, in at most"
        f" {max(row.iterations for row in study.rows)} iterations each.",
        width=98,
    )


def tables(study: PlanStudy) -> str:
    """Return for each case its reference and the finest uniform and refined mesh of each method."""
    return "\n\n".join(_table(study, case) for case in study.references)


def spread(study: PlanStudy, case: str) -> float:
    """Return by which share the best safe durations of the four formulations differ."""
    durations = best_durations(study, case).values()
    return max(durations) / min(durations) - 1


def best_durations(study: PlanStudy, case: str) -> dict[str, float]:
    """Return the safe duration of the smallest gap of each formulation, with degree 1."""
    found = dict[str, SolveRow]()
    for row in study.rows:
        name = row.method.formulation
        if row.case == case and row.method.transcription == LINEAR and not row.failure:
            found[name] = min(found.get(name, row), row, key=lambda each: each.gap)
    return {name: found[name].quality.safe_duration for name in FORMULATIONS if name in found}


def _times_to_gap(study: PlanStudy, formulation: str) -> list[float]:
    """What getting close enough takes over what it takes flat, for each case in which both do."""
    pairs = [
        (_quickest(study, case, formulation), _quickest(study, case, "flat"))
        for case in study.references
    ]
    return [own / flat for own, flat in pairs if isfinite(own) and isfinite(flat)]


def _quickest(study: PlanStudy, case: str, formulation: str) -> float:
    """Seconds of the quickest solution that is close enough; infinite without one."""
    wanted = case, formulation, ""
    enough = (
        row.seconds
        for row in study.rows
        if (row.case, row.method.formulation, row.failure) == wanted
        and row.method.closure in STEADIEST
        and row.gap <= ENOUGH
    )
    return min(enough, default=inf)


def _range(values: list[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}" if values else "nowhere"


def _table(study: PlanStudy, case: str) -> str:
    """The reference, how the formulations agree, and of each method the finest uniform mesh, the
    last, and those on which it failed."""
    reference = study.references[case]
    durations = best_durations(study, case).items()
    told = [
        f"{case}: reference {reference.duration:.7f} s, estimated to be at most"
        f" {reference.gap:.0e} above the optimum ({reference.origin})",
        f"best safe durations, s: {', '.join(f'{name} {each:.7f}' for name, each in durations)};"
        f" they differ by {spread(study, case):.0e}",
        "",
    ]
    rows = [row for row in study.rows if row.case == case]
    cells = [[title for title, _ in TABLE]]
    for row, after in zip(rows, [*rows[1:], None], strict=True):
        last = after is None or after.method != row.method
        uniform = after is not None and after.refined and not row.refined
        if row.failure:
            named = [cell(row) for _, cell in TABLE[:NAMED]]
            cells.append([*named, "failed", *[""] * (len(TABLE) - NAMED - 1)])
        elif uniform or last:
            cells.append([cell(row) for _, cell in TABLE])
    return "\n".join([*told, *text_table(cells, WORDS)])
