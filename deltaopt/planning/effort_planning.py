"""Effort planning: motions of least effort, or of least time and effort, on finer and finer meshes.

With effort in the cost the best torques are smooth except where they reach a limit or leave it,
so polynomials of a higher degree need fewer intervals. The motion cannot be slowed to keep its
limits, for its duration is given or part of the cost: where a mesh solution exceeds a limit between
its points, the limit is tightened in that interval and the mesh is solved again.

In a long time the weight costs more effort than the move does. The best motion then goes to a place
where little torque holds it, waits there, and goes on (the turnpike property). The fastest motion,
slowed, is far from that, and Ipopt does not get there from it; so motions that wait are guesses too
where the duration leaves time for them, on meshes that are fine near the ends and coarse between.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import ENDS_AN_ATTEMPT, Infeasible, NotConverged, Unreachable, if_possible
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.sure_bounds import sure_excess
from deltaopt.motion.time_scaling import highest_rows, loads_inside
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import waiting_motions
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import Formulated, Guess, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.planning.plan import CostIteration, Spent
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.machine import Model
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
_GROWTH = 1.15
"""Ratio of neighbouring intervals towards the middle of a wait. A larger one saves intervals; at
1.5 some motions that wait with the chains nearly stretched do not converge."""
_FEWEST_PER_MOVE = 8
"""Intervals of a move before or after a wait below which no mesh is made coarser: with fewer, such
motions may leave the workspace between the points of the mesh."""
_MOST_TIGHTENINGS = 12
"""How often a mesh is solved with limits tightened further before that counts as failed."""
_LONGEST = 1000.0
"""Most durations of the fastest motion that may be given. In nearly all of a longer one the motion
rests, which meshes of so many intervals do not resolve."""
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
    return Scaling(problem_of(scene), scene.objective.given_duration or shortest)


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
    scene: Scene,
    problem: Formulated,
    fastest: FastestMotion,
    intervals: int,
    tolerance: float,
    scaling: Scaling,
    report: Callable[[str], None],
) -> EffortResult:
    """Minimise a cost that contains effort; double the mesh until the gap is within ``tolerance``.

    The first guess is the fastest motion, slowed to the given duration if there is one; the result
    is a local minimum near it. Where the given duration leaves time to wait, motions that wait are
    guesses too, and the result is the best that is found from any of them on its first mesh,
    refined. ``intervals``: of the first mesh, or of a move before or after a wait. ``report``: is
    called with a line of text after every mesh.

    The gap is the relative change of the cost from the mesh before, plus what it costs to keep the
    limits between the points of the last one. It exceeds the remaining error as long as every
    doubling changes the cost by less than half as much as the one before; it is no bound.

    Raises Infeasible if the given duration is too short or too long; NotConverged or Unreachable if
    every start fails.
    """
    shortest, given = fastest.trajectory.duration, scaling.time
    if given * (1 + 2 * fastest.gap) < shortest:
        raise Infeasible(
            f"duration is {given:g} s, but the fastest motion that was found takes {shortest:.6g} s"
        )
    if given > _LONGEST * shortest:
        raise Infeasible(
            f"duration is {given:g} s, in which the motion would rest for all but about "
            f"{shortest:.3g} s; expected at most {_LONGEST * shortest:.3g} s, {_LONGEST:g} times "
            "as long as the fastest motion"
        )
    slowed = _Start(fastest.trajectory.slowed(given / shortest), np.full(intervals, 1 / intervals))
    scaling = replace(scaling, share=_IPOPT_MARGIN)
    failure: NotConverged | Unreachable | None = None
    for start in _starts(scene, problem, scaling, slowed, intervals):
        try:
            return _settled(problem, scaling, start, tolerance, report)
        except (NotConverged, Unreachable) as error:
            report(str(error))
            failure = error
    assert failure is not None
    if given >= shortest:
        raise failure
    raise Infeasible(
        f"duration is {given:g} s, as good as the fastest motion's {shortest:.6g} s, and no "
        f"motion was found that takes no longer: {failure}"
    ) from None


@dataclass(frozen=True)
class _Start:
    """A first guess and the first mesh: lengths of the intervals, fractions of the duration."""

    guess: Trajectory
    mesh: Array


def _starts(
    scene: Scene, problem: Formulated, scaling: Scaling, slowed: _Start, intervals: int
) -> list[_Start]:
    """Where to start from: the slowed motion alone if there is no time to wait; else what is found
    from it and from motions that wait, the least cost first."""
    waiting: list[Trajectory] = []
    if scaling.problem.objective.duration is not None:
        waiting = waiting_motions(scene, scaling.time)
    if not waiting:
        return [slowed]
    model, found = slowed.guess.model, list[tuple[float, _Start]]()
    for start in (slowed, *(_Start(each, _waiting_mesh(each, intervals)) for each in waiting)):
        raw = if_possible(
            ENDS_AN_ATTEMPT, _solved, problem, start.mesh, scaling, start.guess, model, near=False
        )
        if raw is not None:
            found.append((raw.cost, replace(start, guess=raw.trajectory)))
    found.sort(key=lambda each: each[0])
    return [start for _, start in found] or [slowed]


def _waiting_mesh(motion: Trajectory, intervals: int) -> Array:
    """The mesh for a motion of move, wait and move, fractions of its duration.

    At either end, for twice as long as the shorter move takes, every interval is as long as that
    move over ``intervals``, for how a motion comes to rest or leaves takes about as long as a move,
    however long it rests. Towards the middle each is longer than the one before.
    """
    before, _, after = np.diff(motion.knots)
    shortest, half = min(before, after) / intervals, motion.duration / 2
    lengths = [shortest] * (2 * intervals)
    while sum(lengths) < half:
        lengths.append(_GROWTH * lengths[-1])
    if 4 * len(lengths) > MOST_INTERVALS and intervals > _FEWEST_PER_MOVE:
        # Leave room for a finer mesh, without which the gap could not be estimated.
        return _waiting_mesh(motion, 3 * intervals // 4)
    mesh = np.concatenate([lengths, lengths[::-1]])
    return np.asarray(mesh / mesh.sum())


def _settled(
    problem: Formulated,
    scaling: Scaling,
    start: _Start,
    tolerance: float,
    report: Callable[[str], None],
) -> EffortResult:
    """The result on the first mesh whose gap is within the tolerance, or else on the finest.

    Raises NotConverged if there is none on any mesh.
    """
    found: EffortResult | None = None
    try:
        for found in _on_meshes(problem, scaling, start):
            report(str(found.meshes[-1]))
            if found.gap <= tolerance:
                break
    except NotConverged as error:
        if found is None:
            raise
        report(str(error))  # the motion of the mesh before remains
    assert found is not None
    return found


def _on_meshes(problem: Formulated, scaling: Scaling, start: _Start) -> Iterator[EffortResult]:
    """The results on a first mesh and on meshes of twice as many intervals each, lazily."""
    meshes: list[CostIteration] = []
    before, first, mesh = np.inf, start.guess, start.mesh
    guess, model = first, first.model
    while not meshes or len(mesh) <= MOST_INTERVALS:
        raw = if_possible(
            (NotConverged,), _solved, problem, mesh, scaling, guess, model, near=bool(meshes)
        )
        if raw is None:  # from the mesh before Ipopt may fail if hardly any time is to spare
            raw = _solved(problem, mesh, scaling, first, model, near=False)
        safe = _within_limits(problem, mesh, scaling, raw, model)
        gap = abs(before / raw.cost - 1) + abs(safe.cost / raw.cost - 1)
        meshes.append(_iteration(safe, len(mesh), scaling, gap))
        yield EffortResult(safe.trajectory, safe.solution, gap, tuple(meshes))
        before, guess, mesh = raw.cost, safe.trajectory, np.repeat(mesh / 2, 2)


@dataclass(frozen=True)
class _OnMesh:
    solution: Solved
    trajectory: Trajectory
    cost: float
    iterations: int
    spent: Spent


def _solved(
    problem: Formulated,
    mesh: Array,
    scaling: Scaling,
    guess: Trajectory,
    model: Model,
    *,
    near: bool,
) -> _OnMesh:
    start = Guess(guess, near=near, tolerance=1e-8)
    solution = problem.on(mesh).solve(start, scaling, model.parameters)
    trajectory = Trajectory(solution.position, model, solution.coordinates)
    cost = cost_of(scaling.problem, trajectory)
    return _OnMesh(solution, trajectory, cost, solution.iterations, solution.spent)


def _within_limits(
    problem: Formulated, mesh: Array, scaling: Scaling, found: _OnMesh, model: Model
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
    neighbouring intervals share their velocity. For distances from bodies: what is surely kept at
    all instants. For margins of position that only the planner keeps 0: their rows are not
    tightened.
    """
    constraints = scaling.constraints
    sizes = constraints.size(loads_inside(scaling.problem, trajectory, _FRACTIONS).rows)
    sizes = sizes.reshape(-1, len(_FRACTIONS), constraints.number).max(axis=1)
    highest = highest_rows(scaling.problem, trajectory)
    at = highest.intervals, np.arange(constraints.number)
    sizes[at] = np.maximum(sizes[at], highest.values)
    velocity = constraints.of_order(1)
    sizes[:, velocity] = highest.values[velocity].max(initial=0.0)
    if constraints.has_convex:
        sizes[:, constraints.convex] = 1 + sure_excess(scaling.problem, trajectory.position)
    sizes[:, (constraints.orders == 0) & ~constraints.of_place] = 0.0
    return np.asarray(np.maximum(sizes - 1, 0.0))


def _iteration(found: _OnMesh, intervals: int, scaling: Scaling, gap: float) -> CostIteration:
    return CostIteration(
        intervals,
        found.iterations,
        found.trajectory.duration,
        found.cost,
        scaling.problem.objective.unit,
        gap,
        found.spent,
    )
