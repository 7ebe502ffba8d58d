"""Effort planning: motions of least effort, or of least time and effort, on finer and finer meshes.

With effort in the cost the best torques are smooth except where they reach a limit or leave it,
so polynomials of a higher degree need fewer intervals. The motion cannot be slowed to keep its
limits, for its duration is given or part of the cost: where a mesh solution exceeds a limit between
its points, the limit is tightened in that interval and the mesh is solved again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import isinf
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import Infeasible, NotConverged
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.time_scaling import highest_rows, loads_inside
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import FormulatedProblem, Guess, Solved
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.objective import Effort, Objective, Time, TimeAndEffort
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

SMOOTH = QUADRATIC
"""The default transcription, chosen by `python -m studies objectives`: degree 1 needs two to eight
times as many intervals, degree 3 is no better once a limit is active."""
MOST_INTERVALS = 256
"""Number of intervals beyond which meshes are not doubled any more: time grows with the number, and
motions that meet many limits converge slowly."""
_FRACTIONS = np.linspace(0.0, 1.0, 97)
"""Fractions of every interval where a motion is checked against its limits. More of them cost time;
the largest value of each row is sought between them too."""
_MOST_TIGHTENINGS = 12
"""How often a mesh is solved with limits tightened further before that counts as failed."""
_IPOPT_MARGIN = 1 - 2e-8
"""Share of every limit that is used, because Ipopt widens all bounds by 1e-8."""


def cost_to_minimise(objective: Objective, scaling: Scaling) -> Cost:
    """The cost of a nonlinear program for an objective, scaled to the order of one."""
    match objective:
        case Time():
            return FASTEST
        case Effort():
            largest = float(scaling.torque.max())
            return Cost(time=0.0, running=1 / largest**2, duration_is_given=True)
        case TimeAndEffort(time=time, effort=effort):
            return Cost(time=1.0, running=effort / time)


def scaling_to_duration(scene: Scene, shortest: float) -> Scaling:
    """The units of a scene's variables; of time the given duration, or else ``shortest`` (s)."""
    return Scaling(scene, scene.objective.given_duration or shortest)


@dataclass(frozen=True)
class CostIteration:
    """The record of one mesh.

    ``duration`` (s) and ``cost`` (in ``unit``): of its motion, within all limits. ``gap``:
    estimated relative excess of the cost over the least possible. ``spent``: seconds.
    """

    intervals: int
    iterations: int
    duration: float
    cost: float
    unit: str
    gap: float
    spent: Spent

    def __str__(self) -> str:
        gap = "no mesh to compare it with yet" if isinf(self.gap) else f"gap {self.gap:.1e}"
        return (
            f"{self.intervals} intervals, {self.iterations} iterations: {self.cost:.6g} "
            f"{self.unit}, {gap}"
        )


@dataclass(frozen=True)
class EffortResult:
    """The motion of the last mesh, within all limits, with the gap of that mesh."""

    trajectory: Trajectory
    solution: Solved
    gap: float
    meshes: tuple[CostIteration, ...]


class FastestMotion(Protocol):
    """The fastest motion of a scene and its optimality gap, such as a Plan."""

    @property
    def trajectory(self) -> Trajectory: ...
    @property
    def gap(self) -> float: ...


def minimise_effort(
    problem: FormulatedProblem,
    fastest: FastestMotion,
    intervals: int,
    tolerance: float,
    scaling: Scaling,
    report: Callable[[str], None],
) -> EffortResult:
    """Minimise a cost that contains effort; double the mesh until the gap is within ``tolerance``.

    The first guess is the fastest motion, slowed to the given duration if there is one; the result
    is a local minimum near it. ``intervals``: of the first mesh. ``report``: is called with a line
    of text after every mesh.

    The gap is the relative change of the cost from the mesh before, plus what it costs to keep the
    limits between the points of the last one. It exceeds the remaining error as long as every
    doubling changes the cost by less than half as much as the one before; it is no bound.

    Raises Infeasible if the given duration is too short, and NotConverged.
    """
    shortest, given = fastest.trajectory.duration, scaling.time
    if given * (1 + 2 * fastest.gap) < shortest:
        raise Infeasible(
            f"duration is {given:g} s, but the fastest motion that was found takes {shortest:.6g} s"
        )
    first = fastest.trajectory.slowed(given / shortest)
    found: EffortResult | None = None
    try:
        for found in _on_meshes(problem, scaling, first, intervals):
            report(str(found.meshes[-1]))
            if found.gap <= tolerance:
                break
    except NotConverged as error:
        if found is not None:  # the motion of the mesh before remains
            report(str(error))
            return found
        if given >= shortest:
            raise
        raise Infeasible(
            f"duration is {given:g} s, as good as the fastest motion's {shortest:.6g} s, and no "
            f"motion was found that takes no longer: {error}"
        ) from None
    assert found is not None
    return found


def _on_meshes(
    problem: FormulatedProblem, scaling: Scaling, first: Trajectory, intervals: int
) -> Iterator[EffortResult]:
    """The results on a mesh of ``intervals`` and on meshes of twice as many each, lazily."""
    meshes: list[CostIteration] = []
    before, guess, model = np.inf, first, first.model
    scaling = replace(scaling, share=_IPOPT_MARGIN)
    while not meshes or intervals <= MOST_INTERVALS:
        mesh = np.full(intervals, 1 / intervals)
        try:
            raw = _solved(problem, mesh, scaling, guess, model, near=bool(meshes))
        except NotConverged:  # from the mesh before Ipopt may fail if hardly any time is to spare
            raw = _solved(problem, mesh, scaling, first, model, near=False)
        safe = _within_limits(problem, mesh, scaling, raw, model)
        gap = abs(before / raw.cost - 1) + abs(safe.cost / raw.cost - 1)
        meshes.append(_iteration(safe, intervals, scaling, gap))
        yield EffortResult(safe.trajectory, safe.solution, gap, tuple(meshes))
        before, guess, intervals = raw.cost, safe.trajectory, 2 * intervals


@dataclass(frozen=True)
class _OnMesh:
    solution: Solved
    trajectory: Trajectory
    cost: float
    iterations: int
    spent: Spent


def _solved(
    problem: FormulatedProblem,
    mesh: Array,
    scaling: Scaling,
    guess: Trajectory,
    model: DeltaModel,
    *,
    near: bool,
) -> _OnMesh:
    start = Guess(guess, near=near, tolerance=1e-8)
    solution = problem.on(mesh).solve(start, scaling, model.parameters)
    trajectory = Trajectory(solution.position, model, solution.coordinates)
    cost = cost_of(scaling.scene, trajectory)
    return _OnMesh(solution, trajectory, cost, solution.iterations, solution.spent)


def _within_limits(
    problem: FormulatedProblem, mesh: Array, scaling: Scaling, found: _OnMesh, model: DeltaModel
) -> _OnMesh:
    """Solve the mesh again with tighter limits where they are exceeded, until all are kept.

    Raises NotConverged if that does not succeed.
    """
    constraints, iterations, spent = scaling.constraints, found.iterations, found.spent
    share = np.full((len(mesh), constraints.number), _IPOPT_MARGIN)
    for i in range(_MOST_TIGHTENINGS):
        excess = _excesses(scaling, found.trajectory)
        worst = float(excess.max())
        if worst <= 0:
            return replace(found, iterations=iterations, spent=spent)
        share = share / _tightening(excess, i)
        tightened = replace(scaling, share=share)
        found = _solved(problem, mesh, tightened, found.trajectory, model, near=True)
        iterations, spent = iterations + found.iterations, spent + found.spent
    raise NotConverged(
        f"a limit is exceeded by {worst:.1e} between the points of {len(mesh)} intervals, "
        "however much it is tightened",
        found.solution.status,
        found.trajectory,
    )


def _tightening(excess: Array, times: int) -> Array:
    """By what factors limits are tightened, (N, rows), from the excess over them.

    The peak between two points falls by less than the limit at the points, so the factor exceeds
    the excess, and the more so the more often (``times``) the limit was tightened before.
    """
    return np.where(excess > 0, 1 + (1.2 + times / 2) * excess + 1e-8, 1.0)


def _excesses(scaling: Scaling, trajectory: Trajectory) -> Array:
    """By how much each normalised row exceeds its bounds in each interval, (N, rows), at least 0.

    For accelerations and torques: the largest sample in the interval, and the largest value of the
    motion where that lies. For velocities: the largest of the motion in all intervals, since
    neighbouring intervals share their velocity. For positions 0: their rows are not tightened.
    """
    constraints = scaling.constraints
    sizes = constraints.size(loads_inside(scaling.scene, trajectory, _FRACTIONS).rows)
    sizes = sizes.reshape(-1, len(_FRACTIONS), constraints.number).max(axis=1)
    highest = highest_rows(scaling.scene, trajectory)
    at = highest.intervals, np.arange(constraints.number)
    sizes[at] = np.maximum(sizes[at], highest.values)
    velocity = constraints.of_order(1)
    sizes[:, velocity] = highest.values[velocity].max(initial=0.0)
    sizes[:, constraints.of_order(0)] = 0.0
    return np.asarray(np.maximum(sizes - 1, 0.0))


def _iteration(found: _OnMesh, intervals: int, scaling: Scaling, gap: float) -> CostIteration:
    return CostIteration(
        intervals,
        found.iterations,
        found.trajectory.duration,
        found.cost,
        scaling.scene.objective.unit,
        gap,
        found.spent,
    )
