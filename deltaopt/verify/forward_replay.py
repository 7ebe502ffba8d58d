"""Where the platform goes when the motors apply the reported torques.

The torques, as functions of time, drive forward dynamics with multipliers (model L_I, eq. 37),
and CVODES integrates it to 12 digits, in units in which the robot and its motion are of the order
of one. The torques come from the explicit model L_E (eq. 39); the
two share the mechanism's kinematics, masses and forces, not the way the constraints are eliminated.

A Delta that is held against gravity is unstable: without feedback a deviation grows by a factor e
in a tenth of a second or so, rounding included, and after some seconds it is all there is. So the
motion is also followed in pieces, each from the reported state and too short for that.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, inf, log2
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Trajectory, goal_of
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from deltaopt.verify.units import Units

MOST_AMPLIFIED = 1e4
"""Largest amplification at which the arrival says something of the motion: it turns the 1e-12 of
the integration into 1e-8 m, a thousandth of what is asked."""
_HOPELESS = 1e10
"""Amplification beyond which the arrival is all rounding, and is not computed."""
_FIFTHS, _MIDDLE = np.array([0.1, 0.3, 0.5, 0.7, 0.9]), np.array([0.5])
"""Fractions of an interval at which its dynamics are linearised, each for the stretch about it:
five stretches, or one."""
_MOST_PIECES = 600
"""How many pieces of a motion are integrated at most, which takes a second. Where there are more,
pieces that are spread evenly over every interval are, the first and the last among them."""
_MOST_STRETCHES = 100
"""A motion with more stretches than this has one for each interval instead of five: more take up to
a fifth of the time of a verification, and change the amplification in its third digit."""
_FEWEST_PIECES = 4
"""How many pieces of an interval are integrated at least, for each coefficient of its polynomial,
if it has as many: fewer already determine the polynomial."""


class NotIntegrated(Exception):
    """The motion under the reported torques could not be followed to the end."""


def replay(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """Apply the reported torques from start to goal, and in a long motion in pieces too: the
    measures of where they lead, by the names that they have in a verification.

    Raises NotIntegrated where CVODES fails, on a piece or in a motion that is not long.
    """
    units = Units(scene, trajectory)
    counts, amplification = _pieces(scene, trajectory, units)
    followed = _Followed(scene, trajectory, units)
    is_long = not amplification <= MOST_AMPLIFIED  # nor where it is no number
    away = fast = None
    if amplification <= _HOPELESS:
        start, goal = scene.task.start, goal_of(problem_of(scene), trajectory)
        try:
            away, fast = followed.arrival(start, goal)
        except NotIntegrated:
            if not is_long:  # else lost by rounding
                raise
    found = {"amplification": amplification, "arrival_distance": away, "arrival_speed": fast}
    if is_long:
        found["defect_distance"], found["defect_speed"] = followed.defects(counts)
    return found


class _Followed:
    """What follows the scene's model under the torques of a trajectory, in ``units``."""

    def __init__(self, scene: Scene, trajectory: Trajectory, units: Units) -> None:
        model, torques = model_of(scene.robot, scene.payload).with_multipliers(), trajectory.model
        self.units, self.position = units, units.position(trajectory.position)
        powers = self.position.coefficients.shape[1]
        self._step = _step(model.functions, torques.functions, powers)
        self._p = np.concatenate([units.parameters(model), units.parameters(torques)])

    def after(self, state: Array, interval: int, begin: float, length: float) -> Array:
        """The state (x, v) after a piece of an interval, from that before it, when the piece begins
        since the interval does, and how long it is. Raises NotIntegrated where CVODES fails."""
        coefficients = self.position.coefficients[interval].ravel()
        found = self._step(state, np.concatenate([coefficients, [begin, length], self._p]))
        if not np.isfinite(found).all():
            t = (self.position.knots[interval] + begin) * self.units.time
            raise NotIntegrated(f"CVODES failed after t = {t:.6g} s")
        return found

    def arrival(self, start: Boundary, goal: Boundary) -> tuple[float, float]:
        """Distance to the goal (m) and to its velocity (m/s) at the end, from the scene's start."""
        state = _state(start, self.units)
        for interval, length in enumerate(np.diff(self.position.knots)):
            state = self.after(state, interval, 0.0, length)
        return _in_si(state - _state(goal, self.units), self.units)

    def defects(self, counts: list[float]) -> tuple[float, float]:
        """The largest defect of a piece, m and m/s; ``counts``: pieces of each interval."""
        position, found = self.position, [(0.0, 0.0)]
        most = max(_FEWEST_PIECES * position.coefficients.shape[1], _MOST_PIECES // len(counts))
        for interval, count in enumerate(counts):
            length = (position.knots[interval + 1] - position.knots[interval]) / count
            followed = np.unique(np.linspace(0, count - 1, int(min(count, most))).round())
            own = np.full(len(followed), interval)
            begins, ends = (  # the reported position and velocity
                np.hstack([position.inside(own, length * at, order) for order in range(2)])
                for at in (followed, followed + 1)
            )
            for k, begin, end in zip(followed.tolist(), begins, ends, strict=True):
                away = self.after(begin, interval, k * length, length) - end
                found.append(_in_si(away, self.units))
        distances, speeds = zip(*found, strict=True)
        return max(distances), max(speeds)


def _state(end: Boundary, units: Units) -> Array:
    """Position and velocity of an end of the task, in these units."""
    x, v = np.array(end.position), np.array(end.velocity)
    return np.concatenate([x, v * units.time]) / units.length


def _in_si(away: Array, units: Units) -> tuple[float, float]:
    """The sizes of a difference of positions and of velocities, m and m/s."""
    distance, speed = float(np.linalg.norm(away[:3])), float(np.linalg.norm(away[3:]))
    return distance * units.length, speed * units.length / units.time


def _pieces(scene: Scene, trajectory: Trajectory, units: Units) -> tuple[list[float], float]:
    """How many pieces each interval is integrated in, and the amplification of the whole motion.

    Both by M = ∂(v, a)/∂(x, v), the torques being given functions of time, taken as constant on a
    stretch. A piece is as long as the fastest deviation there needs to grow or shrink by a factor
    e, or to swing by a radian.
    """
    lengths = np.diff(trajectory.knots) / units.time
    inside = _FIFTHS if len(_FIFTHS) * len(lengths) <= _MOST_STRETCHES else _MIDDLE
    stretches = np.repeat(lengths / len(inside), len(inside))
    M = _linearised(scene, trajectory, units, inside)
    rates = np.abs(np.linalg.eigvals(M)).max(axis=-1)  # (stretches,)
    fastest = float(rates.max()) or 1 / float(lengths.sum())
    M[..., :3, 3:] *= fastest  # velocities in units of length times the fastest rate
    M[..., 3:, :3] /= fastest
    transition = np.eye(6)
    for each in _exponentials(M * stretches[:, None, None]):
        transition = each @ transition
    grown = float(np.linalg.norm(transition, 2)) if np.isfinite(transition).all() else inf
    highest = rates.reshape(len(lengths), -1).max(axis=1)
    counts = np.maximum(np.ceil(lengths * highest), 1.0)
    return counts.tolist(), grown


def _exponentials(M: Array) -> Array:
    """exp of matrices (S, n, n): the series of exp (M / 2ᵏ), of norm 1 at most, squared k times."""
    largest = float(np.linalg.norm(M, axis=(1, 2)).max())
    squarings = ceil(log2(max(largest, 1.0)))
    total = term = np.broadcast_to(np.eye(M.shape[1]), M.shape)
    for power in range(1, 20):
        term = term @ M / (power * 2.0**squarings)
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return np.asarray(total)


def _linearised(scene: Scene, trajectory: Trajectory, units: Units, inside: Array) -> Array:
    """M at fractions of every interval in these units, (S, 6, 6)."""
    model, knots = model_of(scene.robot, scene.payload), trajectory.knots
    motion = trajectory((knots[:-1, None] + np.diff(knots)[:, None] * inside).ravel())
    x, v = motion.x / units.length, motion.v * units.time / units.length
    tau = motion.tau / units.torque(model.functions)
    by_state = _by_state(model.functions)(x.T, v.T, tau.T, units.parameters(model))
    M = np.zeros((len(motion.x), 6, 6))
    M[:, :3, 3:] = np.eye(3)
    M[:, 3:] = by_state.full().T.reshape(-1, 6, 3).transpose(0, 2, 1)
    return M


@lru_cache(maxsize=16)
def _by_state(functions: Functions) -> ca.Function:
    """(x, v, τ, p) -> ∂a/∂(x, v), 3 × 6: in scalars, which are evaluated five times as fast."""
    x, v, tau = (ca.SX.sym(name, 3) for name in ("x", "v", "tau"))
    p = functions.symbols()
    a = functions.explicit_acceleration(x, v, tau, p)
    derivatives = ca.horzcat(ca.jacobian(a, x), ca.jacobian(a, v))
    return ca.Function("by_state", [x, v, tau, p], [derivatives], {"cse": True})


@lru_cache(maxsize=16)
def _step(model: Functions, reported: Functions, powers: int) -> PreciseIntegrator:
    """Integrator of the state (x, v) through a piece of an interval, built once for robots alike.

    Its parameters: coefficients of the reported position (powers × 3); when the piece begins,
    since the interval does, and its length; parameters of both models. Units do not matter.
    """
    u, state = ca.MX.sym("u"), ca.MX.sym("state", 6)  # u: fraction of the piece
    coefficients = ca.MX.sym("coefficients", 3, powers)
    begin, length = ca.MX.sym("begin"), ca.MX.sym("length")
    p = ca.MX.sym("p", model.symbols().numel())
    p_reported = ca.MX.sym("p_reported", reported.symbols().numel())
    tau = _reported_torque(reported, powers)(begin + u * length, coefficients, p_reported)
    a = model.forward_dynamics(state[:3], state[3:], tau, p)
    parameters = ca.vertcat(ca.vec(coefficients), begin, length, p, p_reported)
    return PreciseIntegrator(u, state, ca.vertcat(state[3:], a), length, parameters)


def _reported_torque(model: Functions, powers: int) -> ca.Function:
    """(time since the interval began, coefficients 3 × powers, p) -> τ (3): in scalars, which are
    evaluated five times as fast."""
    t, coefficients = ca.SX.sym("t"), ca.SX.sym("coefficients", 3, powers)
    p = model.symbols()
    x = ca.SX.zeros(3)
    for power in reversed(range(powers)):  # Horner
        x = x * t + coefficients[:, power]
    v = ca.jacobian(x, t)
    tau, _ = model.inverse_dynamics(x, v, ca.jacobian(v, t), p)
    return ca.Function("reported_torque", [t, coefficients, p], [tau], {"cse": True})
