"""Trajectories: the platform's position as piecewise polynomials, and all that follows from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from deltaopt.curves.passages import passages
from deltaopt.curves.piecewise import Array, PiecewisePolynomial, shifted
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.problem.problem import Problem
from deltaopt.robot.machine import Model

_ROUNDING = 1e-12
"""Share of the duration by which an instant may be outside the motion and is still its end: sums of
the lengths of intervals differ from the last knot by rounding."""

_AS_HIGH = 1e-9
"""By how much a knot may be below a height, m, that it is at but for rounding."""
_BUMP = np.array([0.0, 0.0, 16.0, -32.0, 16.0])
"""Coefficients of 16 u² (1 - u)², ascending powers."""
_LARGEST_FACTOR = 1e30
"""By which a motion can be slowed: its fifth power, by which coefficients are divided, is still a
number."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion at N instants: platform and motors, arrays of shape (N, 3) but for ``t``, (N,); at a
    single instant of shape (3,).

    ``t``: s. ``x``, ``v``, ``a``: position, velocity and acceleration of the platform, m, m/s,
    m/s². ``theta``, ``dtheta``, ``ddtheta``: angles, speeds and accelerations of the motors, rad,
    rad/s, rad/s². ``tau``: motor torques, N·m. ``under_way``: the trajectory that these are
    instants of. Only itself is equal to it.

    Examples:
        >>> motion = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml")).trajectory
        >>> motion(0.05).tau.shape, motion([0.0, 0.05]).tau.shape
        ((3,), (2, 3))
    """

    t: Array
    x: Array
    v: Array
    a: Array
    theta: Array
    dtheta: Array
    ddtheta: Array
    tau: Array
    under_way: Trajectory | None = None

    def __repr__(self) -> str:
        when = f"{self.t.size} instants" if self.t.ndim else f"t = {self.t:.6g} s"
        return f"<Motion at {when}: t, x, v, a, theta, dtheta, ddtheta, tau>"

    @property
    def first(self) -> Motion:
        """The first of its instants alone."""
        names = (each.name for each in fields(self)[:-1])
        return replace(self, **{name: getattr(self, name)[0] for name in names})


@dataclass(frozen=True)
class Trajectory:
    """A motion of the platform over time: call it with instants to get a `Motion`.

    ``position``: of the tool's point, m over s. ``model``: the robot with its payload, which
    gives motor angles and torques. ``coordinates``: all twelve, m and rad, if they were planned as
    polynomials that may violate loop closure; otherwise they follow from the position.

    ``end_velocities``: of the platform before its start and after its end, m/s: at rest there
    unless the ends of the task move.

    A trajectory is equal to one of the same numbers, to the last bit, such as its pickled copy, and
    can be a key of a dictionary: whether others describe the same motion is a question of accuracy.

    Examples:
        >>> motion = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml")).trajectory
        >>> motion([0.0, motion.duration]).x.round(3).tolist()
        [[0.45, -0.05, 0.0], [0.45, 0.1, 0.0]]
        >>> round(motion.slowed(2.0).duration / motion.duration, 9)
        2.0
    """

    position: PiecewisePolynomial
    model: Model
    coordinates: PiecewisePolynomial | None = None
    end_velocities: tuple[Vector3, Vector3] = (REST, REST)

    def __repr__(self) -> str:
        name, intervals = self.model.robot.name, len(self.knots) - 1
        return f"<Trajectory of {self.duration:.6g} s in {intervals} intervals: {name}>"

    @cached_property
    def knots(self) -> Array:
        """Instants where polynomials meet, (K + 1,), s; torques may jump there."""
        return self.position.knots

    @cached_property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return float(self.knots[-1] - self.knots[0])

    def __call__(self, t: ArrayLike) -> Motion:
        """The motion at times t, (N,), s, or at one, a number, in arrays of shape (3,).

        At a knot where the torques jump it is the motion just after, and at the end just before.
        Before the start and after the end the platform is at rest there: velocities and
        accelerations are zero, and the torques hold it against gravity. Raises Unreachable or
        Singular where the platform cannot be or the torques are not defined, and ValueError for
        times that are not numbers.
        """
        try:
            times: Array = np.atleast_1d(np.asarray(t, dtype=float))
        except OverflowError:
            raise ValueError(
                "t is a whole number beyond all doubles; times in s are needed"
            ) from None
        if times.ndim > 1 or np.isnan(times).any():
            found = f"has shape {times.shape}" if times.ndim > 1 else "contains nan"
            raise ValueError(f"t {found}; a number or an array (N,) of times in s is needed")
        begin, end = self.knots[0], self.knots[-1]
        instants: Array = np.clip(times, begin, end)
        outside = np.abs(times - instants) > _ROUNDING * self.duration
        intervals = self.position.interval(instants)
        since = instants - self.knots[intervals]
        x, v, a = self.position.with_derivatives(intervals, since)
        v[outside] = a[outside] = 0.0
        for velocity, beyond in zip(self.end_velocities, (times < begin, times > end), strict=True):
            if velocity != REST:  # it moves on
                x[outside & beyond] += (times - instants)[outside & beyond, None] * velocity
                v[outside & beyond] = velocity
        motion = self._motion(np.where(outside, times, instants), x, v, a)
        return motion if np.ndim(t) else motion.first

    def instants(self, number: int) -> Array:
        """So many times from start to goal, both among them, at equal steps, (N,), s."""
        return np.linspace(self.knots[0], self.knots[-1], number)

    @property
    def shares(self) -> Array:
        """Lengths of the intervals between knots as fractions of the duration, (N,)."""
        return np.diff(self.knots) / self.duration

    @cached_property
    def extent(self) -> float:
        """The largest distance of a knot from the first, m, or of a middle between knots where all
        are at one place: how far the motion goes."""
        for t in (self.knots, (self.knots[:-1] + self.knots[1:]) / 2):
            away = self.position.at(t) - self.position.coefficients[0, 0]
            far = float(np.linalg.norm(away, axis=1).max())
            if far:
                break
        return far

    def inside_intervals(self, fractions: ArrayLike) -> Motion:
        """The motion at fractions of every interval, (K · len(fractions),) instants.

        At the fractions 0 and 1 it is that inside the interval, so that both sides of a jump
        at a knot are given.
        """
        intervals, since = self.position.everywhere(fractions)
        moving = self.position.with_derivatives(intervals, since)
        return self._motion(self.knots[intervals] + since, *moving)

    def path_inside(self, fractions: ArrayLike, highest: int = 2) -> tuple[Array, ...]:
        """Position, velocity, acceleration and so on of the platform, up to the ``highest``
        derivative, at fractions of every interval, (K · len(fractions), 3) each, m, m/s, m/s²,
        without inverse kinematics and dynamics."""
        where = self.position.everywhere(fractions)
        return tuple(self.position.inside(*where, order) for order in range(highest + 1))

    @property
    def accelerations_at_ends(self) -> Array:
        """Accelerations of the platform where every interval begins and where it ends, inside of
        it, (2 K, 3), m/s²: two for each knot between, where they may jump."""
        return self.position.inside(*self.position.everywhere([0.0, 1.0]), 2)

    @property
    def acceleration_jump(self) -> float:
        """All jumps of the platform's acceleration at knots, added up, m/s²."""
        a = self.accelerations_at_ends
        return float(np.linalg.norm(a[2::2] - a[1:-1:2], axis=1).sum())

    def passing(self, points: Sequence[Boundary]) -> Iterator[tuple[float, float]]:
        """By how much the motion misses each point, or the sphere about it, m, and when it is
        nearest, s; each is looked for after the one before it."""
        return passages(self.position, [(each.position, each.within) for each in points])

    def coordinates_inside(self, fractions: ArrayLike) -> tuple[Array, Array, Array]:
        """All coordinates q, q̇, q̈ at fractions of every interval, (K · len(fractions), 12) each.

        They are those of the plan if it has them, otherwise they follow from the position.
        """
        if self.coordinates is None:
            return self.model.motion(*self.path_inside(fractions))
        return self.coordinates.with_derivatives(*self.position.everywhere(fractions))

    def slowed(self, factor: float) -> Trajectory:
        """This path, uniformly ``factor`` times as slow; torques change accordingly.

        Raises ValueError for a factor that is not between 1e-30 and 1e30.
        """
        if not 1 / _LARGEST_FACTOR <= factor <= _LARGEST_FACTOR:
            raise ValueError(
                f"factor is {factor}; it must be finite and greater than 0, from "
                f"{1 / _LARGEST_FACTOR:g} to {_LARGEST_FACTOR:g}"
            )
        coordinates = self.coordinates and self.coordinates.slowed(factor)
        before, after = self.end_velocities
        return replace(
            self,
            position=self.position.slowed(factor),
            coordinates=coordinates,
            end_velocities=(vector3(np.divide(before, factor)), vector3(np.divide(after, factor))),
        )

    def beside(self, way: Array) -> Trajectory:
        """This motion, led aside by ``way`` (3,), m, halfway, and by less before and after.

        It is moved by 16 u² (1 - u)² of that at u = t / duration, so that the places and velocities
        of both ends remain.
        """
        begins = (self.knots[:-1] - self.knots[0]) / self.duration
        bump = shifted(np.tile(_BUMP[:, None], len(begins)), begins)
        bump /= self.duration ** np.arange(len(bump))[:, None]
        own = self.position.coefficients
        aside = np.zeros((len(own), max(own.shape[1], len(bump)), 3))
        aside[:, : own.shape[1]] = own
        aside[:, : len(bump)] += bump.T[:, :, None] * way
        position = PiecewisePolynomial(self.knots, aside)
        return replace(self, position=position, coordinates=None)

    def then(self, other: Trajectory) -> Trajectory:
        """This motion and another from where it ends, as far as the platform's path tells it."""
        return Trajectory(self.position.then(other.position), self.model)

    def _motion(self, t: Array, x: Array, v: Array, a: Array) -> Motion:
        q, dq, ddq = self.model.motion(x, v, a)
        tau = self.model.inverse_dynamics(x, v, a)
        motors = self.model.functions.motors
        return Motion(t, x, v, a, q[:, motors], dq[:, motors], ddq[:, motors], tau, self)


def moving_on(problem: Problem, trajectory: Trajectory) -> Trajectory:
    """A motion that solves a problem, which outside its duration moves on as its ends do."""
    velocities = problem.start.velocity, goal_of(problem, trajectory).velocity
    return replace(trajectory, end_velocities=velocities)


def boundary_instants(problem: Problem, trajectory: Trajectory) -> Array:
    """When a motion is at each of a problem's boundaries, (n,), s: at its first knot and its last,
    and between them at the knots that are nearest to via points, also where these are centres of
    spheres, in their order; with an approach at the first knot as high as it asks for at the start,
    and the last as high as it asks for at the goal."""
    x, knots, gates = trajectory.position.coefficients[:, 0], trajectory.knots, problem.gates
    if any(any(gate.free) for gate in gates):
        levels = (gate.position[0] for gate in gates)
        up, down = (np.flatnonzero(x[1:, 0] <= level + _AS_HIGH) + 1 for level in levels)
        first, last = (up[0], down[-1]) if len(up) and len(down) else (len(x), len(x))
        return knots[[0, first, min(max(last, first + 1), len(x)), -1]]
    found, first = [0], 1
    for number, point in enumerate(gates):
        left = len(gates) - number - 1  # that need a knot each
        away = np.linalg.norm(x[first : len(x) - left] - point.position, axis=1)
        first += int(away.argmin())
        found.append(first)
        first += 1
    return knots[[*found, -1]]


def start_of(position: PiecewisePolynomial) -> Vector3:
    """Where a motion begins, m."""
    return vector3(position.at(position.knots[:1])[0])


def end_of(position: PiecewisePolynomial) -> Vector3:
    """Where a motion ends, m."""
    return vector3(position.at(position.knots[-1:])[0])


def goal_of(problem: Problem, trajectory: Trajectory) -> Boundary:
    """The state that a motion is to end in: on a belt it depends on the motion's duration, and at
    rest anywhere it is where the motion ends."""
    return problem.goal.at(trajectory.duration, end_of(trajectory.position))


def off_its_ends(problem: Problem, trajectory: Trajectory) -> float:
    """How far a motion is off what a problem asks for at its ends, and by how much acceleration
    jumps where it may not, in m and m in its duration."""
    ends, T = (problem.start, goal_of(problem, trajectory)), trajectory.duration
    asked = [(end.position, end.velocity, end.acceleration) for end in ends]
    found = np.stack(trajectory.path_inside([0.0, 1.0]), axis=1)[[0, -1]]
    off = np.abs(found - asked).max(axis=(0, 2)) * np.array([1.0, T, T**2])
    off[2] += trajectory.acceleration_jump * T**2
    return float(off[: problem.limits.constraints.order].max())


def ends_of(problem: Problem, trajectory: Trajectory) -> Array:
    """Where a problem asks a motion to begin and to end, (2, 3), m."""
    return np.array([problem.start.position, goal_of(problem, trajectory).position])
