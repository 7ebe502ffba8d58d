"""How far off the first guess may be, in each formulation by Ipopt.

The straight line, bent sideways by a random smooth detour, or with its duration wrong by a factor:
from how many of these does each formulation find the motion that it finds from the line? One mesh
of 20 intervals, acceleration of degree 1, compiled.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deltaopt.cli.arguments import load_fastest, one_or_more, seed
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.planning.formulations.collocation import FAR, CollocationProblem
from deltaopt.planning.nlp.program import Program
from studies.problems import PICK_AND_PLACE
from studies.text_table import paragraph, table

HELP = "how far off the first guess may be, in each formulation by Ipopt"
FORMULATIONS = ("flat", "forward", "explicit", "multiplier")
BENDS = (0.25, 0.5, 1.0, 2.0)
"""Largest detours, as shares of the way."""
FACTORS = (0.1, 0.3, 3.0, 10.0)
"""Of the duration."""
SMALL = {"number": 1, "bends": (0.5,), "factors": (), "chosen": ("flat",)}
INTERVALS = 20
SAME = 1e-4
"""Relative difference of durations up to which two motions count as one."""


@dataclass(frozen=True)
class Outcome:
    """Of all guesses of a kind: how many lead to the motion found from the straight line, to a
    slower one, to a faster one, and to none; ``iterations``: median of those that converge."""

    formulation: str
    guess: str
    same: int
    slower: int
    faster: int
    none: int
    iterations: float


def bent(guess: PiecewisePolynomial, by: float, random: np.random.Generator) -> PiecewisePolynomial:
    """Return the guess with a detour of ``by`` times its way in a random direction across it."""
    knots = np.linspace(guess.knots[0], guess.knots[-1], 41)
    x, v = guess.with_rate_at(knots)
    way, span = x[-1] - x[0], knots[-1] - knots[0]
    across = np.cross(way, random.normal(size=3))
    across *= by * np.linalg.norm(way) / np.linalg.norm(across)
    u = np.pi * (knots - knots[0]) / span
    x = x + np.sin(u)[:, None] ** 2 * across
    v = v + np.sin(2 * u)[:, None] * np.pi / span * across
    return PiecewisePolynomial.hermite(knots, x, v)


def measure(
    progress: Callable[[float, str], None],
    scene: Path,
    number: int,
    first: int,
    bends: tuple[float, ...],
    factors: tuple[float, ...],
    chosen: tuple[str, ...],
) -> list[Outcome]:
    """Solve from ``number`` random detours of each size, and from each wrong duration."""
    from deltaopt.compare.plans.cases import delta_case
    from deltaopt.compare.plans.study import methods
    from deltaopt.planning.nlp.transcription import LINEAR

    case = delta_case(scene.stem, load_fastest(scene))
    found = []
    for i, name in enumerate(chosen):
        progress(i / len(chosen), name)
        method = next(
            m
            for m in methods()
            if (m.formulation, m.transcription) == (name, LINEAR)
            and m.closure in ("", "constraints at knots")
        )
        problem = method.build(case.system).on(np.full(INTERVALS, 1 / INTERVALS), LINEAR)
        program, bounds = problem.program_with(FAR), problem.bounds(case.task)

        def solve(
            guess: PiecewisePolynomial,
            problem: CollocationProblem = problem,
            program: Program = program,
            bounds: tuple[Array, Array] = bounds,
        ) -> tuple[float, int]:
            """Return the duration, s, NaN without convergence, and iterations."""
            try:
                start = problem.pack(guess, case.task)
                solution = program.solve(start, *bounds, case.task.p)
            except (DeltaOptError, ValueError):
                return np.nan, 0
            return float(problem.unpack(solution.z, case.task).knots[-1]), solution.iterations

        random = np.random.default_rng(first)
        kinds = {"straight line": [case.guess]}
        for by in bends:
            detours = [bent(case.guess, by, random) for _ in range(number)]
            kinds[f"detour of {by:g} of the way"] = detours
        kinds |= {f"duration × {k:g}": [case.guess.slowed(k)] for k in factors}
        best = solve(case.guess)[0]
        found += [
            _outcome(name, kind, [solve(g) for g in own], best) for kind, own in kinds.items()
        ]
    progress(1.0, "done")
    return found


def _outcome(name: str, kind: str, solved: list[tuple[float, int]], best: float) -> Outcome:
    durations = np.array([duration for duration, _ in solved])
    ratio = durations / best - 1
    good = [iterations for duration, iterations in solved if np.isfinite(duration)]
    return Outcome(
        name,
        kind,
        int(np.sum(np.abs(ratio) <= SAME)),
        int(np.sum(ratio > SAME)),
        int(np.sum(ratio < -SAME)),
        int(np.sum(np.isnan(ratio))),
        float(np.median(good)) if good else np.nan,
    )


def report(found: list[Outcome]) -> str:
    """Return one line a guess, a column a formulation, and what they say."""
    names = list(dict.fromkeys(o.formulation for o in found))
    rows = [("guess", *(f"{name}: same, slower, faster, none; iter." for name in names))]
    for kind in dict.fromkeys(o.guess for o in found):
        own = {o.formulation: o for o in found if o.guess == kind}
        rows.append((kind, *(_cell(own[name]) for name in names)))
    told = []
    for name in names:
        own_ = [o for o in found if o.formulation == name]
        total = sum(o.same + o.slower + o.faster + o.none for o in own_)
        told.append(f"{name} {sum(o.same for o in own_)} of {total}")
    return f"{table(rows)}\n\n" + paragraph(f"The same motion is found: {', '.join(told)}.")


def _cell(o: Outcome) -> str:
    iterations = "-" if np.isnan(o.iterations) else f"{o.iterations:.0f}"
    return f"{o.same}, {o.slower}, {o.faster}, {o.none}; {iterations}"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=20, help="detours of each size (20)")
    parser.add_argument("--seed", type=seed, default=1, help="of them (1)")
    parser.set_defaults(scene=PICK_AND_PLACE, bends=BENDS, factors=FACTORS, chosen=FORMULATIONS)


def run(arguments: argparse.Namespace) -> int:
    a = arguments
    sizes = a.scene, a.number, a.seed, a.bends, a.factors, a.chosen
    print(report(measure(ProgressBar(), *sizes)))
    return 0
