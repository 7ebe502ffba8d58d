"""How far the gap that a plan tells can be trusted, on seeded moves of many robots.

Each move is planned at several tolerances. The truth is the shortest motion that is known of the
same local optimum: what refinement makes of the plan of the smallest of these tolerances, from
another first mesh, with resolved switches where that succeeds and on finer meshes elsewhere. Where
this says that a plan told too little, or is shorter than the truth, the same is made of that plan
itself, so that no plan is held against another local optimum.

Results are appended to gap.csv as they come, and a campaign that was interrupted goes on where it
ended. The chart is drawn from that file.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, positive, seed
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.refinement import Refinement
from deltaopt.planning.switching.resolution import ResolvedMotion
from deltaopt.planning.switching.resolver import SwitchResolver
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.settings import RESOLVED_BELOW
from studies.bench.hard_moves import Move
from studies.gap_moves import move
from studies.kept_rows import kept_rows
from studies.problems import add_directory

TOLERANCES, FINE = (1e-2, 1e-3, 1e-4), (1e-5, 1e-6)
"""Of every move, and of one move in so many, for these take a hundred times as long."""
SMALL = {"number": 3, "every": 3}
_TRUER = 0.1
"""Tolerance of the truth over that of the plan that it is made of."""
_FIRST_MESH = 48
"""Intervals of the truth's first mesh: not those of any plan."""
_ROUNDING = 1e-10
"""Relative difference of durations that two resolved motions may have by rounding."""


@dataclass(frozen=True)
class Held:
    """A plan held against the truth: a row of gap.csv.

    ``told``, ``true``: gaps; the true one is NaN if no truth was found. ``truth_resolved``: whether
    its switches are; ``truth_gap``: the gap that it tells itself. ``failure``: why there is no
    plan.
    """

    move: int
    robot: str
    stratum: str
    payload: float
    speed_limit: bool
    tolerance: float
    told: float = float("nan")
    true: float = float("nan")
    resolved: bool = False
    intervals: int = 0
    meshes: int = 0
    iterations: int = 0
    truth_resolved: bool = False
    truth_gap: float = float("nan")
    failure: str = ""

    @property
    def within(self) -> bool:
        """Whether the plan says that it is within its tolerance."""
        return self.told <= self.tolerance

    @property
    def too_small(self) -> bool:
        """Whether the true gap is larger than the one that was told."""
        return self.true > self.told + _ROUNDING

    @property
    def missed(self) -> bool:
        """Whether the plan says that it is within a tolerance that it misses."""
        return self.within and self.true > self.tolerance


@dataclass(frozen=True)
class Truth:
    """The shortest motion known of a local optimum: s, and the gap that it tells itself."""

    duration: float
    gap: float
    resolved: bool


class _Once(SwitchResolver):
    """Resolves once at most: what it cannot resolve costs it seconds."""

    asked = False

    def from_coarse(self, solution: MeshSolution) -> ResolvedMotion | None:
        if self.asked:
            return None
        self.asked = True
        return super().from_coarse(solution)

    from_fine = from_last = from_coarse

    def certificate(self, solution: MeshSolution) -> None:
        return None


def truth_beside(scene: deltaopt.Scene, plan: Trajectory, tolerance: float) -> Truth:
    """Refine a plan to a tolerance, from a uniform mesh. Raises NotConverged."""
    model, scaling = (
        delta_model(scene.robot, scene.payload),
        Scaling(problem_of(scene), plan.duration),
    )
    problem = deltaopt.flat.of(model.functions, LINEAR, scaling.constraints)
    switches: SwitchResolver | None = None
    if tolerance < RESOLVED_BELOW:
        once = tolerance >= min(TOLERANCES) * _TRUER
        switches = (_Once if once else SwitchResolver)(scaling, tolerance, _silent)
    refinement = Refinement(problem, scaling, tolerance, switches, _silent)
    uniform = np.full(_FIRST_MESH, 1 / _FIRST_MESH)
    resolved = refinement.from_guess(Guess(plan, near=True, tolerance=1e-5), uniform)
    if resolved:
        return Truth(resolved.trajectory.duration * resolved.safe_factor, resolved.gap, True)
    meshes = refinement.meshes
    best = min(range(len(meshes)), key=lambda i: meshes[i].safe_duration)
    solution = meshes[best].exact()
    duration = solution.trajectory.duration * solution.safe_factor
    return Truth(duration, meshes[best].gap, False)


def held_plans(each: Move, tolerances: Sequence[float]) -> list[Held]:
    """Plan a move at each tolerance, and hold the plans against the truth."""
    scene = each.scene
    rows, plans = [], []
    for tolerance in sorted(tolerances, reverse=True):
        row = Held(
            move=each.number,
            robot=scene.robot.name,
            stratum=each.stratum,
            payload=scene.payload or 0.0,
            speed_limit=scene.robot.drive.speed is not None,
            tolerance=tolerance,
        )
        try:
            plan = deltaopt.plan(scene, tolerance=tolerance)
        except DeltaOptError as error:
            rows.append(replace(row, failure=f"{type(error).__name__}: {error}"))
            continue
        plans.append((len(rows), plan))
        rows.append(
            replace(
                row,
                told=plan.gap,
                resolved=plan.resolved,
                intervals=plan.intervals,
                meshes=len(plan.meshes),
                iterations=plan.iterations,
            )
        )
    if not plans:
        return rows
    finest = plans[-1][1]
    truth = _truth(scene, finest, finest.tolerance)
    for i, plan in plans:
        row = _against(rows[i], plan, truth)
        if row.too_small or np.isnan(row.true):
            row = _against(rows[i], plan, _truth(scene, plan, finest.tolerance))
        rows[i] = row
    return rows


def _truth(scene: deltaopt.Scene, plan: deltaopt.Plan, tolerance: float) -> Truth | None:
    try:
        return truth_beside(scene, plan.trajectory, _TRUER * tolerance)
    except DeltaOptError:
        return None


def _against(row: Held, plan: deltaopt.Plan, truth: Truth | None) -> Held:
    """The row with its true gap, unless the plan is shorter than its truth and the truth's own gap
    does not explain by how much: then it is of another local optimum."""
    if truth is None or plan.duration < truth.duration / (1 + truth.gap):
        return row
    true = max(plan.duration / truth.duration - 1, 0.0)
    return replace(row, true=true, truth_resolved=truth.resolved, truth_gap=truth.gap)


def _silent(_: str) -> None:
    """Report nothing."""


# The file


def campaign(
    file: Path, first: int, number: int, every: int, tolerances: Sequence[float]
) -> list[Held]:
    """Hold the plans that are not in the file yet against the truth, and return all rows.

    ``first``: the seed. ``every``: how many moves there are to one at the finer tolerances.
    """

    def of(i: int) -> tuple[float, ...]:
        return (*tolerances, *(FINE if i % every == every - 1 else ()))

    @lru_cache(maxsize=1)
    def held(i: int) -> dict[float, Held]:
        return {row.tolerance: row for row in held_plans(move(first, i), of(i))}

    keys = [(i, tolerance) for i in range(number) for tolerance in of(i)]
    return kept_rows(
        file,
        Held,
        keys,
        lambda row: (row.move, row.tolerance),
        lambda key: held(key[0])[key[1]],
        ProgressBar().counting(len(keys), "plans"),
    )


# What it says


def table(rows: Iterable[Held]) -> str:
    """A line for each tolerance."""
    rows = list(rows)
    lines = [
        f"{'tolerance':>9}{'plans':>7}{'within':>8}{'missed':>8}{'too small':>11}"
        f"{'least told/true':>17}{'median':>8}{'truth resolved':>16}{'intervals':>11}{'meshes':>8}"
    ]
    for tolerance in sorted({row.tolerance for row in rows}, reverse=True):
        held = [row for row in rows if row.tolerance == tolerance and not np.isnan(row.true)]
        ratios = [row.told / max(row.true, _ROUNDING) for row in held]
        lines.append(
            f"{tolerance:>9.0e}{len(held):>7}{sum(row.within for row in held):>8}"
            f"{sum(row.missed for row in held):>8}{np.mean([r.too_small for r in held]):>11.2%}"
            f"{min(ratios):>17.2f}{np.median(ratios):>8.2f}"
            f"{np.mean([row.truth_resolved for row in held]):>16.1%}"
            f"{np.median([row.intervals for row in held]):>11.0f}"
            f"{np.mean([row.meshes for row in held]):>8.2f}"
        )
    return "\n".join(lines)


def remarks(rows: Iterable[Held]) -> list[str]:
    """A line for each plan that told too little, the worst first, and one for what has no truth."""
    rows = list(rows)
    wrong = sorted((row for row in rows if row.too_small), key=lambda row: row.told / row.true)
    lines = [
        f"move {row.move} ({row.robot}, {row.stratum}) at {row.tolerance:.0e}: "
        f"told {row.told:.2e}, true {row.true:.2e}{', MISSED' if row.missed else ''}"
        for row in wrong
    ]
    failed = [row for row in rows if row.failure]
    unknown = sum(np.isnan(row.true) for row in rows) - len(failed)
    lines.append(f"{len(failed)} refused or not converged, {unknown} without a truth")
    return lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--number", type=one_or_more, default=3000, metavar="N", help="moves (default: 3000)"
    )
    parser.add_argument("--seed", type=seed, default=3, metavar="N", help="of them (default: 3)")
    parser.add_argument(
        "--every",
        type=one_or_more,
        default=49,
        metavar="N",
        help="plan each Nth move at 1e-5 and 1e-6 too (default: 49)",
    )
    parser.add_argument(
        "--tolerances",
        nargs="+",
        type=positive,
        default=TOLERANCES,
        metavar="GAP",
        help=f"of every move (default: {TOLERANCES})",
    )
    add_directory(parser, "gap", "gap.csv and gap.png")


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.gap import draw  # slow to import

    numbers, chart = (arguments.directory / f"gap.{kind}" for kind in ("csv", "png"))
    rows = campaign(
        numbers, arguments.seed, arguments.number, arguments.every, arguments.tolerances
    )
    print(table(rows))
    print(*remarks(rows), sep="\n")
    draw(rows, chart)
    print(f"written: {numbers}, {chart}")
    return 1 if any(row.missed for row in rows) else 0
