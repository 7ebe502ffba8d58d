"""Published numbers beside ours, and what a motion must keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deltaopt.dynamics import Multiplier
from studies.benchmarks import andrews, references
from studies.benchmarks.cases import Case, cases
from studies.benchmarks.references import Published
from studies.simulation import Motion
from studies.text_table import csv, paragraph, table

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Comparison:
    """A published number and ours."""

    benchmark: str
    published: Published
    ours: float

    @property
    def difference(self) -> float:
        return self.ours - self.published.value


@dataclass(frozen=True)
class Kept:
    """What a motion should have kept.

    ``energy``: its largest change, J; NaN where dampers take it. ``f``: largest |f|, m or rad.
    ``error``: largest difference to another way, m or rad; NaN where there is none.
    """

    benchmark: str
    duration: float
    energy: float
    f: float
    error: float
    evaluations: int


@dataclass(frozen=True)
class Found:
    """All comparisons, and what each motion kept."""

    comparisons: list[Comparison]
    kept: list[Kept]

    def worst(self, benchmark: str, source: str) -> float:
        """Return the largest difference to a source's numbers."""
        of = [c for c in self.comparisons if c.benchmark == benchmark]
        return max(abs(c.difference) for c in of if c.published.source == source)


def measure(progress: Progress, share: float = 1.0) -> Found:
    """Run every benchmark for this share of its duration."""
    comparisons, kept, every = [], [], cases()
    for i, case in enumerate(every):
        progress(i / len(every), case.name)
        motion = case.run(case.times(share * case.duration))
        comparisons += compared(case, motion)
        kept.append(_kept(case, motion))
    progress(1.0, "done")
    return Found(comparisons, kept)


def compared(case: Case, motion: Motion) -> list[Comparison]:
    """Return a motion's quantities beside the published ones of its times."""
    report, found = case.report(motion), []
    for p in case.published:
        if p.time <= motion.times[-1] + 1e-9:
            at = int(np.argmin(np.abs(motion.times - p.time)))
            found.append(Comparison(case.name, p, float(report[p.quantity][at])))
    if case.name == "A03" and motion.times[-1] >= 0.03 - 1e-9:
        found += _multipliers(motion)
    return found


def _multipliers(motion: Motion) -> list[Comparison]:
    """Forces in the squeezer's joints at its end, with the sign of the test set."""
    forward = Multiplier().forward_dynamics(motion.mechanism)
    found = forward(motion.times[-1], motion.q[-1], motion.dq[-1], andrews.TORQUE, [])
    lam = -np.asarray(found[1], dtype=float).ravel()
    return [
        Comparison("A03", Published(0.03, f"λ{i + 1}", value, "IVP"), float(ours))
        for i, (value, ours) in enumerate(zip(references.ANDREWS_MULTIPLIERS, lam, strict=True))
    ]


def _kept(case: Case, motion: Motion) -> Kept:
    error = np.nan
    if case.exact is not None:
        error = float(np.abs(case.own(motion) - case.exact(motion.times)).max())
    f = motion.position_drift
    return Kept(
        case.name,
        float(motion.times[-1]),
        _energy_change(case, motion),
        float(np.abs(f).max(initial=0.0)),
        error,
        motion.work.evaluations,
    )


def _energy_change(case: Case, motion: Motion) -> float:
    """Largest change of energy less the motor's work, J; NaN with dampers."""
    if case.name == "A05":
        return float("nan")
    work = np.zeros(motion.times.size)
    if case.controls:
        work = case.controls[0] * (motion.q[:, 0] - motion.q[0, 0])
    balance = motion.energy - work
    return float(np.abs(balance - balance[0]).max())


def table_of(found: Found) -> str:
    """Return both tables."""
    rows = [("benchmark", "source", "t, s", "of", "published", "ours", "difference")]
    rows += [
        (
            c.benchmark,
            c.published.source,
            f"{c.published.time:g}",
            c.published.quantity,
            _digits(c.published),
            _digits(c.published, c.ours),
            f"{c.difference:+.1e}",
        )
        for c in found.comparisons
    ]
    kept: list[tuple[str, ...]] = [
        ("benchmark", "t, s", "energy, J", "|f|", "in another way", "right-hand sides")
    ]
    kept += [
        (k.benchmark, f"{k.duration:g}", *map(_power, (k.energy, k.f, k.error)), str(k.evaluations))
        for k in found.kept
    ]
    return f"{table(rows)}\n\n{table(kept)}"


def verdict(found: Found) -> str:
    """Say how far ours are from the published numbers."""
    if not any(c.published.time >= 10 for c in found.comparisons):
        return "(Too short for a verdict.)"
    of = {k.benchmark: k for k in found.kept}
    relative = max(
        abs(c.difference / c.published.value)
        for c in found.comparisons
        if c.benchmark == "A03" and c.published.quantity in references.ANGLES
    )
    return paragraph(
        f"Largest differences: A01 {found.worst('A01', 'IFToMM'):.1e} m,"
        f" A04 {found.worst('A04', 'IFToMM'):.1e} m, A05 {found.worst('A05', 'IFToMM'):.1e} m:"
        " the published digits. Andrews' squeezer agrees with the test set's sixteen digits to"
        f" {relative:.1e} (relative, angles: {-np.log10(relative):.1f} digits), and Adams' with"
        f" Gauss's method to {of['A03'].error:.1e} rad: the test set's numbers hold to ten digits."
        " A02: the library's"
        f" curve differs by {found.worst('A02', 'IFToMM'):.1e} m from ours and from the"
        " mechanism's one equation, by 6e-05 m after 0.1 s already, and so is not its solution;"
        f" Exudyn's last number differs by {found.worst('A02', 'Exudyn, step 0.125 ms'):.1e} m,"
        " a quarter of the one before at twice the step, as its order 2 asks for.",
    )


def csv_of(found: Found) -> str:
    """Return all comparisons."""
    return csv(
        "benchmark,source,time_s,quantity,published,ours,difference",
        (
            (
                c.benchmark,
                c.published.source,
                c.published.time,
                c.published.quantity,
                repr(c.published.value),
                repr(c.ours),
                repr(c.difference),
            )
            for c in found.comparisons
        ),
    )


def _digits(p: Published, value: float | None = None) -> str:
    shown = p.value if value is None else value
    return f"{shown:.16g}" if p.source == "IVP" else f"{shown:.10f}".rstrip("0")


def _power(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.1e}"
