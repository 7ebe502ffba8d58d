"""What is compared: rest-to-rest tasks of mechanisms, each with one guess for all methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.five_bar import FiveBarParameters, five_bar, inverse_kinematics
from deltaopt.motion.trajectory import PiecewisePolynomial
from deltaopt.planning.formulations.delta import delta_system, rest_to_rest
from deltaopt.planning.formulations.scaled_mechanism import RestToRest, System, Units
from deltaopt.planning.initial_motion import first_motion
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.planner import plan
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

FRACTIONS = np.linspace(0.0, 1.0, 25)
"""Fractions of every interval where loads are taken, both ends from inside."""
RESOLVED = 1e-7
"""Gap of the references that the planner finds."""
SLOWEST = 16.0
"""Largest factor that slowing is tried with."""


@dataclass(frozen=True)
class Reference:
    """The safe ``duration`` (s) of the best motion known, its estimated ``gap`` to the optimum,
    relative, and in ``origin`` how it was found."""

    duration: float
    gap: float
    origin: str


@dataclass(frozen=True)
class Case:
    """A task, the motion of the independent coordinates ξ that every method starts from, and the
    motors' limits of torque (N·m) and speed (rad/s).

    ``reference``: finds the best motion, if there is a better way than a fine flat mesh.
    """

    name: str
    system: System
    task: RestToRest
    guess: PiecewisePolynomial
    torque: Array
    speed: Array | None = None
    reference: Callable[[], Reference] | None = None

    def loads(self, position: PiecewisePolynomial) -> tuple[Array, Array | None]:
        """Return torques and speeds over their limits, (N, 25, m) each; NaN out of reach."""
        gravity, friction, inertia = self._torques(position)
        shape = (-1, len(FRACTIONS), len(self.torque))
        torque = ((gravity + friction + inertia) / self.torque).reshape(shape)
        if self.speed is None:
            return torque, None
        return torque, (self._speeds(position) / self.speed).reshape(shape)

    def safe_factor(self, position: PiecewisePolynomial) -> float:
        """Return the smallest factor, at least 1, by which slowing the motion keeps all limits.

        Under gravity g, viscous friction c and inertia forces d it is τ = g + c / k + d / k².
        Infinite where there is none, or where the motion leaves the workspace.
        """
        g, c, d = self._torques(position)
        if not np.isfinite(g + c + d).all():
            return np.inf
        least = 1.0
        if self.speed is not None:
            least = max(least, float(np.abs(self._speeds(position) / self.speed).max()))

        def kept(k: float) -> bool:
            return bool((np.abs(g + c / k + d / k**2) <= self.torque * (1 + 1e-12)).all())

        return _smallest(kept, least)

    def _torques(self, position: PiecewisePolynomial) -> tuple[Array, Array, Array]:
        """Against gravity, against friction (odd in velocity), for acceleration; (N · 25, m)."""
        x, v, a = motion_inside(position, FRACTIONS)
        rest, inverse = np.zeros_like(v), self.system.inverse_dynamics

        def torque(v: Array, a: Array) -> Array:
            return self.system.rows(inverse, x, v, a, p=self.task.p)[0]

        gravity, forward, backward = torque(rest, rest), torque(v, a), torque(-v, a)
        return gravity, (forward - backward) / 2, (forward + backward) / 2 - gravity

    def _speeds(self, position: PiecewisePolynomial) -> Array:
        x, v, a = motion_inside(position, FRACTIONS)
        q, dq, _ = self.system.rows(self.system.motion, x, v, a, p=self.task.p)
        m = self.system.mechanism
        rates = ca.Function("rates", [m.q, m.dq, self.system.p], [m.B.T @ m.dq])
        return self.system.rows(rates, q, dq, p=self.task.p)[0]


def motion_inside(position: PiecewisePolynomial, fractions: Array) -> tuple[Array, Array, Array]:
    """Return a polynomial and its two derivatives at fractions of its intervals, each
    (N · len(fractions), m)."""
    velocity = position.derivative()
    lengths = np.diff(position.knots)
    intervals = np.repeat(np.arange(len(lengths)), len(fractions))
    since = (lengths[:, None] * fractions).ravel()
    x, v, a = (p.inside(intervals, since) for p in (position, velocity, velocity.derivative()))
    return x, v, a


def delta_case(name: str, scene: Scene) -> Case:
    """Return the case of a scene, which starts from the scene's straight line."""
    model, guess = DeltaModel(scene.robot, scene.payload), first_motion(scene)
    scales = Scales(scene, guess.duration, least_opening(scene))
    speed = scene.speed_limits
    return Case(
        name,
        delta_system(model.functions, speed=speed is not None),
        rest_to_rest(scales, model.parameters),
        guess.position,
        np.array(scene.torque_limits),
        None if speed is None else np.array(speed),
        lambda: _resolved(scene),
    )


def _resolved(scene: Scene) -> Reference:
    """The planner's motion with its switches resolved."""
    found = plan(scene, tolerance=RESOLVED)
    return Reference(found.duration, found.gap, found.transcription)


@dataclass(frozen=True)
class FiveBarTask:
    """A move of the five-bar sideways across the low point, where its weak motors can hold the
    links at rest: ``start``, ``goal`` in m, ``torque`` in N·m."""

    parameters: FiveBarParameters = field(default_factory=FiveBarParameters)
    start: tuple[float, float] = (0.328, -0.02)
    goal: tuple[float, float] = (0.328, 0.02)
    torque: float = 1.4
    opening: float = 0.1**2

    @cached_property
    def case(self) -> Case:
        """Return the case, which starts from the straight line at its shortest duration."""
        start, goal = np.array(self.start), np.array(self.goal)
        distance = float(np.linalg.norm(goal - start))
        torque = np.full(2, self.torque)
        system = self._system()
        line = np.outer([0, 0, 0, 10, -15, 6], goal - start)
        line[0] += start
        unit_time = PiecewisePolynomial(np.array([0.0, 1.0]), line[None]).slowed(0.05)
        task = RestToRest(np.array([distance, 1.0, self.torque, self.opening]), start, goal)
        guess = unit_time.slowed(Case("", system, task, unit_time, torque).safe_factor(unit_time))
        p = np.array([distance, guess.knots[-1], self.torque, self.opening])
        return Case("five_bar", system, RestToRest(p, start, goal), guess, torque)

    def _system(self) -> System:
        m, scales = five_bar(self.parameters), SX.sym("scales", 4)
        distance, time, torque, opening = ca.vertsplit(scales)
        angle = distance / self.parameters.arm
        units = Units(
            q=ca.vertcat(distance, distance, *4 * [angle]),
            closure=ca.vertcat(*4 * [distance]),
            time=time,
            energy=torque * angle,
            torque=ca.vertcat(torque, torque),
        )
        openings = ca.sin(m.q[2::2] - m.q[3::2]) ** 2 - opening
        return System(m, (0, 1), inverse_kinematics(self.parameters), scales, units, openings)


def _smallest(kept: Callable[[float], bool], least: float) -> float:
    """The least factor from which on ``kept`` holds, by doubling steps and bisection to 1e-12."""
    if kept(least):
        return least
    step = 1e-6
    while not kept(least + step):
        step *= 2
        if step > SLOWEST:
            return np.inf
    low, high = least + step / 2 if step > 1e-6 else least, least + step
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (low, middle) if kept(middle) else (middle, high)
    return high
