"""Multiplier against explicit against minimal: every formulation, loop closure and transcription
on a range of meshes, from one guess, held against one reference.

Times are wall times of Ipopt's solve; what CasADi's functions took is counted apart from what
is left, linear algebra above all. Building and compiling are not in them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import inf, isfinite
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.codegen.c_compiler import compiler
from deltaopt.compare.plans.cases import Case, Reference
from deltaopt.compare.plans.knots_at_switches import at_switches
from deltaopt.compare.plans.measures import Meter, Quality, active_rank
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import NotConverged
from deltaopt.planning.formulations.collocation import FAR, NEAR, CollocationProblem, Equations
from deltaopt.planning.formulations.equations import (
    explicit_equations,
    flat_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    LoopClosure,
    Projection,
)
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.mesh.error_estimate import ErrorEstimate
from deltaopt.planning.nlp.points import PointFunction
from deltaopt.planning.nlp.program import IpoptSolution, Options, Program
from deltaopt.planning.nlp.transcription import LINEAR, QUADRATIC, PiecewiseAcceleration

Formulations = dict[tuple[str, str], Equations]
Progress = Callable[[float, str], None]
"""Told how much is done (0 to 1) and what comes next."""

CLOSURES: tuple[LoopClosure, ...] = (
    KnotConstraints(),
    Projection(),
    Baumgarte(),
    AccelerationLevel(),
)
UNIFORM = (10, 20, 40)
"""Intervals of the uniform meshes, from the baseline; those after them have knots where the
method's own motion switches, and start from it."""
AIM = 3e-5
"""What a refined mesh may give away; a method's mesh is refined while its gap is larger."""
REFINEMENTS = 3
"""At most, and"""
MOST_INTERVALS = 320
"""of a refined mesh."""
RANK_AT_MOST = 10
"""Intervals of the meshes on which the rank is computed, by a dense decomposition."""


@dataclass(frozen=True)
class Method:
    """A formulation with a loop closure, which is empty where no loops are left open, and a
    transcription."""

    formulation: str
    closure: str
    transcription: PiecewiseAcceleration
    build: Callable[[ScaledMechanism], Equations]

    @property
    def equations_key(self) -> tuple[str, str]:
        """Return what methods with the same point functions share."""
        return self.formulation, self.closure

    def __str__(self) -> str:
        parts = (self.formulation, self.closure, f"degree {self.transcription.degree}")
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class Row:
    """One method on one mesh, evaluated in one mode.

    ``refined``: the mesh is, and the guess is the solution before; otherwise the mesh is uniform
    and the guess the baseline. ``failure``: what went wrong, empty if nothing. ``seconds``: wall
    time, of which ``evaluation_seconds`` in functions. ``gap``: safe duration / reference - 1.
    ``active_rows``, ``rank``: of the active Jacobian, None on fine meshes.
    """

    case: str
    method: Method
    intervals: int
    refined: bool
    compiled: bool
    failure: str
    seconds: float
    evaluation_seconds: float = inf
    iterations: int = 0
    variables: int = 0
    jacobian_nonzeros: int = 0
    hessian_nonzeros: int = 0
    quality: Quality = field(default_factory=Quality)
    gap: float = inf
    active_rows: int | None = None
    rank: int | None = None


@dataclass(frozen=True)
class PlanStudy:
    """All rows, and for each case its reference and the seconds of compiling."""

    rows: list[Row]
    references: dict[str, Reference]
    compile_seconds: dict[str, float]
    seconds: float


def methods() -> list[Method]:
    """Return all methods that are compared."""

    def redundant(
        formulation: str,
        equations: Callable[[ScaledMechanism, LoopClosure], Equations],
        closure: LoopClosure,
        transcription: PiecewiseAcceleration,
    ) -> Method:
        return Method(formulation, closure.name, transcription, lambda s: equations(s, closure))

    found = []
    for transcription in (LINEAR, QUADRATIC):
        closures = CLOSURES if transcription is LINEAR else CLOSURES[:1]
        found += [
            Method("flat", "", transcription, flat_equations),
            Method("forward", "", transcription, forward_equations),
            *(redundant("explicit", explicit_equations, c, transcription) for c in closures),
            *(redundant("multiplier", multiplier_equations, c, transcription) for c in closures),
        ]
    return found


def compare_plans(
    cases: Sequence[Case],
    tolerance: float = 1e-5,
    uniform: Sequence[int] = UNIFORM,
    refinements: int = REFINEMENTS,
    progress: Progress = lambda done, what: None,
) -> PlanStudy:
    """Solve every case with every method on every mesh.

    Without a C compiler compiled times are left out. ``tolerance``: of the reference's gap.
    """
    begin = perf_counter()
    rows: list[Row] = []
    references: dict[str, Reference] = {}
    compile_seconds: dict[str, float] = {}
    for i, case in enumerate(cases):

        def tell(done: float, what: str, i: int = i, name: str = case.name) -> None:
            progress((i + done) / len(cases), f"{name}: {what}")

        tell(0.0, "reference")
        references[case.name] = reference = find_reference(case, tolerance)
        bench = _Bench(case, reference, uniform, refinements)
        formulations = {m.equations_key: m.build(case.system) for m in reversed(methods())}
        modes = [{key: interpreted(e) for key, e in formulations.items()}]
        if compiler() is not None:
            tell(0.1, "compiling")
            compiling = perf_counter()
            for equations in formulations.values():
                equations.derive()
            compile_seconds[case.name] = perf_counter() - compiling
            modes.append(formulations)
        for j, method in enumerate(methods()):
            tell(0.2 + 0.8 * j / len(methods()), str(method))
            rows += bench.rows(method, modes)
    progress(1.0, "done")
    return PlanStudy(rows, references, compile_seconds, perf_counter() - begin)


@dataclass(frozen=True)
class _InterpretedPointFunction(PointFunction):
    """A point function r(y, p) whose derivatives are not compiled."""

    @cached_property
    def derivatives(self) -> list[tuple[ca.Function, ca.Sparsity]]:
        return self.derived


def interpreted(equations: Equations) -> Equations:
    """Return the same equations with no point function compiled."""
    points: dict[str, Any] = {}
    for each in fields(equations):
        value = getattr(equations, each.name)
        if isinstance(value, PointFunction):
            points[each.name] = _InterpretedPointFunction(value.name, value.function)
    return replace(equations, **points)


def find_reference(case: Case, tolerance: float) -> Reference:
    """Return the case's own reference; without one, refine the flat problem until its estimated gap
    is within the tolerance, or five times."""
    if case.reference is not None:
        return case.reference()
    solver = _Solver(case, flat_equations(case.system), LINEAR)
    mesh, guess = np.full(40, 1 / 40), case.guess
    for _ in range(5):
        solved = solver.solve(mesh, guess, FAR if guess is case.guess else NEAR)
        guess, factor = solved.motion, case.safe_factor(solved.motion)
        gap = factor - 1 + solved.lost.total
        if gap <= tolerance:
            break
        mesh = at_switches(mesh, case.by_order(guess), solved.lost, tolerance / 2)
    return Reference(float(guess.knots[-1]) * factor, gap, f"flat, {len(mesh)} intervals")


@dataclass(frozen=True)
class _Solved:
    """A solution on a mesh, its motion of ξ, and what it gives away."""

    problem: CollocationProblem
    program: Program
    bounds: tuple[Array, Array]
    solution: IpoptSolution
    motion: PiecewisePolynomial
    lost: ErrorEstimate


@dataclass(frozen=True)
class _Solver:
    """Solves a case in one formulation and transcription."""

    case: Case
    equations: Equations
    transcription: PiecewiseAcceleration

    def solve(self, mesh: Array, guess: PiecewisePolynomial, options: Options) -> _Solved:
        task, problem = self.case.task, self.equations.on(mesh, self.transcription)
        bounds = problem.bounds(task)
        program = problem.program_with(options)
        solution = program.solve(problem.pack(guess, task), *bounds, task.p)
        motion = Meter(self.case).independent(problem, problem.unpack(solution.z, task))
        lost = self.case.lost(motion, problem.multipliers(solution))
        return _Solved(problem, program, bounds, solution, motion, lost)


class _Bench:
    """Solves one case with any method."""

    def __init__(
        self, case: Case, reference: Reference, uniform: Sequence[int], refinements: int
    ) -> None:
        self.case, self.reference, self.meter = case, reference, Meter(case)
        self.uniform, self.refinements = uniform, refinements

    def rows(self, method: Method, modes: list[Formulations]) -> list[Row]:
        """Solve on uniform meshes from the straight line, the finest in every mode, others in the
        last; then, in the last mode, on meshes with knots where this method's motion switches."""
        found: list[Row] = []
        last: _Solved | None = None
        for n in self.uniform:
            mesh = np.full(n, 1 / n)
            if n == self.uniform[-1]:
                for i, mode in enumerate(modes[:-1]):
                    self._mesh(found, method, mode, i > 0, mesh, self.case.guess)
            last = self._mesh(found, method, modes[-1], len(modes) > 1, mesh, self.case.guess)
        for _ in range(self.refinements):
            if last is None or not found[-1].gap > AIM:
                break
            rows = self.case.by_order(last.motion)
            mesh = at_switches(last.problem.mesh, rows, last.lost, AIM)
            if len(mesh) > MOST_INTERVALS:
                break
            last = self._mesh(found, method, modes[-1], len(modes) > 1, mesh, last.motion)
        return found

    def _mesh(
        self,
        found: list[Row],
        method: Method,
        mode: Formulations,
        compiled: bool,
        mesh: Array,
        guess: PiecewisePolynomial,
    ) -> _Solved | None:
        """Add a row; the solution, if there is one."""
        refined = guess is not self.case.guess
        solver = _Solver(self.case, mode[method.equations_key], method.transcription)
        begin = perf_counter()
        try:
            solved = solver.solve(mesh, guess, NEAR if refined else FAR)
        except NotConverged as error:
            seconds = perf_counter() - begin
            name, n = self.case.name, len(mesh)
            found.append(Row(name, method, n, refined, compiled, str(error), seconds))
            return None
        found.append(self._row(method, solved, compiled=compiled, refined=refined))
        return solved if isfinite(found[-1].gap) else None

    def _row(self, method: Method, solved: _Solved, *, compiled: bool, refined: bool) -> Row:
        case, problem, solution = self.case, solved.problem, solved.solution
        quality = self.meter.quality(problem, solution.z)
        failure, rank = "", None
        if not isfinite(quality.safe_duration):
            failure = "leaves the workspace, or no slowing keeps its limits"
        if problem.variables.intervals <= RANK_AT_MOST:
            rank = active_rank(solved.program, solution, solved.bounds, case.task.p)
        return Row(
            case.name,
            method,
            problem.variables.intervals,
            refined,
            compiled,
            failure,
            solution.seconds,
            solution.spent.evaluation,
            solution.iterations,
            len(solution.z),
            int(solved.program.jacobian.nnz_out(1)),
            int(solved.program.hessian.nnz_out(0)),
            quality,
            quality.safe_duration / self.reference.duration - 1,
            rank and rank[0],
            rank and rank[1],
        )
