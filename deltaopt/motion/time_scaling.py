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

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import Unreachable
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.motion.extrema import Index, Peaks, everywhere, peaks, sample_fractions
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.scene import Scene

_NOTHING = 1e-60
"""Stands for 0 as a divisor, so that what is asked of k² stays a number."""
_TOO_MUCH = 1e50
"""Of k²: no k does."""


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
    """What the motors bear at N instants, as fractions of their limits.

    ``torque``, ``speed``: (N, 3); speeds without limit are 0. ``demands``: (N, 9), what a
    motion slowed to k times its duration must obey: k² ≥ the first six, by torque and speed,
    1/k² ≥ the last three. These are positive only where gravity alone exceeds a limit, so
    that a motor needs the motion's help.
    """

    torque: Array
    speed: Array
    demands: Array

    def highest_demands(self, samples: int) -> Array:
        """In each interval, of so many samples: (K, 9)."""
        return np.asarray(self.demands.reshape(-1, samples, 9).max(axis=1))


def torque_excess(scene: Scene, trajectory: Trajectory) -> Excess:
    """max |τ_k| / τ_max - 1, by the general derivation."""
    return _excess(scene, trajectory, lambda loads: np.abs(loads.torque))


def speed_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """max |θ̇_k| / ω_max - 1, by the general derivation; None where there is no speed limit."""
    if scene.speed_limits is None:
        return None
    return _excess(scene, trajectory, lambda loads: np.abs(loads.speed))


def safe_factor(
    scene: Scene, trajectory: Trajectory, at_least: float = 1.0, sampled: Loads | None = None
) -> float:
    """The smallest factor k ≥ ``at_least`` by which slowing the motion keeps all limits.

    Without friction τ = g + d / k² (gravity, and inertia forces d of the motion as given),
    so each sample asks of k² in closed form. Infinite where no k does, such as where
    gravity alone exceeds a torque limit. ``sampled``: ``loads_inside`` of ``sample_fractions``,
    where these are known already.
    """
    along, intervals = _loads_along(scene, trajectory, _quick_loads), len(trajectory.knots) - 1
    highest = _highest(along, intervals, lambda loads: loads.demands, sampled)
    return _factor(highest.values, at_least)


def sampled_factor(demands: Array, at_least: float = 1.0) -> float:
    """The same from the demands of samples only, (N, 9): a little less where they miss a peak."""
    return _factor(demands.max(axis=0), at_least)


def slowing_inside(demands: Array) -> Array:
    """What each interval alone asks of k, from its highest demands, (K, 9) -> (K,)."""
    return np.asarray(np.sqrt(demands[:, :6].max(axis=1)))


def _factor(highest: Array, at_least: float) -> float:
    """From the largest demands, (9,)."""
    slow_enough, fast_enough = highest[:6].max(), highest[6:].max()
    squared = np.maximum(at_least**2, slow_enough)  # not a number if one is none
    return sqrt(squared) if squared < _TOO_MUCH and fast_enough * squared <= 1 else inf


def loads_inside(scene: Scene, trajectory: Trajectory, fractions: Array) -> Loads:
    """Loads at these fractions, (n,), of every interval, 0 and 1 from inside of it: N = K · n.

    Raises Unreachable or Singular where the motion has none.
    """
    along = _loads_along(scene, trajectory, _quick_loads)
    return along(*everywhere(len(trajectory.knots) - 1, fractions))


def rough_factor(scene: Scene, trajectory: Trajectory) -> float:
    """``safe_factor`` by samples, of any size; infinite too where the motion has no torques."""
    intervals = len(trajectory.knots) - 1
    evaluate = _Evaluation.of(scene, trajectory, _quick_loads)
    loads = evaluate(*everywhere(intervals, sample_fractions(intervals)))
    return sampled_factor(loads.demands, at_least=0.0)


def _excess(scene: Scene, trajectory: Trajectory, shares: Callable[[Loads], Array]) -> Excess:
    along, intervals = _loads_along(scene, trajectory, _general_loads), len(trajectory.knots) - 1
    highest = _highest(along, intervals, shares)
    motor = int(np.argmax(highest.values))
    interval, fraction = highest.intervals[motor], highest.fractions[motor]
    begin, end = trajectory.knots[interval : interval + 2]
    t = float(begin + fraction * (end - begin))
    return Excess(float(highest.values[motor]) - 1, motor + 1, t)


def _highest(
    along: Callable[[Index, Array], Loads],
    intervals: int,
    of: Callable[[Loads], Array],
    sampled: Loads | None = None,
) -> Peaks:
    """Of all instants, from the loads at the sampled ones, where these are known already."""
    fractions = sample_fractions(intervals)
    known = sampled or along(*everywhere(intervals, fractions))
    return peaks(lambda *where: of(along(*where)), fractions, of(known))


@dataclass(frozen=True)
class _Evaluation:
    """Loads at (interval (N,), fraction of it (N,)); not a number where there are none."""

    model: DeltaModel
    coefficients: Array
    lengths: Array
    function: RowFunction
    parameters: Array

    @classmethod
    def of(
        cls, scene: Scene, trajectory: Trajectory, of: Callable[[DeltaTerms, int], RowFunction]
    ) -> _Evaluation:
        model = delta_model(scene.robot, scene.payload)
        coefficients = _padded(trajectory.position.coefficients)
        function = of(model.functions.terms, coefficients.shape[1] // 3)
        limits = [*scene.torque_limits, *(scene.speed_limits or (inf, inf, inf))]
        parameters = np.concatenate([limits, model.parameters])
        return cls(model, coefficients, np.diff(trajectory.knots), function, parameters)

    def __call__(self, intervals: Index, fractions: Array) -> Loads:
        since = (self.lengths[intervals] * fractions)[:, None]
        coefficients = self.coefficients[intervals]
        return Loads(*self.function(coefficients, since, parameters=self.parameters))


def _loads_along(
    scene: Scene, trajectory: Trajectory, of: Callable[[DeltaTerms, int], RowFunction]
) -> Callable[[Index, Array], Loads]:
    """The loads at (interval (N,), fraction of it (N,)), or an error that says why not."""
    evaluate = _Evaluation.of(scene, trajectory, of)

    def along(intervals: Index, fractions: Array) -> Loads:
        loads = evaluate(intervals, fractions)
        if not np.isfinite(loads.torque).all():
            since = evaluate.lengths[intervals] * fractions
            _explain(evaluate.model, trajectory.position, intervals, since)
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
    return _loads_function(delta_functions(terms, Explicit()).explicit_loads, terms, powers)


@lru_cache(maxsize=16)
def _general_loads(terms: DeltaTerms, powers: int) -> RowFunction:
    """Loads by the general derivation in twelve coordinates: what verification asks for."""
    functions = delta_functions(terms, Explicit())
    x, v, a = (ca.SX.sym(name, 3) for name in ("x", "v", "a"))
    p = terms.symbols().vector()
    torque, _ = functions.inverse_dynamics.expand()(x, v, a, p)
    speed = functions.velocity(x, v, p)[1][3::3]
    return _loads_function(ca.Function("loads", [x, v, a, p], [torque, speed]), terms, powers)


def _loads_function(loads: ca.Function, terms: DeltaTerms, powers: int) -> RowFunction:
    """(coefficients 3 · powers, time since the interval began, limits of torque and speed and
    p) -> torque and speed over their limits (3 each), demands (9); by ``loads``, (x, v, a, p)
    -> τ, θ̇."""
    coefficients, t = ca.SX.sym("coefficients", 3 * powers), ca.SX.sym("t")
    x, v, a = (ca.SX.zeros(3) for _ in range(3))
    for c in reversed(ca.vertsplit(coefficients, 3)):  # Horner, differentiated twice
        a = a * t + 2 * v
        v = v * t + x
        x = x * t + c
    p, rest = ca.SX.sym("p", len(terms.names)), ca.SX.zeros(3)
    limits = ca.SX.sym("limits", 6)
    torque, speed = loads(x, v, a, p)
    torque, speed = torque / limits[:3], speed / limits[3:]
    static = loads(x, rest, rest, p)[0] / limits[:3]
    inputs = [coefficients, t, ca.vertcat(limits, p)]
    results = [torque, speed, _demands(static, torque, speed)]
    return RowFunction(ca.Function("loads", inputs, results, {"cse": True}))


def _demands(static: ca.SX, torque: ca.SX, speed: ca.SX) -> ca.SX:
    """As in ``Loads``, from shares of the limits; ``static``: against gravity alone."""
    dynamic = torque - static
    room = 1 - ca.sign(dynamic) * static  # for what inertia forces add
    slower = ca.fabs(dynamic) / ca.fmax(room, _NOTHING)
    faster = ca.fmax(ca.fabs(static) - 1, 0) / ca.fmax(ca.fabs(dynamic), _NOTHING)
    return ca.vertcat(slower, speed**2, faster)
