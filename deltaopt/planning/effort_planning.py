"""Motions that are best in effort, or in time and effort: meshes until the cost settles.

With a running cost the torques of the best motion are smooth but for where they come to a
limit and leave it, so polynomials of a higher degree pay. Nothing may be slowed, for that
costs, or the duration is given: where a mesh solution exceeds a limit between its points the
limit is tightened in that interval, and the mesh solved again.
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
"""By measurement, `deltaopt bench objectives`: degree 3 is no better once a limit is active."""
MOST_INTERVALS = 256
_FRACTIONS = np.linspace(0.0, 1.0, 97)
"""Where in every interval loads are held against their limits."""
_MOST_TIGHTENINGS = 12
_IPOPT_MARGIN = 1 - 2e-8
"""Ipopt widens all bounds by 1e-8."""


def cost_to_minimise(objective: Objective, scaling: Scaling) -> Cost:
    """An objective in a problem's terms, of the order of one."""
    match objective:
        case Time():
            return FASTEST
        case Effort():
            largest = float(scaling.torque.max())
            return Cost(time=0.0, running=1 / largest**2, duration_is_given=True)
        case TimeAndEffort(time=time, effort=effort):
            return Cost(time=1.0, running=effort / time)


def scaling_to_duration(scene: Scene, shortest: float) -> Scaling:
    """Units of a scene, time in that of the duration that it gives or else the shortest (s)."""
    return Scaling(scene, scene.objective.given_duration or shortest)


@dataclass(frozen=True)
class CostIteration:
    """One mesh: ``duration`` (s) and ``cost`` of its motion, in ``unit``, estimated ``gap`` of
    the latter to the least possible, as a fraction of it; seconds ``spent``."""

    intervals: int
    iterations: int
    duration: float
    cost: float
    unit: str
    gap: float
    spent: Spent

    def __str__(self) -> str:
        settled = "nothing to compare it with" if isinf(self.gap) else f"settled to {self.gap:.1e}"
        return (
            f"{self.intervals} intervals, {self.iterations} iterations: {self.cost:.6g} "
            f"{self.unit}, {settled}"
        )


@dataclass(frozen=True)
class EffortResult:
    """The motion of the last mesh, within all limits. ``gap``: as of its round."""

    trajectory: Trajectory
    solution: Solved
    gap: float
    meshes: tuple[CostIteration, ...]


class FastestMotion(Protocol):
    """A motion and its gap, such as a Plan."""

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
    """The best motion of a scene near the fastest, slowed to the duration if that is given, on
    meshes of twice as many intervals each until the gap is within the tolerance.

    The gap is by how much the cost changed from the mesh before, and what keeping the limits
    between the points of the last one costs. It is more than what is left as long as every
    doubling changes the cost by less than half of what the one before did; it is no bound.

    Raises Infeasible where the given duration is too short, and NotConverged.
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
        if found is not None:  # what is there already is a motion all the same
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
    """On the first mesh, and on ever finer ones as long as there may be such."""
    meshes: list[CostIteration] = []
    before, guess, model = np.inf, first, first.model
    scaling = replace(scaling, share=_IPOPT_MARGIN)
    while not meshes or intervals <= MOST_INTERVALS:
        mesh = np.full(intervals, 1 / intervals)
        try:
            raw = _solved(problem, mesh, scaling, guess, model, near=bool(meshes))
        except NotConverged:  # hardly slower than possible, Ipopt loses its way now and then
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
    """With limits tightened where they were exceeded, until they are kept everywhere."""
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
    """By more than the excess, for a peak between points falls by less than what holds at them,
    and the more so, the more often that was done."""
    return np.where(excess > 0, 1 + (1.2 + times / 2) * excess + 1e-8, 1.0)


def _excesses(scaling: Scaling, trajectory: Trajectory) -> Array:
    """By how much each row exceeds its bounds in each interval, (N, rows), not negative.

    Rows of accelerations and torques, in each interval, from samples, but the largest is sought
    between them too; of velocities the largest, for all intervals, since one interval's velocity is
    its neighbours' too. Rows of positions are margins that no tightening is owed.
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
