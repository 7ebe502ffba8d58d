"""Joint tables for controllers, and what a controller's interpolation makes of them.

A plan keeps its limits to rounding, but its torques jump. A table of angles at equal steps that
hide a jump, interpolated as drives and PLCs do, asks for more than the plan: so every table is
interpolated here too, and measured against the limits of its scene.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, sqrt

import numpy as np

from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, hermite_pieces
from deltaopt.errors import Infeasible
from deltaopt.limits.limit import first_highest
from deltaopt.motion.extrema import everywhere, peaks, sample_fractions
from deltaopt.motion.limit_curves import LimitShares
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.plan_files import MOST_ROWS, highest_rate
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.machine import Model
from deltaopt.scene.scene import Scene

KEPT = 1.0 + 1e-9
"""Largest share of a limit that a table may ask for and keep it: rounding of its interpolation."""
_SLOWED_TO = 1.0 - 1e-7
"""Largest share where a motion is slowed for a table: another program's interpolation of the rows,
as that of ``foreign_table``, differs by a tenth of that, and is to keep the limits too. Of a limit
of places, which is used up to the last digit at any speed, no such room is left."""
_SAME_ACCELERATION = 1e-9
"""Share of the largest acceleration below which one does not jump at a knot: rounding."""
_MORE_ROWS = (2, 4, 8)
"""Into how many parts intervals between knots are divided for more rows, one after the other: with
two all of 32 tables of motions to goals that are passed kept their limits, with one 25."""
_MOST_SLOWINGS = 1000
_SLOWING = 1.005
"""Largest factor between two durations that are tried: what a table asks for jumps with where its
rows fall, so that a small step may do where the root of the excess overshoots."""


@dataclass(frozen=True, eq=False)
class JointTable:
    """Motor angles, speeds and accelerations at rows of time, (N,) and (N, 3), s, rad, rad/s,
    rad/s².

    Where accelerations jump there are two rows of the same time: just before, and just after.
    ``remarks``: what a reader must know, for the head of a file.
    """

    t: Array
    theta: Array
    dtheta: Array
    ddtheta: Array
    remarks: tuple[str, ...] = ()

    @classmethod
    def at_own_knots(cls, trajectory: Trajectory, parts: int = 1) -> JointTable:
        """Rows at the knots of a motion, and between them at so many equal parts of each interval,
        with accelerations from inside each interval."""
        fractions, knots = np.linspace(0.0, 1.0, parts + 1), trajectory.knots
        inside = trajectory.inside_intervals(fractions)
        times = knots[:-1, None] + np.diff(knots)[:, None] * fractions
        times[:, -1] = knots[1:]  # to the last digit alike on both sides
        found = cls(times.ravel(), inside.theta, inside.dtheta, inside.ddtheta)
        return found._once_where_smooth()

    @classmethod
    def one_after_the_other(cls, tables: Sequence[JointTable]) -> JointTable:
        """The rows of several motions, each of which begins when the one before ends."""
        times, begin = list[Array](), 0.0
        for table in tables:
            times.append(table.t - table.t[0] + begin)
            begin = times[-1][-1]
        theta, dtheta, ddtheta = (
            np.concatenate([getattr(table, name) for table in tables])
            for name in ("theta", "dtheta", "ddtheta")
        )
        return cls(np.concatenate(times), theta, dtheta, ddtheta)._once_where_smooth()

    def _once_where_smooth(self) -> JointTable:
        """Of two rows of the same time the first alone where accelerations do not jump."""
        jumps = np.abs(np.diff(self.ddtheta, axis=0)).max(axis=1)
        smooth = jumps <= _SAME_ACCELERATION * np.abs(self.ddtheta).max()
        return self.rows(np.append(True, ~(smooth & (np.diff(self.t) == 0))))

    @classmethod
    def at_cycle(cls, trajectory: Trajectory, cycle: float) -> JointTable:
        """Rows at every cycle (s) of a motion that lasts a whole number of them.

        Raises ValueError if it does not, and Infeasible for more than ``MOST_ROWS`` rows.
        """
        most = highest_rate(trajectory)
        if 1 / cycle > most:
            raise Infeasible(
                f"the motion takes {trajectory.duration:.6g} s, and a table of it has at most "
                f"{MOST_ROWS} rows: they may be {1 / (0.99 * most):.3g} s apart, not {cycle:g} s"
            )
        number = round(trajectory.duration / cycle)
        if number < 1 or abs(trajectory.duration - number * cycle) > 1e-9 * trajectory.duration:
            raise ValueError(f"{trajectory.duration} s are no whole number of cycles of {cycle} s")
        times = trajectory.knots[0] + trajectory.duration * np.arange(number + 1) / number
        motion = trajectory(times)
        return cls(times, motion.theta, motion.dtheta, motion.ddtheta)

    @property
    def duration(self) -> float:
        """From the first row to the last, s."""
        return float(self.t[-1] - self.t[0])

    def rows(self, which: Array) -> JointTable:
        """Some of the rows, by a mask or indices."""
        return JointTable(self.t[which], self.theta[which], self.dtheta[which], self.ddtheta[which])

    def cubic(self) -> PiecewisePolynomial:
        """The motor angles, rad, over time, s: Hermite pieces from angles and speeds."""
        return pieces_between(self.t, self.theta, self.dtheta)

    def quintic(self) -> PiecewisePolynomial:
        """The motor angles, rad, over time, s: Hermite pieces from accelerations too."""
        return pieces_between(self.t, self.theta, self.dtheta, self.ddtheta)


def pieces_between(t: Array, *columns: Array) -> PiecewisePolynomial:
    """The polynomials between rows of different times t, (N,), from values and derivatives at both
    ends, (N, m) each."""
    lengths = np.diff(t)
    first = np.flatnonzero(lengths > 0)
    begin, end = ([column[rows] for column in columns] for rows in (first, first + 1))
    coefficients = hermite_pieces(lengths[first], begin, end)
    return PiecewisePolynomial(np.append(t[first], t[-1]), coefficients)


@dataclass(frozen=True)
class Interpolation:
    """How a controller moves between the rows of a table: ``pieces`` are the motor angles, rad,
    over time, s."""

    name: str
    pieces: Callable[[JointTable], PiecewisePolynomial]


CUBIC = Interpolation("cubic", JointTable.cubic)
QUINTIC = Interpolation("quintic", JointTable.quintic)


@dataclass(frozen=True)
class Rows:
    """Where a table has its rows: at every ``cycle``, s, or without one at the plan's knots.

    ``parts``: of each interval between knots, at whose ends there are rows too. ``begins``:
    accelerations of the motors, rad/s², with which the rows of another motion end. Its last row is
    the first one of this motion too; None where this one has its own.
    """

    cycle: float | None = None
    parts: int = 1
    begins: tuple[float, ...] | None = None

    @property
    def name(self) -> str:
        """In words as ``deltaopt export`` takes them."""
        return "own-knots" if self.cycle is None else f"{1e3 * self.cycle:g}ms"

    def table(self, trajectory: Trajectory) -> JointTable:
        """Of a motion that fits."""
        if self.cycle is None:
            return JointTable.at_own_knots(trajectory, self.parts)
        table = JointTable.at_cycle(trajectory, self.cycle)
        if self.begins is not None:
            table.ddtheta[0] = self.begins
        return table

    def fitting(self, least: float) -> float:
        """The shortest duration, s, no less than this one, that has whole steps."""
        if self.cycle is None:
            return least
        return max(1, ceil(least / self.cycle * (1 - 1e-12))) * self.cycle


@dataclass(frozen=True)
class Demand:
    """What a table asks for most: a ``share`` of a limit, by name and subject, at a time t, s; and
    the largest share ``of_speed``, of a limit that is not one of places."""

    share: float
    limit: str
    subject: str
    t: float
    of_speed: float

    @property
    def kept(self) -> bool:
        """Whether that is no more than the limit."""
        return self.share <= KEPT


@dataclass(frozen=True, eq=False)
class CheckedTable:
    """A table, how it is interpolated, and what that asks for.

    ``rows``: where it has them. ``slowed``: by which factor the motion was slowed for it, for whole
    cycles or to keep limits.
    """

    table: JointTable
    rows: Rows
    interpolation: Interpolation
    demand: Demand
    slowed: float

    @property
    def sentence(self) -> str:
        """What its interpolation asks for, in words."""
        most = f"{self.demand.share:.6g} of what {self.demand.subject}'s {self.demand.limit} may be"
        return f"{self.interpolation.name} interpolation asks for {most}, at {self.demand.t:.6g} s"


def checked_table(
    scene: Scene,
    trajectory: Trajectory,
    rows: Rows,
    interpolation: Interpolation,
    least: float = 0.0,
) -> CheckedTable:
    """The table of a motion from rest to rest, slowed to whole steps and to a ``least`` duration
    (s), and what it asks for."""
    factor = rows.fitting(max(trajectory.duration, least)) / trajectory.duration
    table = rows.table(trajectory if factor == 1 else trajectory.slowed(factor))
    demand = demand_of(scene, interpolation.pieces(table))
    return CheckedTable(table, rows, interpolation, demand, factor)


def table_within_limits(
    scene: Scene, trajectory: Trajectory, rows: Rows, interpolation: Interpolation, in_time: bool
) -> CheckedTable:
    """The table of a motion whose interpolation keeps every limit: with more rows between knots
    where it is to be ``in_time``, since it or what follows it meets an end that moves; otherwise
    slowed until it does.

    Torques of acceleration fall with the square of the factor, so that its root is the next guess.
    Raises Infeasible where slowing does not help, as where it ``begins`` with too much.
    """
    if rows.cycle is None and in_time:
        for parts in _MORE_ROWS:
            own = replace(rows, parts=parts)
            found = checked_table(scene, trajectory, own, interpolation)
            if found.demand.kept:
                return found
    least, most = trajectory.duration, KEPT
    for _ in range(_MOST_SLOWINGS):
        found = checked_table(scene, trajectory, rows, interpolation, least)
        if found.demand.kept and found.demand.of_speed <= most:
            return found
        if rows.begins is not None and found.demand.t <= found.table.t[0]:
            cure = "slowing does not cure that: rows at own knots or cubic interpolation do"
            raise Infeasible(f"where one motion follows another, {found.sentence}; {cure}")
        now, most = found.slowed * trajectory.duration, _SLOWED_TO
        least = now * min(max(sqrt(found.demand.share / most**2), 1 + 1e-9), _SLOWING)
    raise Infeasible(f"{found.demand.limit} of {found.demand.subject} is exceeded however slow")


def demand_of(scene: Scene, angles: PiecewisePolynomial) -> Demand:
    """What a motion of the motor angles (rad over s) asks for most, between its knots too.

    Raises Unreachable or Singular where the robot cannot follow.
    """
    limits, lengths = LimitShares(problem_of(scene)), np.diff(angles.knots)

    def shares(pieces: Index, fractions: Array) -> Array:
        motion = angles.with_derivatives(pieces, fractions * lengths[pieces])
        return limits(*platform_motion(limits.model, *motion))

    fractions = sample_fractions(len(lengths))
    highest = peaks(shares, fractions, shares(*everywhere(len(lengths), fractions)))
    worst = first_highest(highest.values)
    piece = int(highest.intervals[worst])
    t = float(angles.knots[piece] + highest.fractions[worst] * lengths[piece])
    of_speed = float(highest.values[limits.of_speed].max(initial=0.0))
    return Demand(float(highest.values[worst]), *limits.named[worst], t, of_speed)


def platform_motion(
    model: Model, theta: Array, dtheta: Array, ddtheta: Array
) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of the tool's point, (N, 3) each, for a motion of the
    motors, (N, 3) each: θ̇ = J v and θ̈ = J a + h (v) are solved for v and a.

    Raises Unreachable, and Singular in a singularity.
    """
    x = model.forward_kinematics(theta)
    J = model.jacobian(x)
    v = np.asarray(np.linalg.solve(J, dtheta[..., None])[..., 0], dtype=np.float64)
    h = model.motion(x, v, np.zeros(3))[2][:, model.functions.motors]
    a = np.asarray(np.linalg.solve(J, (ddtheta - h)[..., None])[..., 0], dtype=np.float64)
    return x, v, a
