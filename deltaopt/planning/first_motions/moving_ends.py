"""First motions where an end moves: from a state, to a state, to a belt, or to rest anywhere.

A motion whose end moves cannot be slowed, so that its duration is chosen at once: of quintics
between both ends the shortest that nearly keeps the limits at samples, or else the one that exceeds
them least.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import ceil, dist, hypot

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial, quintic_rest
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.motion.loads import sizes_at
from deltaopt.motion.trajectory import Trajectory, end_of, start_of
from deltaopt.planning.first_motions.belt import meetings_of
from deltaopt.planning.first_motions.initial_motion import Proposal, angle_quintics
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.moving_ends import Belt, End, State
from deltaopt.scene.scene import Scene

_DURATIONS = 2.0 ** (np.arange(-72, 25) / 6)
"""Durations that are looked at, s: from motions of a millimetre to those of giants, each an eighth
longer than the one before. Limits may be kept by few of them alone, and by others only after a
loop: looked at by powers of two first, those few were passed over."""
_SAMPLES = np.linspace(0.0, 1.0, 9)
"""Fractions of a quintic at which its limits are looked at: it is only a guess."""
_SOONEST, _LEAST_WAIT = 3, 1e-3
"""At how many of the first times at which a belt can be met motions that wait for it meet it, and
the least wait as a share of the motion then."""
_MOST = 100
"""By which factor a mesh may be finer for a motion that waits first. A finer one takes seconds."""
_RESOLVED = 1e-11
"""A way that is none, m: of a motion that ends at the goal, or at rest, but for rounding."""
_PIECES = 12
"""Cubics of which a quintic of the motor angles is made."""
NEARLY = 1.2
"""Excess over its limits with which a guess is good enough: the optimum bends away from it."""
QUICK, _MUCH = 2.3, 0.6
"""Excess of a quick guess, and of what share of the usual one's duration it takes less. What lies
ahead of a moving start is passed at once or after a loop, near which the usual guess is slow. In
the time of the fastest motion a quintic or a spline takes about twice as much torque."""

States = Callable[[float], tuple[Boundary, Boundary]]
"""Duration (s) -> the states that a motion of that duration begins and ends in: with the duration
places move evenly, and velocities do not change."""
Family = Callable[[Array], tuple[Array, Array]]
"""Durations (n,), s -> for each a motion in as many pieces: coefficients of ascending powers of the
time since a piece began, (n, pieces, powers, 3), m, and their lengths, (n, pieces), s."""


def first_moving_motions(
    scene: Scene, under_way: PiecewisePolynomial | None, most: float = NEARLY
) -> Iterator[Proposal]:
    """First guesses, the best first: a quintic that is much quicker than others, if there is one; a
    quintic; one of the motor angles; the motion under way to its end and on from there to the goal,
    where one is under way; a stop, and on from there; a stop, from rest to rest to where a run-up
    to the goal begins, and that.

    ``under_way``: what would follow the start, from the time 0 on, m over s. ``most``: of the
    limits they take at samples, if that is possible; between two rests not more than all, and the
    quick one up to ``QUICK`` of them.
    """
    direct, quick = from_state_to_state(scene, most), straight_on(scene)
    if direct and quick and quick.duration < _MUCH * direct.duration:
        yield Proposal("a quintic", quick)
    if direct is not None:
        yield Proposal("a quintic", direct)
    turning = shortest_to_goal(scene, _of_motor_angles(scene), most)
    if turning is not None:
        yield Proposal("a quintic of the motor angles", turning)
    for motion in _waiting(scene, most):
        yield Proposal("waiting for the belt, then a quintic", motion)
    if under_way is not None:
        for motion in _onwards(scene, under_way, most):
            yield Proposal("the motion under way, and on from its end", motion)
    stop = stopping(scene, most)
    if stop is not None:
        for motion in _onwards(scene, stop.position, most):
            yield Proposal("a stop, and on from there", motion)
    for motion in _with_run_up(scene, stop, most):
        yield Proposal("a run-up to the goal", motion)


def stopping(scene: Scene, most: float = NEARLY) -> Trajectory | None:
    """A quintic from the start to rest; None from rest, or if none stays within reach."""
    start = scene.task.start
    if start.velocity == REST:
        return None
    return shortest_of(scene, _quintics(lambda T: (start, Boundary(_stopped(start, T)))), most=most)


def from_state_to_state(scene: Scene, most: float = NEARLY) -> Trajectory | None:
    """The shortest quintic that nearly keeps the limits at samples, to ``most`` of them, or the one
    that exceeds them least; None if none stays within reach."""
    return shortest_to_goal(scene, _direct(scene), most)


def straight_on(scene: Scene) -> Trajectory | None:
    """The shortest quintic of which the excess is that of a quick guess, or the one that exceeds
    limits least, looked for near the duration too in which the mean of the velocities at its ends
    leads to the goal; None if none stays within reach."""
    start, goal = scene.task.start, scene.task.goal

    def off(T: float) -> Array:
        end = goal.at(T, _stopped(start, T))
        mean = np.add(start.velocity, end.velocity) / 2
        return np.asarray(np.subtract(end.position, start.position) - T * mean)

    way, nearer = off(0.0), off(0.0) - off(1.0)
    T = float(way @ nearer) / max(float(nearer @ nearer), 1e-300)
    durations = np.union1d(_DURATIONS, [T] if T > 0 else [])
    return shortest_of(scene, _direct(scene), durations, most=QUICK)


def _direct(scene: Scene) -> Family:
    """The quintics from start to goal."""
    start, goal = scene.task.start, scene.task.goal
    return _quintics(lambda T: (start, goal.at(T, _stopped(start, T))))


def _of_motor_angles(scene: Scene) -> Family:
    """Motions from start to goal whose motor angles are quintics of time: they stay in the
    workspace where a way straight ahead leads out of it."""
    start, goal = scene.task.start, scene.task.goal
    model = model_of(scene.robot, scene.payload)

    def family(durations: Array) -> tuple[Array, Array]:
        ends = (goal.at(T, _stopped(start, T)) for T in durations.tolist())
        end = np.array([[*each.position, *each.velocity] for each in ends])
        begin = np.tile([*start.position, *start.velocity], (len(end), 1))
        return angle_quintics(model, begin, end, durations, _PIECES)

    return family


def shortest_to_goal(scene: Scene, family: Family, most: float = NEARLY) -> Trajectory | None:
    """``shortest_of`` a family of motions to the goal of a scene. On a belt that goal is in reach
    for some time alone: of durations after which it can be met, if any of these leads there.

    Raises Infeasible where the belt cannot be met.
    """
    goal, found = scene.task.goal, None
    if goal.moves:
        meetings = meetings_of(scene).require_any()
        durations = np.union1d(meetings.durations, meetings.within(_DURATIONS))
        found = shortest_of(scene, family, durations, most)
    return found or shortest_of(scene, family, most=most)


def _waiting(scene: Scene, most: float) -> Iterator[Trajectory]:
    """Motions that wait at a start at rest for a belt that cannot be met yet, and meet it soon
    after it can be."""
    task = scene.task
    if not task.goal.moves or task.start.velocity != REST:
        return
    meetings = meetings_of(scene)
    if meetings.is_possible_at_once:
        return
    for time in meetings.durations[:_SOONEST].tolist():
        found = shortest_of(scene, _after_waiting(task.start, task.goal, time), most=most)
        if found is not None:
            yield found


def intervals_after_waiting(motion: Trajectory, intervals: int) -> int:
    """How many equal intervals a motion needs so that what follows a wait at its start has those
    given, at most ``_MOST`` times as many."""
    waits = not motion.position.coefficients[0, 1:].any()
    moving = motion.duration - (float(np.diff(motion.knots)[0]) if waits else 0.0)
    return ceil(intervals * min(motion.duration / moving, _MOST))


def _after_waiting(start: Boundary, goal: Boundary, time: float) -> Family:
    """Quintics of some durations that meet a belt at a time, s, at rest at the start until then."""

    def family(durations: Array) -> tuple[Array, Array]:
        waits = np.maximum(time - durations, _LEAST_WAIT * durations)
        moving = _coefficients(lambda T: (start, goal.at(T, goal.position)), durations, waits)
        still = np.zeros_like(moving)
        still[:, 0] = start.position
        return np.stack([still, moving], axis=1), np.column_stack([waits, durations])

    return family


def from_end_of(scene: Scene, before: PiecewisePolynomial) -> Scene:
    """The scene from where and when a motion ends instead of its start: at rest or, where that
    moves, in its state."""
    at, v = (vector3(before.at(before.knots[-1:], order)[0]) for order in (0, 1))
    T = float(before.knots[-1])
    start = at if T * hypot(*v) < _RESOLVED else State(at=at, velocity=v)
    return scene.model_copy(update={"start": start, "goal": moved(scene.goal, T)})


def moved(goal: End, since: float) -> End:
    """A goal as it is after a time, s: a belt has moved."""
    return goal.after(since) if isinstance(goal, Belt) else goal


def _onwards(scene: Scene, before: PiecewisePolynomial, most: float) -> Iterator[Trajectory]:
    """A motion, and from its end one to the scene's goal, unless that is where it ends."""
    later, T = from_end_of(scene, before), float(before.knots[-1])
    end = later.task.start
    goal = later.task.goal.at(0.0, end.position)
    off = dist(end.position, goal.position), T * dist(end.velocity, goal.velocity)
    if max(off) < _RESOLVED:
        yield Trajectory(before, model_of(scene.robot, scene.payload))
        return
    then = if_possible(RULED_OUT, first_between, later, most)
    if then is not None:
        yield Trajectory(before.then(then.position), then.model)


def first_between(scene: Scene, most: float = NEARLY) -> Trajectory | None:
    """A first motion between two points, or states; None if none stays within reach.

    Raises Unreachable or Infeasible where none can be driven, or a belt cannot be met.
    """
    if scene.moves_at_ends:
        return from_state_to_state(scene, most)
    return first_motion(scene).slowed(max(1.0, 1 / most))


def _with_run_up(scene: Scene, stop: Trajectory | None, most: float) -> Iterator[Trajectory]:
    """A ``stop``, if the start moves, from rest to rest to where a run-up to the goal begins, and
    the run-up; none to a goal that is not passed in a known state."""
    goal = scene.task.goal
    if not goal.is_given or goal.velocity == REST:
        return
    run_up = run_up_to(scene, goal, most)
    if run_up is None:
        return
    begin = scene.task.start.position if stop is None else end_of(stop.position)
    between = {"start": begin, "goal": start_of(run_up.position)}
    there = if_possible(RULED_OUT, first_between, scene.model_copy(update=between), most)
    if there is not None:
        position = there.position if stop is None else stop.position.then(there.position)
        yield Trajectory(position.then(run_up.position), run_up.model)


def run_up_to(scene: Scene, goal: Boundary, most: float = NEARLY) -> Trajectory | None:
    """A quintic from rest that passes a goal at its velocity; None if none stays within reach."""
    return shortest_of(scene, _quintics(lambda T: (Boundary(_stopped(goal, -T)), goal)), most=most)


def _stopped(state: Boundary, duration: float) -> Vector3:
    """Where a state gets to that comes to rest in a duration (s), its acceleration symmetric in
    time, m; of a negative one where a motion begins at rest that passes the state after it."""
    return vector3(np.array(state.position) + np.array(state.velocity) * duration / 2)


def _quintics(states: States) -> Family:
    """The quintics between states."""
    return lambda durations: (_coefficients(states, durations)[:, None], durations[:, None])


def shortest_of(
    scene: Scene, family: Family, durations: Array = _DURATIONS, most: float = NEARLY
) -> Trajectory | None:
    """The shortest motion of a family that keeps ``most`` of the limits at samples, or the one that
    exceeds them least; None if none stays within reach. ``durations``: that are looked at, s,
    increasing."""
    if not len(durations):
        return None
    coefficients, lengths = family(durations)
    pieces = coefficients.reshape(-1, *coefficients.shape[2:])
    sizes = sizes_at(problem_of(scene), pieces, lengths.ravel(), _SAMPLES)
    highest = sizes.reshape(len(lengths), -1).max(axis=1)
    if not np.isfinite(highest).any():
        return None
    keeping = np.flatnonzero(highest <= most)
    best = keeping[0] if len(keeping) else np.nanargmin(highest)
    knots = np.append(0.0, np.cumsum(lengths[best]))
    position = PiecewisePolynomial(knots, coefficients[best])
    return Trajectory(position, model_of(scene.robot, scene.payload))


def _coefficients(states: States, durations: Array, waits: Array | float = 0.0) -> Array:
    """Of the quintics between states, without acceleration at both ends, (n, 6, 3). ``waits``: how
    much later than after their durations the states are those that they lead between, s."""
    T, after = durations[:, None], (durations + waits)[:, None]
    both = list(zip(states(0.0), states(1.0), strict=True))
    x0, x1 = (
        after * np.subtract(one.position, zero.position) + zero.position for zero, one in both
    )
    v0, v1 = (np.array(zero.velocity) for zero, _ in both)
    way, gain = x1 - x0 - T * v0, T * (v1 - v0)
    within = [x0, T * v0, np.zeros_like(x0), *quintic_rest(way, gain)]
    coefficients = np.stack(within, axis=1)
    return np.asarray(coefficients / np.vander(durations, 6, increasing=True)[:, :, None])
