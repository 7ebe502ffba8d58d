"""Multiplier against explicit against minimal: every pose, loop closure and transcription on a
range of meshes, from one guess, held against one reference.

Times are wall times of Ipopt's solve; what CasADi's functions took is counted apart from what
is left, linear algebra above all. Building and compiling are not in them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.planning.chain import (
    Equations,
    explicit_equations,
    flat_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    LoopClosure,
    Projection,
)
from deltaopt.planning.gap import given_away, refined
from deltaopt.planning.system import System
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.studies.machine_points import in_machine_code
from deltaopt.studies.plan_cases import Case
from deltaopt.studies.plan_measures import Meter, Quality, active_rank

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]
"""Told how much is done (0 to 1) and what comes next."""

LINEAR = PiecewiseAcceleration()
QUADRATIC = PiecewiseAcceleration(2, (0.25, 0.75))
CLOSURES: tuple[LoopClosure, ...] = (
    KnotConstraints(),
    Projection(),
    Baumgarte(),
    AccelerationLevel(),
)
UNIFORM = (10, 20, 40)
"""Intervals of the uniform meshes; the one after them is refined where the flat motion gives
time away."""
REFINED_GAP = 1e-4
"""What the flat motion may give away on the refined mesh."""
RANK_AT_MOST = 10
"""Intervals of the meshes on which the rank is computed, by a dense decomposition."""


@dataclass(frozen=True)
class Method:
    """A way to pose the problem; ``closure`` is empty where no loops are left open."""

    pose: str
    closure: str
    transcription: PiecewiseAcceleration
    build: Callable[[System], Equations]

    @property
    def equations_key(self) -> tuple[str, str]:
        """Methods that share it share their point functions."""
        return self.pose, self.closure

    def __str__(self) -> str:
        parts = (self.pose, self.closure, f"degree {self.transcription.degree}")
        return ", ".join(part for part in parts if part)


@dataclass(frozen=True)
class Row:
    """One method on one mesh, evaluated in one mode.

    ``failure``: what went wrong, empty if nothing. ``seconds``: wall time, of which
    ``evaluation_seconds`` in functions. ``gap``: safe duration / reference - 1.
    ``active_rows``, ``rank``: of the active Jacobian, None on fine meshes.
    """

    case: str
    method: Method
    intervals: int
    refined: bool
    compiled: bool
    failure: str
    seconds: float
    evaluation_seconds: float
    iterations: int
    variables: int
    jacobian_nonzeros: int
    hessian_nonzeros: int
    quality: Quality
    gap: float
    active_rows: int | None
    rank: int | None


@dataclass(frozen=True)
class Reference:
    """The flat motion on meshes refined ever further: ``duration`` (s, safe), ``gap`` (estimate
    of what it is above the optimum, relative), ``mesh`` good for ``REFINED_GAP``."""

    duration: float
    gap: float
    intervals: int
    mesh: Array


@dataclass(frozen=True)
class PlanStudy:
    """All rows; the reference and the seconds of compiling per case."""

    rows: list[Row]
    references: dict[str, Reference]
    compile_seconds: dict[str, float]
    seconds: float


def methods() -> list[Method]:
    """All that is compared."""

    def redundant(
        pose: str,
        equations: Callable[[System, LoopClosure], Equations],
        closure: LoopClosure,
        transcription: PiecewiseAcceleration,
    ) -> Method:
        return Method(pose, closure.name, transcription, lambda s: equations(s, closure))

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
    compiler: str | None,
    tolerance: float = 1e-5,
    uniform: Sequence[int] = UNIFORM,
    progress: Progress = lambda done, what: None,
) -> PlanStudy:
    """Solve every case with every method on every mesh.

    ``compiler``: the command of a C compiler; None leaves compiled times out. ``tolerance``:
    of the reference's gap.
    """
    begin = perf_counter()
    rows: list[Row] = []
    references, compile_seconds = {}, {}
    for i, case in enumerate(cases):

        def tell(done: float, what: str, i: int = i, name: str = case.name) -> None:
            progress((i + done) / len(cases), f"{name}: {what}")

        tell(0.0, "reference")
        references[case.name] = reference = find_reference(case, tolerance)
        bench = _Bench(case, reference, uniform)
        modes: list[dict[tuple[str, str], Equations]] = [bench.interpreted()]
        if compiler:
            tell(0.1, "compiling")
            modes.append(bench.compiled(modes[0], compiler))
        compile_seconds[case.name] = bench.compile_seconds
        for j, method in enumerate(methods()):
            tell(0.2 + 0.8 * j / len(methods()), str(method))
            rows += bench.rows(method, modes)
    progress(1.0, "done")
    return PlanStudy(rows, references, compile_seconds, perf_counter() - begin)


def find_reference(case: Case, tolerance: float) -> Reference:
    """Refine the flat problem until its estimated gap is within the tolerance, or 7 times."""
    equations, meter = flat_equations(case.system), Meter(case)
    mesh, guess, good = np.full(10, 0.1), case.guess, None
    for _ in range(7):
        problem = equations.on(mesh, LINEAR)
        solution = problem.program.solve(
            problem.pack(guess, case.task), *problem.bounds(case.task), case.task.p
        )
        guess = meter.independent(problem, problem.unpack(solution.z, case.task))
        lost = given_away(problem.prices(solution), *case.loads(guess))
        factor = case.safe_factor(guess)
        gap = factor - 1 + lost.total
        if good is None and gap <= REFINED_GAP:
            good = mesh
        if gap <= tolerance:
            break
        mesh = refined(mesh, lost, tolerance / 4 if good is not None else REFINED_GAP / 4)
    last = np.diff(guess.knots) / guess.knots[-1]
    return Reference(
        float(guess.knots[-1]) * factor, gap, len(last), last if good is None else good
    )


class _Bench:
    """Solves one case with any method."""

    def __init__(self, case: Case, reference: Reference, uniform: Sequence[int]) -> None:
        self.case, self.reference, self.meter = case, reference, Meter(case)
        self.meshes = [np.full(n, 1 / n) for n in uniform] + [reference.mesh]
        self.compile_seconds = 0.0

    def interpreted(self) -> dict[tuple[str, str], Equations]:
        return {m.equations_key: m.build(self.case.system) for m in reversed(methods())}

    def compiled(
        self, equations: dict[tuple[str, str], Equations], compiler: str
    ) -> dict[tuple[str, str], Equations]:
        begin = perf_counter()
        fast = {key: in_machine_code(e, compiler) for key, e in equations.items()}
        self.compile_seconds = perf_counter() - begin
        return fast

    def rows(
        self, method: Method, modes: list[dict[tuple[str, str], Equations]]
    ) -> list[Row]:
        return [
            self._row(method, mode[method.equations_key], mesh, compiled=bool(i))
            for mesh in self.meshes
            for i, mode in enumerate(modes)
        ]

    def _row(self, method: Method, equations: Equations, mesh: Array, *, compiled: bool) -> Row:
        task, problem = self.case.task, equations.on(mesh, method.transcription)
        program, bounds = problem.program, problem.bounds(self.case.task)
        guess = problem.pack(self.case.guess, task)
        quality, failure, rank = Quality(), "", None
        begin = perf_counter()
        seconds = evaluation = 0.0
        iterations = 0
        try:
            solution = program.solve(guess, *bounds, task.p)
            seconds, evaluation = solution.seconds, solution.evaluation_seconds
            iterations = solution.iterations
            quality = self.meter.quality(problem, solution.z)
            if not np.isfinite(quality.safe_duration):
                failure = "leaves the workspace, or no slowing keeps its limits"
            if len(mesh) <= RANK_AT_MOST and not compiled:
                rank = active_rank(program, solution, bounds, task.p)
        except NotConverged as error:
            failure, seconds = str(error), perf_counter() - begin
        return Row(
            self.case.name,
            method,
            len(mesh),
            mesh is self.reference.mesh,
            compiled,
            failure,
            seconds,
            evaluation,
            iterations,
            len(guess),
            int(program.jacobian.nnz_out(1)),
            int(program.hessian.nnz_out(0)),
            quality,
            quality.safe_duration / self.reference.duration - 1,
            rank and rank[0],
            rank and rank[1],
        )
