"""Multiplier against explicit against minimal: every formulation, loop closure and transcription
on a range of meshes, from one guess, held against one reference.

Times are wall times of Ipopt's solve; what CasADi's functions took is counted apart from what
is left, linear algebra above all. Building and compiling are not in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from time import perf_counter

import numpy as np

from deltaopt.compare.plans.cases import Case, Reference
from deltaopt.compare.plans.measures import Quality, independent, quality
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import NotConverged
from deltaopt.files.progress_bar import Progress
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.formulations.choice import Flat, Forward, ProblemFormulation, Redundant
from deltaopt.planning.formulations.collocation import FAR, NEAR, CollocationProblem, Equations
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    Projection,
)
from deltaopt.planning.mesh.error_estimate import ErrorEstimate
from deltaopt.planning.nlp.program import IpoptSolution
from deltaopt.planning.nlp.transcription import LINEAR, QUADRATIC, PiecewiseAcceleration
from deltaopt.planning.switching.detection import detect_structure

UNIFORM = (10, 20, 40)
"""Intervals of the uniform meshes, from the baseline; those after them have knots where the
method's own motion switches, and start from it."""
OF_REFERENCE = 1e-5
"""The gap of the reference."""
AIM = 3e-5
"""What a refined mesh may give away; a method's mesh is refined while its gap is larger."""
REFINEMENTS = 3
"""At most, and"""
MOST_INTERVALS = 320
"""of a refined mesh."""
_FINEST = 4.0
"""Into how many one interval becomes at most where a mesh is refined."""


@dataclass(frozen=True)
class Method:
    """A formulation, in redundant coordinates with its loop closure, and a transcription."""

    kind: ProblemFormulation
    transcription: PiecewiseAcceleration

    @property
    def formulation(self) -> str:
        """Its name without the closure: "explicit"."""
        return self.kind.name.partition(", ")[0]

    @property
    def closure(self) -> str:
        """The name of its loop closure, empty where no loops are left open."""
        return self.kind.name.partition(", ")[2]

    def __str__(self) -> str:
        return f"{self.kind.name}, degree {self.transcription.degree}"


_REDUNDANT = (Explicit(), Multiplier())
_CLOSURES = (KnotConstraints(), Projection(), Baumgarte(), AccelerationLevel())
METHODS = tuple(
    Method(kind, transcription)
    for transcription, closures in ((LINEAR, _CLOSURES), (QUADRATIC, _CLOSURES[:1]))
    for kind in (
        Flat(),
        Forward(),
        *(Redundant(dynamics, closure) for dynamics in _REDUNDANT for closure in closures),
    )
)
"""All that are compared."""


@dataclass(frozen=True)
class SolveRow:
    """One method on one mesh.

    ``refined``: the mesh is, and the guess is the solution before; otherwise the mesh is uniform
    and the guess the baseline. ``failure``: what went wrong, empty if nothing. ``seconds``: wall
    time, of which ``evaluation_seconds`` in functions. ``gap``: safe duration / reference - 1.
    """

    case: str
    method: Method
    intervals: int
    refined: bool
    failure: str
    seconds: float
    evaluation_seconds: float = inf
    iterations: int = 0
    variables: int = 0
    quality: Quality = field(default_factory=Quality)
    gap: float = inf


@dataclass(frozen=True)
class PlanStudy:
    """All rows, the reference of each case, and the seconds that it took."""

    rows: list[SolveRow]
    references: dict[str, Reference]
    seconds: float


def compare_plans(cases: Sequence[Case], progress: Progress) -> PlanStudy:
    """Solve every case with every method on every mesh."""
    begin = perf_counter()
    rows, references = list[SolveRow](), dict[str, Reference]()
    for i, case in enumerate(cases):
        progress(i / len(cases), f"{case.name}: reference")
        references[case.name] = reference = find_reference(case)
        equations = {method.kind: method.kind.equations(case.system) for method in METHODS}
        for j, method in enumerate(METHODS, 1):
            progress((i + j / (1 + len(METHODS))) / len(cases), f"{case.name}: {method}")
            solver = _Solver(case, method, equations[method.kind])
            rows += solver.rows(reference)
    progress(1.0, "done")
    return PlanStudy(rows, references, perf_counter() - begin)


def find_reference(case: Case) -> Reference:
    """Return the case's own reference; without one, refine the flat problem until its estimated gap
    is small enough, or five times."""
    if case.reference is not None:
        return case.reference()
    solver = _Solver(case, Method(Flat(), LINEAR), Flat().equations(case.system))
    mesh, guess = np.full(40, 1 / 40), case.guess
    for _ in range(5):
        solved = solver.solve(mesh, guess)
        guess, factor = solved.motion, case.safe_factor(solved.motion)
        gap = factor - 1 + solved.lost.total
        if gap <= OF_REFERENCE:
            break
        mesh = at_switches(mesh, case.by_order(guess), solved.lost, OF_REFERENCE / 2)
    return Reference(float(guess.knots[-1]) * factor, gap, f"flat, {len(mesh)} intervals")


@dataclass(frozen=True)
class _Solved:
    """A solution on a mesh, its motion of ξ, and what it gives away."""

    problem: CollocationProblem
    solution: IpoptSolution
    motion: PiecewisePolynomial
    lost: ErrorEstimate


@dataclass(frozen=True)
class _Solver:
    """Solves a case with a method, whose ``equations`` are these."""

    case: Case
    method: Method
    equations: Equations

    def solve(self, mesh: Array, guess: PiecewisePolynomial) -> _Solved:
        """From the case's own guess, which is far, or from a solution, which is near."""
        task, transcription = self.case.task, self.method.transcription
        problem = CollocationProblem(self.equations, transcription, mesh)
        program = problem.program(FAR if guess is self.case.guess else NEAR)
        solution = program.solve(problem.pack(guess, task), *problem.bounds(task), task.p)
        motion = independent(self.case, problem, problem.unpack(solution.z, task))
        lost = self.case.lost(motion, problem.multipliers(solution))
        return _Solved(problem, solution, motion, lost)

    def rows(self, reference: Reference) -> list[SolveRow]:
        """Solve on uniform meshes from the straight line, then on meshes with knots where this
        method's motion switches."""
        found = [self._row(reference, np.full(n, 1 / n), self.case.guess) for n in UNIFORM]
        for _ in range(REFINEMENTS):
            row, last = found[-1]
            if last is None or not row.gap > AIM:
                break
            by_order = self.case.by_order(last.motion)
            mesh = at_switches(last.problem.mesh, by_order, last.lost, AIM)
            if len(mesh) > MOST_INTERVALS:
                break
            found.append(self._row(reference, mesh, last.motion))
        return [row for row, _ in found]

    def _row(
        self, reference: Reference, mesh: Array, guess: PiecewisePolynomial
    ) -> tuple[SolveRow, _Solved | None]:
        """A row, and the solution, if there is one."""
        solved_as = self.case.name, self.method, len(mesh), guess is not self.case.guess
        begin = perf_counter()
        try:
            solved = self.solve(mesh, guess)
        except NotConverged as error:
            return SolveRow(*solved_as, str(error), perf_counter() - begin), None
        solution, measured = solved.solution, quality(self.case, solved.problem, solved.solution.z)
        is_safe = isfinite(measured.safe_duration)
        row = SolveRow(
            *solved_as,
            "" if is_safe else "leaves the workspace, or no slowing keeps its limits",
            solution.seconds,
            solution.evaluation_seconds,
            solution.iterations,
            len(solution.z),
            measured,
            measured.safe_duration / reference.duration - 1,
        )
        return row, solved if is_safe else None


def at_switches(mesh: Array, rows: ByOrder, lost: ErrorEstimate, aim: float) -> Array:
    """Return the mesh, (N,) fractions of the duration, for the solve after this one: a knot at
    every switch, arcs between them divided so that what is given away falls to about ``aim``.

    An interval in which a torque jumps gives time away in proportion to the square of its length;
    splitting it costs many short intervals, in which the torques are then hardly determined. With a
    knot at the switch nothing is given away there, and intervals need only be as short as the
    smooth arcs between switches ask for.

    ``rows``: of controls and velocities inside the intervals, normalised, (N, points, m) each.
    """
    switches = np.cumsum(detect_structure(mesh, rows).lengths)
    switches[-1] = 1.0
    ends = np.append(0.0, np.cumsum(mesh))
    ends[-1] = 1.0
    pieces = _pieces(mesh, ends, switches, lost, aim)
    passed = np.append(0.0, np.cumsum(pieces))
    knots = [0.0]
    for end in switches:
        first, last = np.interp([knots[-1], end], ends, passed)
        number = max(1, int(np.ceil(last - first - 1e-6)))
        inside = np.interp(np.linspace(first, last, number + 1)[1:-1], passed, ends)
        knots += [*inside.tolist(), float(end)]
    return np.diff(knots)


def _pieces(mesh: Array, ends: Array, switches: Array, lost: ErrorEstimate, aim: float) -> Array:
    """Into how many pieces, whole or not, each interval is to be divided, (N,).

    What is lost falls with the square of the length. Where a switch lies inside an interval
    the loss is the switch's: the intervals beside it tell how fine it has to be.
    """
    share = lost.unused / (aim / len(mesh)) + lost.exceeded / aim
    pieces = np.clip(np.sqrt(share), 1.0, _FINEST)
    inside = (switches > ends[:-1, None] + 1e-9) & (switches < ends[1:, None] - 1e-9)
    smooth = ~inside.any(axis=1)
    if not smooth.any():
        return np.asarray(pieces)
    at, places = np.arange(len(mesh)), np.flatnonzero(smooth)
    after = np.minimum(np.searchsorted(places, at), len(places) - 1)
    before = np.maximum(np.searchsorted(places, at, side="right") - 1, 0)
    density = pieces / mesh
    beside = np.maximum(density[places[before]], density[places[after]])
    return np.asarray(np.where(smooth, pieces, beside * mesh))
