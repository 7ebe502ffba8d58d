"""Pontryagin's condition, looked for in a motion alone: nothing of how it was found is used.

Where the motors are at their limits the torques are known, and the costates p = (p_x, p_v)
follow a linear differential equation along the motion,

    ṗ_x = -(∂a/∂x)ᵀ p_v - ∂r/∂x        ṗ_v = -p_x - (∂a/∂v)ᵀ p_v - ∂r/∂v

a being the acceleration and r the rate of what is minimised (1 for time, τᵀτ for effort). So all
of p is p(0) and, where a motor comes to a limit of its speed or a chain to the margin of its
fold, the size of a jump: a handful of numbers. They are those of least squares of

    H = p_x · ẋ + p_v · ẍ + r = 0, or constant where the duration is given
    S_k = ∂H/∂τ_k = 0                    of a motor that is at no limit

(S: the switching functions). What is left is how far the motion is from Pontryagin's condition.
That is necessary and local: where it holds no motion nearby is better to first order; one far
away may be.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene

Integers = NDArray[np.intp]
Truths = NDArray[np.bool]

_STAGES = 8
"""Of Gauss's collocation in every interval."""
_AT_LIMIT, _AT_MARGIN, _LONG = 0.99, 1e-7, 1e-3
"""Of a load, all over an interval; by how much the sine of a held fold may vary, in an interval of
so long a part of the duration if the motor's torque is at its limit."""
_AT_SPEED, _TOUCHES = 1e-5, 1e-7
"""By how much a speed may be below its limit along an interval and at an instant."""
_SPEED, _FOLD = 3, 6
"""First of the three rows that may be held along an interval: torques, θ̈, folds."""


@dataclass(frozen=True)
class Extremal:
    """Along a motion, at N instants, both sides of every knot among them.

    ``t``: s. ``costates``: (p_x, p_v), (N, 6), cost per m and per m/s. ``switching``: S_k times
    the motor's limit, in units of the mean of r, (N, 3): negative where the torque is at its
    upper limit, positive at its lower. ``hamiltonian``: H in that unit, (N,).
    ``hamiltonian_spread``: max |H - mean H|. ``sign_violation``: by how much another torque of
    one motor would lower H, at most, as a fraction of the largest p_v · ∂a/∂τ_k times limit.
    """

    t: Array
    costates: Array
    switching: Array
    hamiltonian: Array
    hamiltonian_spread: float
    sign_violation: float

    @property
    def residual(self) -> float:
        """The larger of both."""
        return max(self.hamiltonian_spread, self.sign_violation)


def extremal(scene: Scene, trajectory: Trajectory) -> Extremal:
    """The costates that fit a motion best, and how well they fit."""
    return _Fit.of(scene, trajectory).solved()


@lru_cache(maxsize=8)
def _rows(terms: DeltaTerms) -> RowFunction:
    """(x, v, a, p) -> what may be held along an interval, τ, θ̈, and the second derivative of
    sin² (q_{k,1} - q_{k,2}), 9; its derivatives by x, v, a, 81; θ̇, that sine and its first
    derivative, 9; their derivatives by x, v, 54."""
    functions = delta_functions(terms, Explicit())
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    p = terms.symbols().vector()
    _, fold, dtheta, ddtheta = functions.explicit_equations(x, v, a, ca.SX.zeros(3), p)
    rate = ca.jtimes(fold, x, v)
    bend = ca.jtimes(rate, x, v) + ca.jtimes(rate, v, a)
    along = ca.vertcat(functions.explicit_torques(x, v, a, p), ddtheta, bend)
    at_entry = ca.vertcat(dtheta, fold, rate)
    by_motion = ca.jacobian(along, ca.vertcat(x, v, a))
    by_state = ca.jacobian(at_entry, ca.vertcat(x, v))
    results = [along, ca.vec(by_motion.T), at_entry, ca.vec(by_state.T)]
    outputs = [ca.densify(result) for result in results]
    return RowFunction(ca.Function("rows", [x, v, a, p], outputs, {"cse": True}))


@dataclass(frozen=True)
class _Fit:
    """The linear equations for p(0) and the jumps, in units of the way, T and the mean of r.

    c: the instants of an interval, its beginning, Gauss's nodes, its end. ``t``: (K, c).
    ``h``: lengths of the intervals, fractions of T, (K,). ``motion``: (V, A), (K, c, 6).
    ``torque``: u, of its limit, (K, c, 3); r grows with ``squares`` u², (3,). ``held``: rows, (K,
    3): of each motor its torque or, if that is at no limit, what it holds instead. ``sign``: of
    the limit that the torque is at, (K, 3), 0 if it is at none. ``slopes``: ∂A/∂(X, V), (K, c, 3,
    6). ``by_held``: ∂A/∂ of what is held, (K, c, 3, 3). ``rate``: r, (K, c). ``rate_slopes``: its
    derivatives by (X, V), (K, c, 6). ``jumps``: by interval, directions in which p may jump where
    it begins, (jumps, 6).
    """

    scene: Scene
    t: Array
    units: tuple[float, float, float]
    h: Array
    motion: Array
    torque: Array
    squares: Array
    held: Integers
    sign: Array
    slopes: Array
    by_held: Array
    rate: Array
    rate_slopes: Array
    jumps: dict[int, Array]

    @classmethod
    def of(cls, scene: Scene, trajectory: Trajectory) -> _Fit:
        model = delta_model(scene.robot, scene.payload)
        fractions = gauss().fractions
        x, v, a = trajectory.path_inside(fractions)
        T, D = trajectory.duration, float(np.linalg.norm(np.subtract(scene.goal, scene.start)))
        K, c = len(trajectory.knots) - 1, len(fractions)
        results = _rows(model.functions.terms)(x, v, a, parameters=model.parameters)
        along, by_motion, at_entry, by_state = (
            part.reshape(K, c, *shape)
            for part, shape in zip(results, ((9,), (9, 9), (9,), (9, 6)), strict=True)
        )
        units = np.repeat([D, D / T, D / T**2], 3)
        by_motion, by_state = by_motion * units, by_state * units[:6]
        limits = np.array(scene.torque_limits)
        lengths = np.diff(trajectory.knots)
        sign = _signs(along[..., :3] / limits)
        states = _states(scene, sign, at_entry, lengths / T)
        held = _rows_held(sign, states)
        rows = np.take_along_axis(by_motion, held[:, None, :, None], axis=2)
        by_held = np.linalg.inv(rows[..., 6:])
        slopes = -by_held @ rows[..., :6]
        torque_slopes = by_motion[:, :, :3, :6] + by_motion[:, :, :3, 6:] @ slopes
        time, effort = scene.objective.weights
        rate = time + effort * (along[..., :3] ** 2).sum(axis=2)
        mean = float(lengths @ (rate[:, 1:-1] @ gauss().weights)) / T
        by_torque = 2 * effort / mean * along[..., None, :3]  # ∂r/∂τ, a row
        return cls(
            scene=scene,
            t=trajectory.knots[:-1, None] + lengths[:, None] * fractions,
            units=(D, T, mean),
            h=lengths / T,
            motion=np.hstack([v * T / D, a * T**2 / D]).reshape(K, c, 6),
            torque=along[..., :3] / limits,
            squares=effort / mean * limits**2,
            held=held,
            sign=sign,
            slopes=slopes,
            by_held=by_held * np.where(held < _SPEED, limits, 1.0)[:, None, None],
            rate=rate / mean,
            rate_slopes=(by_torque @ torque_slopes)[:, :, 0],
            jumps=_jumps(states | _touched(scene, states, at_entry), states, by_state[:, 0]),
        )

    def solved(self) -> Extremal:
        p = self._costates()
        H = (p * self.motion[..., None]).sum(axis=2)
        H[..., -1] += self.rate
        of_torque = (self.held < _SPEED)[:, None]
        S = np.einsum("kcaj,kcau->kcju", self.by_held, p[:, :, 3:]) * of_torque[..., None]
        S[..., -1] += 2 * self.squares * self.torque * of_torque
        free = (self.held < _SPEED) & (self.sign == 0)
        given = float(self.scene.objective.given_duration is not None)
        level = np.full((*H.shape[:2], 1), -given)  # H is this unknown where T is given
        equations = [np.concatenate([level, H], axis=2).reshape(-1, H.shape[-1] + 1)]
        of_free = S.transpose(0, 2, 1, 3)[free]  # (free, c, u)
        weights = np.broadcast_to(np.sqrt(self.h)[:, None], free.shape)[free]
        of_free = of_free * weights[:, None, None]
        none = np.zeros((*of_free.shape[:2], 1))
        equations.append(np.concatenate([none, of_free], axis=2).reshape(-1, H.shape[-1] + 1))
        rows = np.concatenate(equations)
        u = np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=1e-11)[0]
        u = np.append(u[1:], 1.0)
        return self._extremal(p @ u, S @ u, H @ u)

    def _extremal(self, p: Array, S: Array, H: Array) -> Extremal:
        (D, T, mean), torque = self.units, self.torque
        by_motion = S - 2 * self.squares * torque  # H is this times u, and squares u²
        with np.errstate(divide="ignore", invalid="ignore"):
            best = np.clip(-by_motion / (2 * self.squares), -1, 1)
        best = np.where(by_motion == 0, torque, best)
        lowered = by_motion * (torque - best) + self.squares * (torque**2 - best**2)
        lowered *= (self.held < _SPEED)[:, None]
        largest = np.abs(by_motion).max()
        return Extremal(
            t=self.t.ravel(),
            costates=(p * mean * T / np.repeat([D, D / T], 3)).reshape(-1, 6),
            switching=S.reshape(-1, 3),
            hamiltonian=H.ravel(),
            hamiltonian_spread=float(np.abs(H - H.mean()).max()),
            sign_violation=float(lowered.max() / largest) if largest else 0.0,
        )

    def _costates(self) -> Array:
        """p at the instants, (K, c, 6, unknowns + 1): linear in the unknowns, p(0) and the
        jumps; the last column is what does not depend on them."""
        inside, source = self._responses()
        number = 6 + sum(len(jump) for jump in self.jumps.values())
        now, place = np.zeros((6, number + 1)), 6
        now[:, :6] = np.eye(6)
        p = np.empty((len(self.h), len(gauss().fractions), 6, number + 1))
        for i in range(len(self.h)):
            for direction in self.jumps.get(i, ()):
                now = now.copy()
                now[:, place] += direction
                place += 1
            p[i, 0] = now
            p[i, 1:] = inside[i] @ now
            p[i, 1:, :, -1] += source[i]
            now = p[i, -1]
        return p

    def _responses(self) -> tuple[Array, Array]:
        """p inside an interval and at its end by p at its beginning, (K, c - 1, 6, 6), and by
        the rate alone, (K, c - 1, 6): Gauss's collocation of the adjoint equation."""
        by_gauss, K = gauss(), len(self.h)
        M = np.zeros((K, _STAGES, 6, 6))  # ṗ = M p + g
        M[..., :, 3:] = -self.slopes[:, 1:-1].transpose(0, 1, 3, 2)
        M[..., 3:, :3] -= np.eye(3)
        g = -self.rate_slopes[:, 1:-1]
        coupled = np.einsum("k,kiab,ij->kiajb", self.h, M, by_gauss.a)
        system = np.eye(6 * _STAGES) - coupled.reshape(K, 6 * _STAGES, -1)
        right = np.concatenate([M, g[..., None]], axis=3).reshape(K, 6 * _STAGES, 7)
        slopes = np.linalg.solve(system, right).reshape(K, _STAGES, 6, 7)
        weights = np.vstack([by_gauss.a, by_gauss.weights])
        steps = np.einsum("k,ij,kjab->kiab", self.h, weights, slopes)
        steps[..., :6] += np.eye(6)
        return steps[..., :6], steps[..., 6]


def _signs(torque: Array) -> Array:
    """Of the limits that torques are at all over an interval, (K, 3)."""
    upper, lower = (torque > _AT_LIMIT).all(axis=1), (torque < -_AT_LIMIT).all(axis=1)
    return np.asarray(upper.astype(float) - lower)


def _states(scene: Scene, sign: Array, at_entry: Array, h: Array) -> Truths:
    """Speeds and folds that are at a limit all over an interval, (K, 6)."""
    fold = np.ptp(at_entry[..., 3:6], axis=1) < _AT_MARGIN
    fold &= (sign == 0) | (h > _LONG)[:, None]
    fast = np.zeros_like(fold)
    if scene.speed_limits is not None:
        fast = (np.abs(at_entry[..., :3]) / scene.speed_limits > 1 - _AT_SPEED).all(axis=1)
    return np.hstack([fast, fold])


def _rows_held(sign: Array, states: Truths) -> Integers:
    """Rows, (K, 3): a speed or a fold is held by its own motor or, if that is at its limit of
    torque, by another that is at none."""
    held = np.tile(np.arange(3), (len(sign), 1))
    for i in np.flatnonzero(states.any(axis=1)).tolist():
        without = np.flatnonzero(sign[i] == 0).tolist()
        for state in sorted(np.flatnonzero(states[i]).tolist(), key=lambda s: s % 3 not in without):
            if without:
                by = without.pop(without.index(state % 3) if state % 3 in without else 0)
                held[i, by] = _SPEED + state
    return held


def _touched(scene: Scene, states: Truths, at_entry: Array) -> Truths:
    """Speeds that are at a limit where an interval begins, and not held before or after, (K, 6)."""
    touched = np.zeros_like(states)
    if scene.speed_limits is not None:
        there = np.abs(at_entry[:, 0, :3]) / scene.speed_limits > 1 - _TOUCHES
        touched[1:, :3] = there[1:] & ~states[1:, :3] & ~states[:-1, :3]
    return touched


def _jumps(begins: Truths, states: Truths, by_state: Array) -> dict[int, Array]:
    """Gradients of what comes to a limit where an interval begins, (jumps, 6) each.

    ``begins``: what is at a limit from there on or at that instant, ``states``: all along, (K, 6);
    ``by_state``: of speeds, folds and their rates, (K, 9, 6).
    """
    new = begins.copy()
    new[1:] &= ~states[:-1]
    jumps: dict[int, list[Array]] = {}
    for i, state in np.argwhere(new).tolist():
        rows = (state,) if state < 3 else (state, state + 3)
        jumps.setdefault(i, []).extend(by_state[i, row] for row in rows)
    return {i: np.array(each) for i, each in jumps.items()}


@dataclass(frozen=True)
class Gauss:
    """Butcher's ``a`` and ``weights``; ``fractions``: the beginning, the nodes, the end."""

    a: Array
    weights: Array
    fractions: Array


@lru_cache(maxsize=1)
def gauss() -> Gauss:
    """Of eight stages, order 16."""
    nodes = (np.polynomial.legendre.leggauss(_STAGES)[0] + 1) / 2
    a, weights = np.empty((_STAGES, _STAGES)), np.empty(_STAGES)
    for j, node in enumerate(nodes):
        others = Polynomial.fromroots(np.delete(nodes, j))
        integral = (others / others(node)).integ()
        a[:, j], weights[j] = integral(nodes), integral(1.0)
    return Gauss(a, weights, np.concatenate([[0.0], nodes, [1.0]]))
