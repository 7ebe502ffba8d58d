"""What is compared: rest-to-rest tasks of mechanisms, each with one guess for all methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log2

import casadi as ca
import numpy as np

from deltaopt.curves.halving import bisected_number
from deltaopt.curves.piecewise import QUINTIC, Array, PiecewisePolynomial
from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.five_bar import ARM, five_bar, inverse_kinematics
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.formulations.delta import boundary_values, scaled_delta
from deltaopt.planning.formulations.scaled_mechanism import (
    BoundaryValues,
    LimitRows,
    ScaledMechanism,
    ScaledUnits,
)
from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate, error_estimate
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene

RESOLVED = 1e-7
"""Gap of the references that the planner finds."""
SLOWEST = 16.0
"""Largest factor that slowing is tried with."""
_ACCURACY = 1e-12
"""To which the least factor is found."""


@dataclass(frozen=True)
class Reference:
    """The safe ``duration`` (s) of the best motion known, its estimated ``gap`` to the optimum,
    relative, and in ``origin`` how it was found."""

    duration: float
    gap: float
    origin: str


@dataclass(frozen=True)
class Case:
    """A task, the motion of ξ that every method starts from, and the motors' limits.

    ``reference``: finds the best motion, if there is a better way than a fine flat mesh.
    """

    name: str
    system: ScaledMechanism
    task: BoundaryValues
    guess: PiecewisePolynomial
    reference: Callable[[], Reference] | None = None

    def rows(self, position: PiecewisePolynomial) -> Array:
        """Return the limits' rows inside the intervals, (N, 25, rows); NaN out of reach."""
        rows = self._slowed(position)(1.0)
        return rows.reshape(-1, len(FRACTIONS), rows.shape[1])

    def lost(self, position: PiecewisePolynomial, multipliers: Array) -> ErrorEstimate:
        """Return what a motion gives away, from the multipliers of its limits, (N, points, rows).

        What exceeds a bound is slowed away: torque falls with the square of the duration, velocity
        with the duration itself. Positions are only margins.
        """
        orders, rows = self.system.limits.orders, self.rows(position)
        highest = np.abs(rows).max(axis=1) - 1  # (N, rows)
        slowing = 1 + np.where(orders == 2, highest / 2, highest)[:, orders > 0].max(axis=1)
        costing, mesh = orders > 0, np.diff(position.knots) / np.ptp(position.knots)
        return error_estimate(
            mesh, multipliers[:, :, costing], rows[:, :, costing], orders[costing] == 2, slowing
        )

    def by_order(self, position: PiecewisePolynomial) -> ByOrder:
        """Return the rows of controls and of velocities inside the intervals, (N, 25, m) each."""
        rows, limits = self.rows(position), self.system.limits
        velocity = limits.of_order(1)
        states = (None, rows[..., velocity] if velocity else None)
        return ByOrder(rows[..., limits.is_control], states)

    def safe_factor(self, position: PiecewisePolynomial) -> float:
        """Return the smallest factor, at least 1, by which slowing the motion keeps all limits.

        Infinite where there is none, or where the motion leaves the workspace.
        """
        slowed, judged = self._slowed(position), self.system.limits.orders > 0
        if not np.isfinite(slowed(1.0)).all():
            return np.inf

        def kept(k: float) -> bool:
            return bool((np.abs(slowed(k)[:, judged]) <= 1 + 1e-12).all())

        if kept(1.0):
            return 1.0
        if not kept(SLOWEST):
            return np.inf
        return bisected_number(kept, 1.0, SLOWEST, ceil(log2(SLOWEST / _ACCURACY)))[1]

    def _slowed(self, position: PiecewisePolynomial) -> Callable[[float], Array]:
        """The limits' rows of the motion k times as slow, (N · 25, rows), as a function of k.

        Under gravity g, viscous friction c and inertia forces d the torque is g + c / k + d / k².
        """
        p, (g, c, d) = self.task.p, self._torques(position)
        x, v, a = motion_inside(position)
        q, dq, ddq = self.system.rows(self.system.motion, x, v, a, p=p)

        def rows(k: float) -> Array:
            tau, function = g + c / k + d / k**2, self.system.limits.function
            return self.system.rows(function, q, dq / k, ddq / k**2, tau, p=p)[0]

        return rows

    def _torques(self, position: PiecewisePolynomial) -> tuple[Array, Array, Array]:
        """Against gravity, against friction (odd in velocity), for acceleration; (N · 25, m)."""
        x, v, a = motion_inside(position)
        rest, inverse = np.zeros_like(v), self.system.inverse_dynamics

        def torque(v: Array, a: Array) -> Array:
            return self.system.rows(inverse, x, v, a, p=self.task.p)[0]

        gravity, forward, backward = torque(rest, rest), torque(v, a), torque(-v, a)
        return gravity, (forward - backward) / 2, (forward + backward) / 2 - gravity


def motion_inside(position: PiecewisePolynomial) -> tuple[Array, Array, Array]:
    """Return a polynomial and its two derivatives at ``FRACTIONS`` of its intervals, each
    (N · 25, m)."""
    return position.with_derivatives(*position.everywhere(FRACTIONS))


def delta_case(name: str, scene: Scene) -> Case:
    """Return a scene, from its baseline."""
    model, guess = delta_model(scene.robot, scene.payload), first_motion(scene)
    scaling = Scaling(problem_of(scene), guess.duration)
    return Case(
        name,
        scaled_delta(model.functions, scaling.constraints),
        boundary_values(scaling),
        guess.position,
        lambda: _resolved(scene),
    )


def _resolved(scene: Scene) -> Reference:
    """The planner's motion with its switches resolved."""
    found = plan(scene, tolerance=RESOLVED)
    return Reference(found.duration, found.gap, found.transcription)


_START, _GOAL = np.array([0.328, -0.02]), np.array([0.328, 0.02])
"""A move of the five-bar sideways across the low point, where its weak motors can hold the links at
rest, m."""
_TORQUE, _OPENING = 1.4, 0.1**2
"""What its motors give, N·m; the least sin² of the angle between two links."""


def five_bar_case() -> Case:
    """Return the move of the five-bar, from the straight line at its shortest duration."""
    system, distance = _five_bar_system(), float(np.linalg.norm(_GOAL - _START))
    line = np.outer(QUINTIC, _GOAL - _START)
    line[0] += _START
    unit_time = PiecewisePolynomial(np.array([0.0, 1.0]), line[None]).slowed(0.05)

    def task(time: float) -> BoundaryValues:
        return BoundaryValues(np.array([distance, time, _TORQUE, _OPENING]), _START, _GOAL)

    guess = unit_time.slowed(Case("", system, task(1.0), unit_time).safe_factor(unit_time))
    return Case("five_bar", system, task(float(guess.knots[-1])), guess)


def _five_bar_system() -> ScaledMechanism:
    m, scales = five_bar(), SX.sym("scales", 4)
    distance, time, torque, opening = ca.vertsplit(scales)
    angle = distance / ARM
    units = ScaledUnits(
        q=ca.vertcat(distance, distance, *4 * [angle]),
        closure=ca.vertcat(*4 * [distance]),
        time=time,
        energy=torque * angle,
        torque=ca.vertcat(torque, torque),
        motors=SX(0, 1),
    )
    rows = ca.vertcat(m.controls / torque, ca.sin(m.q[2::2] - m.q[3::2]) ** 2 - opening - 1)
    inputs = [m.q, m.dq, m.ddq, m.controls, ca.vertcat(scales, m.parameters)]
    limits = LimitRows(
        ca.Function("limits", inputs, [rows]),
        np.array([2, 2, 0, 0]),
        np.array([[True, True], [True, True], [True, False], [True, False]]),
        np.array([True, True, False, False]),
    )
    return ScaledMechanism(m, (0, 1), inverse_kinematics(), scales, units, limits)
