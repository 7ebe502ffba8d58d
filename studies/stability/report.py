"""The studies of stability in text: CSV of every number, and what the numbers say."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import fill

import numpy as np

from studies.stability.benchmarks import Benchmark, Benchmarks, Outcome
from studies.stability.drift import (
    DRIFTED,
    FREQUENCIES,
    MINIMAL,
    TOLERANCES,
    Drift,
    baumgarte,
)
from studies.stability.edge import TOLERANCE, Edge
from studies.stability.edge import Outcome as EdgeOutcome
from studies.stability.singularities import (
    DISTANCES,
    LOST,
    PROBLEMS,
    Curve,
    Singularities,
)
from studies.text_table import table

WIDTH = 98


def singularities_csv(study: Singularities) -> str:
    """List errors and condition numbers, one line per curve and distance."""
    header = "family,problem,model,variant,distance,value"
    rows = [
        f"{c.family},{c.problem},{c.model},{c.variant},{e:g},{value!r}"
        for c in [*study.curves, *study.floors]
        for e, value in zip(DISTANCES, c.errors.tolist(), strict=True)
    ]
    rows += [
        f"{c.family},condition number,,{c.matrix},{e:g},{value!r}"
        for c in study.conditions
        for e, value in zip(DISTANCES, c.numbers.tolist(), strict=True)
    ]
    return _lines([header, *(row.replace("K, ", "K ").replace("L_I, ", "L_I ") for row in rows)])


def singularities_table(study: Singularities) -> str:
    """Tabulate per family, problem and method the largest error, slope, where it is lost and
    silent."""
    rows: list[tuple[str, ...]] = [
        ("family", "problem", "method", "largest", "slope", f"> {LOST:.0e} at", "nothing at")
    ]
    for c in [*study.floors, *study.curves]:
        if c.model != "K, Kane":  # with u = q̇ it is virtual work
            numbers = (_largest(c.errors), _power(c.slope), _place(c.lost_at), _place(c.silent_at))
            rows.append((c.family, c.problem, f"{c.model}, {c.variant}", *numbers))
    return table(rows)


def singularities_verdict(study: Singularities) -> str:
    """Say whether L_I suffers more than L_E, as section 5.4 expects."""
    return _paragraph(
        _claim(study, "LAPACK LU", "closed form"),
        _claim(study, "sparse QR", "closed form"),
        _claim(study, "LAPACK LU", "null space"),
        _claim(study, "sparse QR", "null space"),
        "So whether L_I suffers more is a matter of its linear solver and of L_E's C, not of the"
        " formulation.",
        _slopes(study, "stretched", "closed form", "eq. (55)"),
        _slopes(study, "sideways", "null space", "the null-space matrix"),
        _slopes(study, "coplanar", "partition", "the partition by motor angles"),
        _best(study),
        _silent(study),
    )


def drift_csv(study: Drift) -> str:
    """List one line per run."""
    header = "method,tolerance,right_hand_sides,seconds,f_m,J_dq_m_per_s,energy_J,drifted_after_s"
    rows = [
        f"{r.method},{r.tolerance:g},{r.evaluations!r},{r.seconds!r},{r.position!r},{r.velocity!r},"
        f"{r.energy!r},{r.drifted_after!r}"
        for r in study.runs
    ]
    return _lines([header, *rows])


def drift_table(study: Drift) -> str:
    """Tabulate all runs."""
    rows: list[tuple[str, ...]] = [
        (
            "method",
            "tolerance",
            "r.h.s.",
            "seconds",
            "|f|, m",
            "|J q̇|, m/s",
            "energy, J",
            f"|f| > {DRIFTED:g} m after",
        )
    ]
    for r in study.runs:
        after = "never" if np.isnan(r.drifted_after) else f"{r.drifted_after:.1f} s"
        numbers = (f"{x:.1e}" for x in (r.position, r.velocity, r.energy))
        cost = (f"{r.evaluations:.0f}", f"{r.seconds:.2f}")
        rows.append((r.method, f"{r.tolerance:.0e}", *cost, *numbers, after))
    return table(rows)


def drift_verdict(study: Drift) -> str:
    """Say what stabilisation costs and gains, at the middle tolerance."""
    tolerance = TOLERANCES[len(TOLERANCES) // 2]
    none, projected, minimal = (study.run(m, tolerance) for m in ("none", "projection", MINIMAL))
    fed = [study.run(baumgarte(w), tolerance) for w in FREQUENCIES]
    best = min(fed, key=lambda r: r.energy if np.isfinite(r.energy) else np.inf)
    stiff = fed[-1]
    after = (
        f"passes {DRIFTED:g} m after {none.drifted_after:.1f} s"
        if np.isfinite(none.drifted_after)
        else f"stays below {DRIFTED:g} m"
    )
    return _paragraph(
        f"Over {study.duration:g} s at tolerance {tolerance:g} the drift without stabilisation"
        f" {after} and ends at {none.position:.1e} m with {none.energy:.1e} J of energy"
        " gained or lost.",
        f"Baumgarte's {best.method.split()[1].replace('/s', ' rad/s')} keeps energy best of the"
        f" frequencies tried, {best.energy:.1e} J at {best.position:.1e} m, for"
        f" {best.evaluations / none.evaluations:.2f} times the right-hand sides; at"
        f" {stiff.method.split()[1].replace('/s', ' rad/s')} the equations are stiff and take"
        f" {stiff.evaluations / none.evaluations:.2f} times.",
        f"Projection every 0.1 s holds the constraints to {projected.position:.0e} m for"
        f" {projected.evaluations / none.evaluations:.2f} times the right-hand sides, energy to"
        f" {projected.energy:.1e} J. Minimal coordinates hold them to {minimal.position:.0e} m"
        f" for {minimal.evaluations / none.evaluations:.2f} times, energy to"
        f" {minimal.energy:.1e} J.",
    )


def benchmarks_csv(study: Benchmarks) -> str:
    """List one line per attempt."""
    header = "benchmark,model,variant,largest_energy_error_J,seconds,failure"
    rows = [
        f"{o.benchmark},{_plain(o.model)},{o.variant},{o.largest!r},{o.seconds!r},"
        f"{_plain(o.failure)}"
        for o in study.outcomes
    ]
    return _lines([header, *rows])


def benchmarks_table(study: Benchmarks) -> str:
    """Tabulate all attempts, failures in words."""
    rows = [("benchmark", "method", "energy error, J", "seconds", "")]
    rows += [
        (
            o.benchmark,
            f"{o.model}, {o.variant}",
            "-" if np.isnan(o.largest) else f"{o.largest:.1e}",
            f"{o.seconds:.1f}",
            o.failure or "solved",
        )
        for o in study.outcomes
    ]
    return table(rows)


def benchmarks_verdict(study: Benchmarks) -> str:
    """Say which method solved which benchmark."""
    return _paragraph(*(_solved(b, study.of(b.name)) for b in study.benchmarks))


def edge_csv(study: Edge) -> str:
    """List one line per scene."""
    header = "family,scene,seconds,duration_s,gap,iterations,verified,error,sentence"
    rows = [
        f"{o.family},{_plain(o.name)},{o.seconds!r},{o.duration!r},{o.gap!r},{o.iterations},"
        f"{o.verified},{o.error},{_plain(o.sentence)}"
        for o in study.outcomes
    ]
    return _lines([header, *rows])


def edge_table(study: Edge) -> str:
    """Tabulate all scenes, errors by their kind."""
    rows: list[tuple[str, ...]] = [("edge", "scene", "seconds", "duration, s", "gap", "")]
    for o in study.outcomes:
        numbers = ("-", "-") if o.error else (f"{o.duration:.4g}", f"{o.gap:.0e}")
        end = o.error or ("verified" if o.verified else "WRONG")
        rows.append((o.family, o.name, f"{o.seconds:.1f}", *numbers, end))
    return table(rows)


def edge_verdict(study: Edge) -> str:
    """Say how many ended how, and what fell short of the tolerance."""
    plans = [o for o in study.outcomes if o.verified]
    refused = [o for o in study.outcomes if o.error]
    kinds = sorted({o.error for o in refused})
    counts = ", ".join(f"{sum(o.error == kind for o in refused)} {kind}" for kind in kinds)
    short = [o for o in plans if o.gap > TOLERANCE]
    slowest = max(study.outcomes, key=lambda o: o.seconds)
    return _paragraph(
        f"Of {len(study.outcomes)} scenes at the edge {len(plans)} end in a plan that the verifier"
        f" passes and {len(refused)} in an error that names the cause ({counts});"
        f" {sum(not o.safe for o in study.outcomes)} end in anything else.",
        f"The longest takes {slowest.seconds:.0f} s ({_scene(slowest)}).",
        f"Of the plans {len(short)} miss the tolerance of {TOLERANCE:g} and say so: "
        + ("; ".join(f"{_scene(o)}, gap {o.gap:.2f}" for o in short) or "none")
        + ".",
    )


def _scene(outcome: EdgeOutcome) -> str:
    return f"{outcome.family}: {outcome.name}"


def _solved(benchmark: Benchmark, outcomes: list[Outcome]) -> str:
    good = [o for o in outcomes if not o.failure]
    built = [o for o in outcomes if o.failure and not o.failure.startswith("cannot be built")]
    names = ", ".join(f"{o.model} ({o.variant})" for o in good) or "none"
    absent = len(outcomes) - len(good) - len(built)
    largest = max((o.largest for o in good), default=np.nan)
    return (
        f"{benchmark.name}: inside {benchmark.bound:g} J are {names}, with {largest:.1e} J at"
        f" most; {len(built)} fail on the way and {absent} cannot be built."
    )


def _claim(study: Singularities, solver: str, variant: str) -> str:
    """How often L_I loses ``LOST`` earlier than L_E with a constraint matrix."""
    earlier = later = 0
    for family in study.families:
        for problem in PROBLEMS:
            key = (family.name, problem.name)
            own = _loss(study.curve(*key, "L_I", solver))
            other = _loss(study.curve(*key, "L_E", variant))
            earlier += own > 5 * other
            later += other > 5 * own
    total = len(study.families) * len(PROBLEMS)
    holds = "holds" if earlier > later else "does not hold"
    return (
        f"L_I solved by {solver} passes an error of {LOST:.0e} farther from the singularity than"
        f" L_E ({variant}) in {earlier} of {total} cases and nearer to it or never in {later}:"
        f" the paper's claim {holds}."
    )


def _loss(curve: Curve) -> float:
    """Largest ε at which the curve is lost; 1e-16 stands for the singularity, 0 for never."""
    return 0.0 if np.isnan(curve.lost_at) else max(curve.lost_at, 1e-16)


def _slopes(study: Singularities, family: str, variant: str, what: str) -> str:
    parts = []
    for problem in PROBLEMS:
        c = study.curve(family, problem.name, "L_E", variant)
        if np.isfinite(c.slope):
            parts.append(f"ε^{c.slope:.1f} ({problem.title})")
    grows = "its error grows as " + ", ".join(parts) if parts else "its error does not grow"
    return f"Towards '{family}', L_E with {what}: {grows}."


def _best(study: Singularities) -> str:
    """Torques by the motor angles, at the serial singularities themselves."""
    worst = max(
        study.curve(family, problem, "K, virtual work", "partition").errors.max()
        for family in ("stretched", "sideways")
        for problem in ("rest", "inverse")
    )
    lost = study.curve("stretched", "inverse", "L_E", "closed form").errors[-1]
    kept = study.curve("stretched", "inverse", "L_E", "null space").errors[-1]
    return (
        f"At the stretched singularity itself eq. (55) leaves an error of {lost:.0e}, the"
        f" null-space matrix one of {kept:.0e}; virtual work with the motor angles independent"
        f" keeps torques to {worst:.0e} at every distance from both serial singularities."
    )


def _silent(study: Singularities) -> str:
    """Which methods return nothing at ε > 0."""
    found: dict[str, list[Curve]] = {}
    for c in study.curves:
        if c.model != "K, Kane" and c.silent_at > 0:
            found.setdefault(f"{c.model} ({c.variant})", []).append(c)
    parts = [
        f"{name} in {len(curves)} cases from ε = {_place(max(c.silent_at for c in curves))} on"
        for name, curves in found.items()
    ]
    return "No result at all short of the singularity: " + ("; ".join(parts) or "none") + "."


def _largest(errors: np.typing.NDArray[np.float64]) -> str:
    finite = errors[np.isfinite(errors)]
    return f"{finite.max():.0e}" if finite.size else "-"


def _power(slope: float) -> str:
    return "-" if np.isnan(slope) else f"{slope:.1f}"


def _place(distance: float) -> str:
    return "-" if np.isnan(distance) else f"{distance:.0e}" if distance else "0"


def _plain(text: str) -> str:
    """Without the commas that CSV separates by."""
    return text.replace(",", ";")


def _lines(rows: Iterable[str]) -> str:
    return "\n".join(rows) + "\n"


def _paragraph(*sentences: str) -> str:
    return fill(" ".join(sentences), width=WIDTH)
