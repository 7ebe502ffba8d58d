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
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.time_scaling import loads_inside, speed_excess, torque_excess
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import Guess, Posed, Solved
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.objective import Effort, Objective, Time, TimeAndEffort
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

SMOOTH = QUADRATIC
"""By measurement, `deltaopt bench objectives`: degree 3 is no better once a limit is active."""
MOST_INTERVALS = 256
_FRACTIONS = np.linspace(0.0, 1.0, 97)
"""Where in every interval loads are held against their limits."""
_TIGHTENINGS = 12
_WIDENED = 1 - 2e-8
"""Ipopt widens all bounds by 1e-8."""


def cost_to_minimise(objective: Objective, limits: Vector3) -> Cost:
    """An objective in a problem's terms, of the order of one; ``limits``: of torque, N·m."""
    match objective:
        case Time():
            return FASTEST
        case Effort():
            return Cost(time=0.0, running=1 / max(limits) ** 2, duration_is_given=True)
        case TimeAndEffort(time=time, effort=effort):
            return Cost(time=1.0, running=effort / time)


@dataclass(frozen=True)
class CostRound:
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
class Settled:
    """The motion of the last mesh, within all limits. ``gap``: as of its round."""

    trajectory: Trajectory
    solution: Solved
    gap: float
    rounds: tuple[CostRound, ...]


class Motion(Protocol):
    """A motion and its gap, such as a Plan."""

    @property
    def trajectory(self) -> Trajectory: ...
    @property
    def gap(self) -> float: ...


def least_cost(
    posed: Posed,
    fastest: Motion,
    intervals: int,
    tolerance: float,
    scene: Scene,
    tell: Callable[[str], None],
) -> Settled:
    """The best motion of a scene near the fastest, slowed to the duration if that is given, on
    meshes of twice as many intervals each until the gap is within the tolerance.

    The gap is by how much the cost changed from the mesh before, and what keeping the limits
    between the points of the last one costs. It is more than what is left as long as every
    doubling changes the cost by less than half of what the one before did; it is no bound.

    Raises Infeasible where the given duration is too short, and NotConverged.
    """
    shortest = fastest.trajectory.duration
    given = scene.objective.given_duration or shortest
    if given * (1 + 2 * fastest.gap) < shortest:
        raise Infeasible(
            f"duration is {given:g} s, but the fastest motion that was found takes {shortest:.6g} s"
        )
    first = fastest.trajectory.slowed(given / shortest)
    scales = Scales(scene, given, least_opening(scene))
    settled: Settled | None = None
    try:
        for settled in _on_meshes(posed, scales, first, intervals):
            tell(str(settled.rounds[-1]))
            if settled.gap <= tolerance:
                break
    except NotConverged as error:
        if settled is not None:  # what is there already is a motion all the same
            tell(str(error))
            return settled
        if given >= shortest:
            raise
        raise Infeasible(
            f"duration is {given:g} s, as good as the fastest motion's {shortest:.6g} s, and no "
            f"motion was found that takes no longer: {error}"
        ) from None
    assert settled is not None
    return settled


def _on_meshes(
    posed: Posed, scales: Scales, first: Trajectory, intervals: int
) -> Iterator[Settled]:
    """On the first mesh, and on ever finer ones as long as there may be such."""
    rounds: list[CostRound] = []
    before, guess, model = np.inf, first, first.model
    scales = replace(scales, torque_share=_WIDENED, speed_share=_WIDENED)
    while not rounds or intervals <= MOST_INTERVALS:
        mesh = np.full(intervals, 1 / intervals)
        try:
            raw = _solved(posed, mesh, scales, guess, model, near=bool(rounds))
        except NotConverged:  # hardly slower than possible, Ipopt loses its way now and then
            raw = _solved(posed, mesh, scales, first, model, near=False)
        safe = _within_limits(posed, mesh, scales, raw, model)
        gap = abs(before / raw.cost - 1) + abs(safe.cost / raw.cost - 1)
        rounds.append(_round(safe, intervals, scales, gap))
        yield Settled(safe.trajectory, safe.solution, gap, tuple(rounds))
        before, guess, intervals = raw.cost, safe.trajectory, 2 * intervals


@dataclass(frozen=True)
class _OnMesh:
    solution: Solved
    trajectory: Trajectory
    cost: float
    iterations: int
    spent: Spent


def _solved(
    posed: Posed, mesh: Array, scales: Scales, guess: Trajectory, model: DeltaModel, *, near: bool
) -> _OnMesh:
    start = Guess(guess, near=near, tolerance=1e-8)
    solution = posed.on(mesh).solve(start, scales, model.parameters)
    trajectory = Trajectory(solution.position, model, solution.coordinates)
    return _OnMesh(
        solution,
        trajectory,
        cost_of(scales.scene, trajectory),
        solution.iterations,
        solution.spent,
    )


def _within_limits(
    posed: Posed, mesh: Array, scales: Scales, found: _OnMesh, model: DeltaModel
) -> _OnMesh:
    """With limits tightened where they were exceeded, until they are kept everywhere."""
    scene, iterations, spent = scales.scene, found.iterations, found.spent
    share, speed_share = np.full((len(mesh), 1, 3), _WIDENED), _WIDENED
    for i in range(_TIGHTENINGS):
        torque, speed = _excesses(scene, found.trajectory)
        worst = max(float(torque.max()), speed)
        if worst <= 0:
            return replace(found, iterations=iterations, spent=spent)
        share = share / _tightening(torque, i)
        speed_share /= float(_tightening(np.array(speed), i))
        tightened = replace(scales, torque_share=share, speed_share=speed_share)
        found = _solved(posed, mesh, tightened, found.trajectory, model, near=True)
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


def _excesses(scene: Scene, trajectory: Trajectory) -> tuple[Array, float]:
    """By interval and motor, (N, 1, 3), of torque; the largest of speed; not negative.

    Of samples, but the largest is sought between them too.
    """
    shares = np.abs(loads_inside(scene, trajectory, _FRACTIONS).torque)
    shares = shares.reshape(-1, len(_FRACTIONS), 3)
    excess = np.maximum(shares.max(axis=1, keepdims=True) - 1, 0.0)
    peak, speed = torque_excess(scene, trajectory), speed_excess(scene, trajectory)
    where = int(trajectory.position.interval(np.array([peak.t]))[0])
    excess[where, 0, peak.motor - 1] = max(excess[where, 0, peak.motor - 1], peak.value)
    return excess, 0.0 if speed is None else max(speed.value, 0.0)


def _round(found: _OnMesh, intervals: int, scales: Scales, gap: float) -> CostRound:
    return CostRound(
        intervals,
        found.iterations,
        found.trajectory.duration,
        found.cost,
        scales.scene.objective.unit,
        gap,
        found.spent,
    )
