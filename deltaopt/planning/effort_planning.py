"""Problems of least effort, or of least time and effort: their cost, and where planning begins.

They are planned as those of least time are, on meshes that are refined until the gap is within the
tolerance (``refinement``). But such a motion cannot be slowed to keep its limits, for its duration
is given or part of the cost: as where an end moves, limits that are exceeded between points are
tightened there (``kept_limits``).

In a long time the weight costs more effort than the move does. The best motion then goes to a place
where little torque holds it, waits there, and goes on (the turnpike property). The fastest motion,
slowed, is far from that, and no solver gets there from it; so motions that wait are guesses too
where the duration leaves time for them, on meshes that are fine near the ends and coarse between.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import ENDS_AN_ATTEMPT, Infeasible, if_possible
from deltaopt.limits.running_cost import Running
from deltaopt.motion.motion_sequence import waiting
from deltaopt.motion.running_cost import cost as cost_of
from deltaopt.motion.trajectory import Trajectory, boundary_instants, goal_of
from deltaopt.planning.first_motions.initial_motion import waiting_motions
from deltaopt.planning.nlp.phases import own_mesh
from deltaopt.planning.nlp.problem import FASTEST, SMOOTHLY_FASTEST, Cost, Formulated, Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.problem.boundary import REST
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.scene import Scene

SMOOTH = QUADRATIC
"""The default transcription where Ipopt is asked for, chosen by `python -m studies objectives` of
c34a17b4: degree 1 needs two to eight times as many intervals, degree 3 is no better once a limit is
active. Deltaopt's own method solves meshes of degree 1 in a hundredth of the time."""
MOST_INTERVALS = 256
"""Number of intervals of the mesh of a motion that waits, refined twice: a coarser one is taken if
it would have more."""
_GROWTH = 1.15
"""Ratio of neighbouring intervals towards the middle of a wait. A larger one saves intervals; at
1.5 some motions that wait with the chains nearly stretched do not converge."""
_FEWEST_PER_MOVE = 8
"""Intervals of a move before or after a wait below which no mesh is made coarser: with fewer, such
motions may leave the workspace between the points of the mesh."""
LONGEST = 1000.0
"""Most durations of the fastest motion that may be given. In nearly all of a longer one the motion
rests, which meshes of so many intervals do not resolve."""
_BENDS = 100.0
"""Typical mean square of a jerk of the way over the cube of the duration, and of a torque rate of
the largest torque over the duration."""
_KNOTS = 64
"""Pieces of a motion that is stretched."""
_WAITS_ABOVE = 2.0
"""How many times longer than the fastest motion one of least time and effort takes about, for
motions that wait to be guesses of it: shorter ones have no time for that."""
_ROUGHLY = 1e-4
"""Relative tolerance to which first guesses are solved that are compared."""


def cost_to_minimise(scaling: Scaling) -> Cost:
    """The cost of a nonlinear program for a problem, scaled to the order of one."""
    objective = scaling.problem.objective
    rate = objective.rate
    largest, unit = float(scaling.torque.max()), 1.0
    if rate is Running.JERK:
        unit = scaling.length**2 / scaling.time**6
    if not objective.running:
        return fastest(scaling.problem)
    if objective.time:
        return Cost(1.0, objective.running / objective.time * unit, rate=rate)
    typical = {
        Running.EFFORT: largest**2,
        Running.WEIGHTED_EFFORT: 1.0,
        Running.JERK: _BENDS,
        Running.TORQUE_RATE: _BENDS * (largest / scaling.time) ** 2,
    }
    return Cost(0.0, 1 / typical[rate], duration_is_given=True, rate=rate)


def fastest(problem: Problem) -> Cost:
    """The cost of a motion that is to take the least time."""
    return SMOOTHLY_FASTEST if problem.limits.constraints.order == 3 else FASTEST


def require_possible(given: float, shortest: float, gap: float) -> None:
    """Raise Infeasible where a given duration is too short or too long, s; ``shortest``: of the
    fastest motion that was found, and its gap."""
    if given * (1 + 2 * gap) < shortest:
        raise Infeasible(
            f"duration is {given:g} s, but the fastest motion that was found takes {shortest:.6g} s"
        )
    if given > LONGEST * shortest:
        raise Infeasible(
            f"duration is {given:g} s, in which the motion would rest for all but about "
            f"{shortest:.3g} s; expected at most {LONGEST * shortest:.3g} s, {LONGEST:g} times "
            "as long as the fastest motion"
        )


def in_longer_time(problem: Problem, fastest: Trajectory, duration: float) -> Trajectory:
    """The fastest motion of a problem whose ends move, stretched to a longer ``duration``, s. It
    keeps to its path, and so past bodies, but for a goal on a belt, which is elsewhere then.

    Stretched evenly it would begin and end too slowly; the velocities that were added for that led
    out of reach. So it is as fast as it was at both ends, and slowest half-way.
    """
    longer, u = duration / fastest.duration, np.linspace(0.0, 1.0, _KNOTS + 1)
    # Speed falls from either end to half-way by a power of the time, to a share that is left there.
    power = max(3.0, 2 * longer - 1)
    least = (power / longer - 1) / (power - 1)
    apart = np.abs(2 * u - 1)
    speed = least + (1 - least) * apart ** (power - 1)
    place = least * u + (1 - least) * (1 + np.sign(2 * u - 1) * apart**power) / (2 * power)
    x, v = fastest.position.with_rate_at(fastest.knots[0] + duration * place)
    v *= speed[:, None]
    knots = duration * u
    slower = Trajectory(PiecewisePolynomial.hermite(knots, x, v), fastest.model)
    goal, begin = goal_of(problem, slower), boundary_instants(problem, slower)[-2]
    shift = np.array([np.zeros(3), goal.position - x[-1]])
    last = PiecewisePolynomial.hermite(np.array([begin, duration]), shift, np.zeros((2, 3)))
    own = knots >= begin
    more = last.with_rate_at(knots[own])
    x[own] += more[0]
    v[own] += more[1]
    return Trajectory(PiecewisePolynomial.hermite(knots, x, v), fastest.model)


def least_for_ramps(longer: float) -> int:
    """The fewest intervals whose thirds are no longer than half of what a motion without jumps of
    its torques may take ``longer`` than the fastest, a fraction of it: such a ramp is that long."""
    return int(min(2 / (3 * max(longer, 1e-6)), MOST_INTERVALS))


@dataclass(frozen=True)
class Beginning:
    """A first guess and the first mesh: lengths of the intervals, fractions of the duration."""

    guess: Trajectory
    mesh: Array


def beginnings(
    scene: Scene, problem: Formulated, scaling: Scaling, slowed: Beginning, intervals: int
) -> list[Beginning]:
    """Where to begin: the fastest motion, slowed to the given duration, alone if there is no time
    to wait; else what is found from it and from motions that wait, the least cost first, and
    last that motion itself: what is found on a first mesh may lead through a body.

    ``intervals``: of a move before or after a wait.
    """
    duration = _time_to_wait_in(scene, slowed.guess)
    that_wait = waiting_motions(scene, duration) if duration else []
    if not that_wait:
        return [slowed]
    found, tried = list[tuple[float, Beginning]](), [[slowed]]
    for each in that_wait:
        fewer = intervals, intervals // 2
        meshes = (_waiting_mesh(each, number, scaling.problem.together) for number in fewer)
        tried.append([Beginning(each, mesh) for mesh in meshes])
    for of_one in tried:
        for begin in of_one:
            guess = Guess(begin.guess, near=False, tolerance=_ROUGHLY)
            model = begin.guess.model
            raw = if_possible(ENDS_AN_ATTEMPT, problem(begin.mesh).solve, guess, scaling)
            if raw is not None:
                motion = Trajectory(raw.position, model, raw.coordinates)
                found.append((cost_of(problem_of(scene), motion), replace(begin, guess=motion)))
                break  # a mesh that is half as fine is for a guess that is not solved on the first
    found.sort(key=lambda each: each[0])
    return [*(begin for _, begin in found), slowed]


def _time_to_wait_in(scene: Scene, motion: Trajectory) -> float | None:
    """How long motions of least effort take that may wait: as long as is given, or of least time
    and effort about as long as the fastest ``motion`` slowed until these cost the least, if its
    torques beyond those that hold the robot at the start fall with the square of the speed, s. None
    where that leaves no time to wait, and for other costs."""
    objective = scene.objective
    if objective.rate not in (Running.EFFORT, Running.WEIGHTED_EFFORT):
        return None
    if objective.given_duration is not None:
        return objective.given_duration
    still = waiting(motion.model, scene.given_points[0], REST, motion.duration)
    moving, resting = (cost_of(problem_of(scene), each) for each in (motion, still))
    longer = float(max(1.0, 3 * (moving - resting) / resting) ** (1 / 4))
    return longer * motion.duration if longer > _WAITS_ABOVE else None


def far_and_near(starts: Sequence[Beginning], together: int) -> Iterator[tuple[Beginning, bool]]:
    """Where to begin, and whether that is near: from each far from the limits, and then near them
    on the guess's own mesh, for a motion that is hardly slower than the fastest is at them, and one
    that was solved to be compared is best there. The next one may lead to another, poorer valley.
    """
    for start in starts:
        yield start, False
        yield replace(start, mesh=own_mesh(start.guess, 1, together)), True


def _waiting_mesh(motion: Trajectory, intervals: int, together: int) -> Array:
    """The mesh for a motion of move, wait and move, fractions of its duration.

    At either end, for twice as long as the shorter move takes, every interval is as long as that
    move over ``intervals``, for how a motion comes to rest or leaves takes about as long as a move,
    however long it rests. Towards the middle each is longer than the one before. Each is split into
    so many that are equally long ``together``.
    """
    before, _, after = np.diff(motion.knots)
    shortest, half = min(before, after) / intervals, motion.duration / 2
    lengths = [shortest] * (2 * intervals)
    while sum(lengths) < half:
        lengths.append(_GROWTH * lengths[-1])
    if 4 * len(lengths) > MOST_INTERVALS and intervals > _FEWEST_PER_MOVE:
        # Leave room for a finer mesh, without which the gap could not be estimated.
        return _waiting_mesh(motion, 3 * intervals // 4, together)
    mesh = np.repeat([*lengths, *lengths[::-1]], together)
    return np.asarray(mesh / mesh.sum())
