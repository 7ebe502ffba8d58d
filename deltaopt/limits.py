"""How far a motion is from the limits of its motors, and how slow it must be to keep them.

All of it from inverse dynamics of the motion itself, by the model the scene describes
(never the one a trajectory carries), and between samples too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import inf, sqrt
from typing import NoReturn

import casadi as ca
import numpy as np

from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import Unreachable
from deltaopt.mechanisms.delta import DeltaTerms
from deltaopt.mechanisms.delta_functions import delta_functions
from deltaopt.model import DeltaModel
from deltaopt.peaks import Index, everywhere, peaks, sample_fractions
from deltaopt.rows import RowFunction
from deltaopt.scene import Scene
from deltaopt.trajectory import Array, PiecewisePolynomial, Trajectory

_LoadsOf = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]
"""(x, v, a, p) -> τ, θ̇, 3 each."""


@dataclass(frozen=True)
class Excess:
    """Largest load over its limit, minus 1, over all motors and instants.

    ``value``: positive where a motor cannot do it. ``motor``: which, 1 to 3. ``t``: when, s.
    """

    value: float
    motor: int
    t: float


@dataclass(frozen=True)
class Loads:
    """What the motors bear at N instants, (N, 3) each.

    ``static``: torque against gravity alone, N·m. ``torque``: the whole torque, N·m.
    ``speed``: motor speed, rad/s.
    """

    static: Array
    torque: Array
    speed: Array


def torque_excess(scene: Scene, trajectory: Trajectory) -> Excess:
    """max |τ_k| / τ_max - 1, by the general derivation."""
    limits = np.array(scene.torque_limits)
    return _excess(scene, trajectory, lambda loads: np.abs(loads.torque) / limits)


def speed_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """max |θ̇_k| / ω_max - 1, by the general derivation; None where there is no speed limit."""
    if scene.speed_limits is None:
        return None
    limits = np.array(scene.speed_limits)
    return _excess(scene, trajectory, lambda loads: np.abs(loads.speed) / limits)


def safe_factor(
    scene: Scene, trajectory: Trajectory, at_least: float = 1.0, sampled: Loads | None = None
) -> float:
    """The smallest factor k ≥ ``at_least`` by which slowing the motion keeps all limits.

    Without friction τ = g + d / k² (gravity, and inertia forces d of the motion as given),
    so each sample asks of k² in closed form. Infinite where no k does, such as where
    gravity alone exceeds a torque limit. ``sampled``: ``loads_inside`` of ``sample_fractions``,
    where these are known already.
    """
    demands, along = _demands(scene), _loads_along(scene, trajectory, _quick_loads)
    intervals = len(trajectory.knots) - 1
    fractions = sample_fractions(intervals)
    if sampled is None:
        sampled = along(*everywhere(intervals, fractions))
    highest = peaks(lambda *where: demands(along(*where)), fractions, demands(sampled))
    return _factor(highest.values, at_least)


def sampled_factor(scene: Scene, loads: Loads, at_least: float = 1.0) -> float:
    """The same for the instants of the loads only: a little less where they miss a peak."""
    return _factor(_demands(scene)(loads).max(axis=0), at_least)


def _factor(highest: Array, at_least: float) -> float:
    """From the largest demands, (6 or 9,)."""
    slow_enough, fast_enough = highest[:-3], highest[-3:]
    squared = max(at_least**2, float(slow_enough.max()))
    return sqrt(squared) if fast_enough.max() * squared <= 1 else inf


def loads_inside(scene: Scene, trajectory: Trajectory, fractions: Array) -> Loads:
    """Loads at these fractions, (n,), of every interval, 0 and 1 from inside of it: N = K · n."""
    along = _loads_along(scene, trajectory, _quick_loads)
    return along(*everywhere(len(trajectory.knots) - 1, fractions))


def _demands(scene: Scene) -> Callable[[Loads], Array]:
    """What limits ask of k², (N, 6 or 9): k² ≥ all columns but the last 3, 1/k² ≥ those.

    The last three are positive only where gravity alone exceeds a limit, so that a motor
    needs the motion's help.
    """
    limits = np.array(scene.torque_limits)

    def demands(loads: Loads) -> Array:
        dynamic = loads.torque - loads.static
        size, lack = np.abs(dynamic), np.abs(loads.static) - limits
        room = limits - np.sign(dynamic) * loads.static  # for what inertia forces add
        with np.errstate(divide="ignore", invalid="ignore"):
            torque = np.where(room > 0, size / room, inf)
            help_needed = np.where(lack > 0, lack / size, 0.0)
        if scene.speed_limits is None:
            return np.hstack([torque, help_needed])
        speed = (loads.speed / np.array(scene.speed_limits)) ** 2
        return np.hstack([torque, speed, help_needed])

    return demands


def _excess(scene: Scene, trajectory: Trajectory, ratios: Callable[[Loads], Array]) -> Excess:
    along = _loads_along(scene, trajectory, _general_loads)
    fractions = sample_fractions(len(trajectory.knots) - 1)
    sampled = along(*everywhere(len(trajectory.knots) - 1, fractions))
    highest = peaks(lambda *where: ratios(along(*where)), fractions, ratios(sampled))
    motor = int(np.argmax(highest.values))
    interval, fraction = highest.intervals[motor], highest.fractions[motor]
    begin, end = trajectory.knots[interval : interval + 2]
    t = float(begin + fraction * (end - begin))
    return Excess(float(highest.values[motor]) - 1, motor + 1, t)


def _loads_along(
    scene: Scene, trajectory: Trajectory, of: Callable[[DeltaTerms, int], RowFunction]
) -> Callable[[Index, Array], Loads]:
    """The loads at (interval (N,), fraction of it (N,))."""
    model = trajectory.model
    if model.robot is not scene.robot or model.payload != scene.payload:
        model = DeltaModel(scene.robot, scene.payload)
    coefficients, lengths = _padded(trajectory.position.coefficients), np.diff(trajectory.knots)
    function = of(model.functions.terms, coefficients.shape[1] // 3)

    def along(intervals: Index, fractions: Array) -> Loads:
        since = (lengths[intervals] * fractions)[:, None]
        loads = Loads(*function(coefficients[intervals], since, parameters=model.parameters))
        if not np.isfinite(loads.torque).all():
            _explain(model, trajectory.position, intervals, since[:, 0])
        return loads

    return along


def _padded(coefficients: Array) -> Array:
    """(K, powers, 3) as (K, 3 · powers), powers a multiple of 6: few functions serve all."""
    powers = -(-coefficients.shape[1] // 6) * 6
    padded = np.zeros((len(coefficients), powers, 3))
    padded[:, : coefficients.shape[1]] = coefficients
    return padded.reshape(len(coefficients), -1)


def _explain(
    model: DeltaModel, position: PiecewisePolynomial, intervals: Index, since: Array
) -> NoReturn:
    """Raise what is the matter with a motion that has no torques."""
    velocity = position.derivative()
    polynomials = (position, velocity, velocity.derivative())
    model.inverse_dynamics(*(q.inside(intervals, since) for q in polynomials))
    raise Unreachable("the motion passes a singular position")


@lru_cache(maxsize=16)
def _quick_loads(terms: DeltaTerms, powers: int) -> RowFunction:
    """Loads without angles where the bars allow it: what a planner asks for most."""
    functions = delta_functions(terms, Explicit())
    tau = ca.SX.zeros(3)  # speeds do not depend on it

    def loads(x: ca.SX, v: ca.SX, a: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
        return functions.explicit_torques(x, v, a, p), functions.explicit_equations(
            x, v, a, tau, p
        )[2]

    return _loads_function(loads, terms, powers)


@lru_cache(maxsize=16)
def _general_loads(terms: DeltaTerms, powers: int) -> RowFunction:
    """Loads by the general derivation in twelve coordinates: what verification asks for."""
    functions = delta_functions(terms, Explicit())
    inverse = functions.inverse_dynamics.expand()

    def loads(x: ca.SX, v: ca.SX, a: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
        return inverse(x, v, a, p)[0], functions.velocity(x, v, p)[1][3::3]

    return _loads_function(loads, terms, powers)


def _loads_function(loads: _LoadsOf, terms: DeltaTerms, powers: int) -> RowFunction:
    """(coefficients 3 · powers, time since the interval began, p) -> static τ, τ, θ̇ (3 each)."""
    coefficients, t = ca.SX.sym("coefficients", 3 * powers), ca.SX.sym("t")
    x, v, a = (ca.SX.zeros(3) for _ in range(3))
    for c in reversed(ca.vertsplit(coefficients, 3)):  # Horner, differentiated twice
        a = a * t + 2 * v
        v = v * t + x
        x = x * t + c
    p, rest = ca.SX.sym("p", len(terms.names)), ca.SX.zeros(3)
    static, _ = loads(x, rest, rest, p)
    torque, speed = loads(x, v, a, p)
    inputs, results = [coefficients, t, p], [static, torque, speed]
    return RowFunction(ca.Function("loads", inputs, results, {"cse": True}))
