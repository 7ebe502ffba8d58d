"""Scaling: units of a scene that bring its variables and equations to the order of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.files.validated_record import Vector3
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.running_cost import Running
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.planning.nlp.phases import FacePhases
from deltaopt.planning.nlp.softening import Softening
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.problem import Problem

UNTIGHTENED = 1.0
"""Share of every limit that a motion may use where no limit is tightened."""

_UNRELAXED = 1 - 1e-7
"""Share of limits of position for Ipopt, which exceeds bounds by 1e-8 of them: slowing would not
cure that. It costs ten times less than the smallest tolerance that is planned to on a mesh."""


def weights_motors(constraints: Constraints) -> bool:
    """Whether the effort in the cost weights the motors."""
    return constraints.cost is Running.WEIGHTED_EFFORT


@dataclass(frozen=True)
class Parameters:
    """The parameters of the functions at a point, as symbols by name.

    ``origin`` (3, m), ``length`` (m), ``time`` (s) and ``torque`` (one for each motor, N·m): units
    of the scaled variables. ``motors``: their weights in a weighted effort, 1/(N²m²), none
    elsewhere. ``limits``: numbers of the limits. ``mechanism``: the mechanism's. ``cover``, one,
    and ``widths``, of each motor, as of `Softening`: none without friction that changes its sign.
    """

    origin: ca.SX
    length: ca.SX
    time: ca.SX
    torque: ca.SX
    motors: ca.SX
    limits: ca.SX
    mechanism: ca.SX
    cover: ca.SX
    widths: ca.SX

    @classmethod
    def symbols(
        cls, constraints: Constraints, functions: Functions, mechanism: ca.SX
    ) -> Parameters:
        """Make symbols for all parameters but the mechanism's, whose symbols are given."""
        has_layers = bool(functions.layers(mechanism))
        return cls(
            origin=ca.SX.sym("origin", 3),
            length=ca.SX.sym("length"),
            time=ca.SX.sym("time"),
            torque=ca.SX.sym("torque", constraints.motors),
            motors=ca.SX.sym("motors", constraints.motors * weights_motors(constraints)),
            limits=constraints.numbers(),
            mechanism=mechanism,
            cover=ca.SX.sym("cover", int(has_layers)),
            widths=ca.SX.sym("widths", constraints.motors * has_layers),
        )

    @property
    def units(self) -> ca.SX:
        """The parameters before the numbers of limits."""
        return ca.vertcat(self.origin, self.length, self.time, self.torque, self.motors)

    @property
    def scaling(self) -> ca.SX:
        """The parameters of the scene, in the order of ``Scaling.vector``."""
        return ca.vertcat(self.units, self.limits, self.cover, self.widths)

    @property
    def vector(self) -> ca.SX:
        """All parameters: those of the scene, then the mechanism's."""
        return ca.vertcat(self.scaling, self.mechanism)


@dataclass(frozen=True)
class Scaling:
    """The units of a problem's scaled variables, and its limits.

    Positions are measured from the start in units of the distance from start to goal, or of
    ``extent`` (m) where an end moves; time in units of ``time`` (s), torques in units of the
    largest that the scene allows. ``share``: the part of each limit that a motion may use, one for
    all or by interval and row, (N, rows). ``kept``: indices of the scene's items of limits that are
    considered; None for all. ``faces``: phases past edges; None where there are none.
    ``softening``: of friction; None where it is as it is.
    """

    problem: Problem
    time: float
    share: Array | float = UNTIGHTENED
    kept: tuple[int, ...] | None = None
    extent: float | None = None
    faces: FacePhases | None = None
    softening: Softening | None = None

    @cached_property
    def limits(self) -> SceneLimits:
        """The limits that are considered, with their numbers."""
        limits = self.problem.limits
        return limits if self.kept is None else limits.only(self.kept)

    @cached_property
    def constraints(self) -> Constraints:
        """The limits without their numbers."""
        return self.limits.constraints

    @cached_property
    def origin(self) -> Array:
        """Start of the motion or, if it ends on a belt, its goal at the time 0, (3,), m."""
        start, goal = self.problem.start, self.problem.goal
        return np.array((goal if goal.moves else start).position)

    @cached_property
    def length(self) -> float:
        """Distance from start to goal or, where these move, how far the first guess goes, m."""
        return self.problem.distance if self.extent is None else self.extent

    @cached_property
    def torque(self) -> Array:
        """The unit of torque: the largest that the scene allows each motor, (motors,), N·m."""
        return self.limits.bounds[1][self.constraints.is_control]

    @cached_property
    def at_goal(self) -> Array:
        """Scaled position and velocity at a goal at rest, (6,)."""
        place = self.place(self.problem.goal.position)
        return np.concatenate([place, np.zeros(len(place))])

    def place(self, point: Sequence[float | None]) -> Array:
        """A point in m as a scaled position, (3,); not a number where it is free."""
        return (np.array(point, dtype=float) - self.origin) / self.length

    def rate(self, rate: Vector3, order: int) -> Array:
        """A velocity in m/s (order 1) or an acceleration in m/s² (order 2) in units of length over
        those of ``time``, (3,)."""
        return np.array(rate) * (self.time**order / self.length)

    def shares(self, intervals: int) -> Array:
        """The part of each limit that may be used in each interval, (N, rows)."""
        return np.broadcast_to(self.share, (intervals, self.constraints.number))

    def shares_at(self, intervals: int, fractions: Array) -> Array:
        """The part of each limit that may be used at fractions of the intervals, for Ipopt, (N,
        len(fractions), rows): infinite for limits of position at start and goal, which are given
        and may be at such a limit."""
        shares = np.repeat(self.shares(intervals)[:, None], len(fractions), axis=1)
        places = self.constraints.of_place
        shares[:, :, places] *= _UNRELAXED
        if fractions[0] == 0:
            shares[0, 0, places] = np.inf
        if fractions[-1] == 1:
            shares[-1, -1, places] = np.inf
        return shares

    @property
    def parameters(self) -> Array:
        """Values of ``Parameters.vector``."""
        model = self.problem.model
        softening = np.zeros((1 + self.constraints.motors) * bool(model.layers))
        softening[:1] = self.softening is not None and self.softening.covers
        return np.concatenate([self._units, self.limits.numbers, softening, model.parameters])

    @property
    def _units(self) -> list[float]:
        """Values of ``Parameters.units``."""
        weights = self.problem.objective.motors if weights_motors(self.constraints) else ()
        return [*self.origin, self.length, self.time, *self.torque, *weights]

    @property
    def parameters_in_phases(self) -> list[Array]:
        """Values of ``Parameters.vector`` in each phase of the motion: numbers of limits differ in
        an approach, and past edges."""
        faces, number = self.faces, len(self.gates) + 1
        numbers = self.limits.in_phases(number) if faces is None else faces.numbers
        found, units = np.tile(self.parameters, (number, 1)), len(self._units)
        found[:, units : units + numbers.shape[1]] = numbers
        return list(found)

    @property
    def gates(self) -> tuple[Boundary, ...]:
        """Where the phases of the motion meet."""
        return self.problem.gates if self.faces is None else self.faces.gates

    def instants(self, motion: Trajectory) -> Array:
        """When the phases of a motion begin, and when the last one ends, (phases + 1,), s."""
        if self.faces is None:
            return boundary_instants(self.problem, motion)
        between = motion.knots[0] + motion.duration * self.faces.instants
        return np.concatenate([motion.knots[:1], between, motion.knots[-1:]])

    def polynomial(self, h: Array, coefficients: Array, T: float) -> PiecewisePolynomial:
        """A position in m over s from its scaled coefficients.

        ``coefficients``: ascending powers of the time since an interval began, in units of T, (n,
        powers, 3). ``h``: lengths of the intervals in units of T, (n,). ``T``: s.
        """
        coefficients = self.length * coefficients
        coefficients[:, 0] += self.origin
        coefficients /= np.vander([T], coefficients.shape[1], increasing=True).T
        return PiecewisePolynomial(T * np.concatenate([[0.0], np.cumsum(h)]), coefficients)

    def states(
        self, position: PiecewisePolynomial, times: Array, T: float, derivatives: int = 2
    ) -> Array:
        """Scaled (X, V[, A]) of a position in m at ``times`` (s), so many ``derivatives`` with X,
        V in units of length / T, (n, 3 · derivatives). Where A jumps it is the mean of both sides.
        """
        x, v = position.with_rate_at(times)
        found = [(x - self.origin) / self.length, v * (T / self.length)]
        if derivatives == 3:
            last = len(position.knots) - 2
            before = np.clip(np.searchsorted(position.knots, times) - 1, 0, last)
            left = position.inside(before, times - position.knots[before], 2)
            a = (left + position.at(times, 2)) / 2
            found.append(a * (T**2 / self.length))
        return np.hstack(found)
