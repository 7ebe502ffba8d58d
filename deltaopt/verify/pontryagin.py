"""Pontryagin's condition, looked for in a motion alone: nothing of how it was found is used.

Where the motors are at their limits the torques are known, and the costates p = (p_x, p_v)
follow a linear differential equation along the motion,

    ṗ_x = -(∂a/∂x)ᵀ p_v - ∂r/∂x        ṗ_v = -p_x - (∂a/∂v)ᵀ p_v - ∂r/∂v

a being the acceleration and r the rate of what is minimised (1 for time, τᵀτ for effort). So all
of p is p(0) and, where a limit of order 0 or 1, of a position or a speed, is reached, the size of a
jump: a handful of numbers. They are those of least squares of

    H = p_x · ẋ + p_v · ẍ + r = 0, or constant where the duration is given
    S_k = ∂H/∂τ_k = 0                    of a motor that is at no limit

(S: the switching functions). A row of order 1 that stays at its limit is held by its derivative,
one of order 0 by its second derivative, each in the place of a motor's torque. What is left is how
far the motion is from Pontryagin's condition. That is necessary and local: where it holds no motion
nearby is better to first order; one far away may be.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.nodes import collocation
from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.errors import DeltaOptError
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import PlatformInstant
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.verify.units import way_of

_STAGES = 8
"""Of Gauss's collocation in every interval."""
_AT_LIMIT = 0.99
"""Of its limit: what a torque at its limit has all over an interval. Less takes a torque that only
comes near its limit for one that is held there."""
_CONSTANT, _LONG = 1e-7, 1e-3
"""By how much a held row of order 0 may vary over an interval, in an interval of so long a part of
the duration if its motor's torque is at its limit: in shorter ones everything is constant."""
_HELD, _TOUCHES = 1e-5, 1e-7
"""By how much a row of order 1 may be short of its limit along an interval and at an instant."""


class NoCostates(DeltaOptError):
    """A motion or a scene to which no costates can be fitted."""


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
    """The costates that fit a motion best, and how well they fit.

    Raises NoCostates where the scene has limits that cannot be treated (see ``_Rows``) or the
    equations are singular.
    """
    try:
        return _fitted(scene, trajectory)
    except np.linalg.LinAlgError:
        raise NoCostates("the equations for the costates are singular") from None


class _Rows:
    """Which constraint rows are treated how: indices, (rows,) each, into the rows of a scene.

    ``controls``: the limit of each motor's torque, in the motors' order. ``first``: of order 1,
    ``second``: of order 0, held by their first and second derivative; together, in this order, they
    are called states. ``motors``: of each state the motor that holds it if it can.
    """

    def __init__(self, constraints: Constraints) -> None:
        """By the order of each row.

        Raises NoCostates unless every motor has one limit of its torque, on both sides, and all
        other limits are of order 0 or 1 and have one row for each motor or chain.
        """
        control = np.flatnonzero(constraints.is_control)
        first, second = constraints.of_order(1), constraints.of_order(0)
        treated = len(control) + len(first) + len(second) == constraints.number
        both = constraints.sides[control].all()
        own = sorted(control.tolist(), key=lambda row: constraints.item_of(row)[1])
        one_each = [constraints.item_of(row)[1] for row in own] == list(range(constraints.motors))
        sizes = {rows.stop - rows.start for rows in constraints.slices}
        if not (treated and both and one_each and sizes == {constraints.motors}):
            raise NoCostates("the scene has limits that a fit of costates cannot treat")
        self.constraints, self.controls = constraints, own
        self.first, self.second = first.tolist(), second.tolist()
        states = (constraints.item_of(row)[1] for row in [*self.first, *self.second])
        self.motors = [number % constraints.motors for number in states]


@lru_cache(maxsize=8)
def _held_and_reached(functions: Functions, constraints: Constraints) -> RowFunction:
    """(x, v, a, numbers of the limits and p) -> what may be held along an interval: the controls'
    rows, the first derivatives of ``first``, the second ones of ``second``; its derivatives by x,
    v, a; what may be reached at an instant: ``first``, ``second`` and the first derivatives of
    ``second``; their derivatives by x, v; the torques and their limits (3 each, N·m)."""
    rows = _Rows(constraints)
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    numbers, p = constraints.numbers(), functions.symbols()
    motion = PlatformInstant(functions, x, v, a, p)
    all_rows = constraints.rows(motion, numbers)
    control, first, second = (
        ca.vertcat(*(all_rows[i] for i in which))
        for which in (rows.controls, rows.first, rows.second)
    )
    rate = _rate(second, x, v, a)
    held = ca.vertcat(control, _rate(first, x, v, a), _rate(rate, x, v, a))
    reached = ca.vertcat(first, second, rate)
    by_motion = ca.jacobian(held, ca.vertcat(x, v, a))
    by_state = ca.jacobian(reached, ca.vertcat(x, v))
    tau = ca.SX.sym("tau", 3)
    controlled = constraints.rows(PlatformInstant(functions, x, v, a, p, tau), numbers)
    slopes = ca.jacobian(controlled, tau)
    limits = ca.vertcat(*(1 / slopes[row, motor] for motor, row in enumerate(rows.controls)))
    results = [held, ca.vec(by_motion.T), reached, ca.vec(by_state.T), motion.tau, limits]
    return RowFunction.of("held_and_reached", [x, v, a, ca.vertcat(numbers, p)], results)


def _rate(quantities: ca.SX, x: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    """d/dt of quantities that depend on x and v."""
    if not quantities.numel():
        return quantities
    return ca.jtimes(quantities, x, v) + ca.jtimes(quantities, v, a)


def _fitted(scene: Scene, trajectory: Trajectory) -> Extremal:
    """The costates, in units of the way D, the duration T and the mean of r until the end.

    (K, c, …): at the beginning, at Gauss's nodes and at the end of each interval.
    """
    model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
    rows = _Rows(limits.constraints)
    states, fractions = len(rows.first) + len(rows.second), collocation(_STAGES).fractions
    x, v, a = trajectory.path_inside(fractions)
    T, D = trajectory.duration, way_of(scene, trajectory)
    K, c = len(trajectory.knots) - 1, len(fractions)
    results = _held_and_reached(model.functions, limits.constraints)(
        x, v, a, parameters=np.concatenate([limits.numbers, model.parameters])
    )
    reached_shape = states + len(rows.second)
    shapes = ((3 + states,), (3 + states, 9), (reached_shape,), (reached_shape, 6), (3,), (3,))
    along, by_motion, reached, by_state, torque, limits_there = (
        part.reshape(K, c, *shape) for part, shape in zip(results, shapes, strict=True)
    )
    units = np.repeat([D, D / T, D / T**2], 3)
    by_motion, by_state = by_motion * units, by_state * units[:6]
    share, limit, lengths = along[..., :3], limits_there[0, 0], np.diff(trajectory.knots)
    upper, lower = (share > _AT_LIMIT).all(axis=1), (share < -_AT_LIMIT).all(axis=1)
    sign, h = np.asarray(upper.astype(float) - lower), lengths / T  # (K, 3): 0 at no limit; (K,)
    at_limit = _at_limit(rows, sign, reached, h)
    held = _rows_held(rows, sign, at_limit)
    held_by_motion = np.take_along_axis(by_motion, held[:, None, :, None], axis=2)
    by_held = np.linalg.inv(held_by_motion[..., 6:])  # of the acceleration, (K, c, 3, 3)
    slopes = -by_held @ held_by_motion[..., :6]  # of it by (X, V), (K, c, 3, 6)
    share_slopes = by_motion[:, :, :3, :6] + by_motion[:, :, :3, 6:] @ slopes
    time, effort = scene.objective.functional.time, scene.objective.functional.running
    rate = time + effort * (torque**2).sum(axis=2)
    mean = float(lengths @ (rate[:, 1:-1] @ collocation(_STAGES).weights)) / T
    by_share = 2 * effort / mean * (limit * torque)[..., None, :]  # ∂r/∂u, a row
    squares = effort / mean * limit**2  # r grows with these times u², u being torques of the limit
    jumps = _jumps(rows, at_limit, reached, by_state[:, 0])
    p = _costates(h, slopes, (by_share @ share_slopes)[:, :, 0], jumps)
    motion = np.hstack([v * T / D, a * T**2 / D]).reshape(K, c, 6)
    H = (p * motion[..., None]).sum(axis=2)
    H[..., -1] += rate / mean
    of_torque = (held < 3)[:, None]
    S = np.einsum("kcaj,kcau->kcju", by_held, p[:, :, 3:]) * of_torque[..., None]
    S[..., -1] += 2 * squares * share * of_torque
    given = float(scene.objective.given_duration is not None)
    free = (held < 3) & (sign == 0)
    u = _unknowns(H, S.transpose(0, 2, 1, 3)[free], np.sqrt(h)[np.nonzero(free)[0]], given)
    p, S, H = p @ u, S @ u, H @ u
    return Extremal(
        t=(trajectory.knots[:-1, None] + lengths[:, None] * fractions).ravel(),
        costates=(p * mean * T / np.repeat([D, D / T], 3)).reshape(-1, 6),
        switching=S.reshape(-1, 3),
        hamiltonian=H.ravel(),
        hamiltonian_spread=float(np.abs(H - H.mean()).max()),
        sign_violation=_sign_violation(S, squares, share, of_torque),
    )


def _unknowns(H: Array, of_free: Array, weights: Array, given: float) -> Array:
    """p(0) and the jumps of least squares, and 1: of H, (K, c, unknowns + 1), and of the switching
    functions of torques at no limit, (N, c, unknowns + 1), each with its weight, (N,). ``given``: 1
    where T is, 0 elsewhere."""
    of_H = np.insert(H, 0, -given, axis=2)  # the first unknown, which H is where T is given
    of_free = np.insert(of_free * weights[:, None, None], 0, 0.0, axis=2)
    rows = np.concatenate([each.reshape(-1, of_H.shape[-1]) for each in (of_H, of_free)])
    u = np.linalg.lstsq(rows[:, :-1], -rows[:, -1], rcond=1e-11)[0]
    return np.append(u[1:], 1.0)


def _sign_violation(S: Array, squares: Array, torque: Array, of_torque: Truths) -> float:
    by_motion = S - 2 * squares * torque  # H is this times u, and squares u²
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.clip(-by_motion / (2 * squares), -1, 1)
    best = np.where(by_motion == 0, torque, best)
    lowered = by_motion * (torque - best) + squares * (torque**2 - best**2)
    lowered *= of_torque
    largest = np.abs(by_motion).max()
    return float(lowered.max() / largest) if largest else 0.0


def _costates(h: Array, slopes: Array, rate_slopes: Array, jumps: dict[int, Array]) -> Array:
    """p at the instants, (K, c, 6, unknowns + 1): linear in the unknowns, p(0) and the
    jumps; the last column is what does not depend on them."""
    inside, source = _responses(h, slopes, rate_slopes)
    number = 6 + sum(len(jump) for jump in jumps.values())
    now, place = np.zeros((6, number + 1)), 6
    now[:, :6] = np.eye(6)
    p = np.empty((len(h), len(collocation(_STAGES).fractions), 6, number + 1))
    for i in range(len(h)):
        for direction in jumps.get(i, ()):
            now = now.copy()
            now[:, place] += direction
            place += 1
        p[i, 0] = now
        p[i, 1:] = inside[i] @ now
        p[i, 1:, :, -1] += source[i]
        now = p[i, -1]
    return p


def _responses(h: Array, slopes: Array, rate_slopes: Array) -> tuple[Array, Array]:
    """p inside an interval and at its end by p at its beginning, (K, c - 1, 6, 6), and by the rate
    alone, (K, c - 1, 6): Gauss's collocation of the adjoint equation.

    ``h``: lengths of the intervals, (K,). ``slopes``: of the acceleration, (K, c, 3, 6), and
    ``rate_slopes``: of the rate, (K, c, 6), by position and velocity.
    """
    by_gauss, K = collocation(_STAGES), len(h)
    M = np.zeros((K, _STAGES, 6, 6))  # ṗ = M p + g
    M[..., :, 3:] = -slopes[:, 1:-1].transpose(0, 1, 3, 2)
    M[..., 3:, :3] -= np.eye(3)
    g = -rate_slopes[:, 1:-1]
    coupled = np.einsum("k,kiab,ij->kiajb", h, M, by_gauss.a)
    system = np.eye(6 * _STAGES) - coupled.reshape(K, 6 * _STAGES, -1)
    right = np.concatenate([M, g[..., None]], axis=3).reshape(K, 6 * _STAGES, 7)
    found = np.linalg.solve(system, right).reshape(K, _STAGES, 6, 7)
    weights = np.vstack([by_gauss.a, by_gauss.weights])
    steps = np.einsum("k,ij,kjab->kiab", h, weights, found)
    steps[..., :6] += np.eye(6)
    return steps[..., :6], steps[..., 6]


def _at_limit(rows: _Rows, sign: Array, reached: Array, h: Array) -> Truths:
    """States that are held all over an interval, (K, states)."""
    ones, states = len(rows.first), len(rows.first) + len(rows.second)
    sizes = rows.constraints.size(reached[..., :ones], rows.first)
    fast = (sizes > 1 - _HELD).all(axis=1)
    constant = np.ptp(reached[..., ones:states], axis=1) < _CONSTANT
    constant &= (sign[:, rows.motors[ones:]] == 0) | (h > _LONG)[:, None]
    return np.hstack([fast, constant])


def _rows_held(rows: _Rows, sign: Array, at_limit: Truths) -> Index:
    """What each motor holds, (K, 3): a state is held by its own motor or, if that is at its limit
    of torque, by another that is at none."""
    held, motors = np.tile(np.arange(3), (len(sign), 1)), rows.motors
    for i in np.flatnonzero(at_limit.any(axis=1)).tolist():
        without = np.flatnonzero(sign[i] == 0).tolist()
        states = np.flatnonzero(at_limit[i]).tolist()
        for state in sorted(states, key=lambda s: motors[s] not in without):
            if without:
                own = motors[state]
                by = without.pop(without.index(own) if own in without else 0)
                held[i, by] = 3 + state
    return held


def _jumps(rows: _Rows, at_limit: Truths, reached: Array, by_state: Array) -> dict[int, Array]:
    """Gradients of what comes to a limit where an interval begins, (jumps, 6) each: of a row of
    order 1 its own, of one of order 0 its own and its derivative's. A row of order 1 may be at a
    limit there without being held before or after.

    ``by_state``: of states and derivatives of those of order 0, (K, rows, 6).
    """
    new, ones = at_limit.copy(), len(rows.first)
    new[1:] &= ~at_limit[:-1]
    there = rows.constraints.size(reached[1:, 0, :ones], rows.first) > 1 - _TOUCHES
    new[1:, :ones] |= there & ~at_limit[1:, :ones] & ~at_limit[:-1, :ones]
    jumps: dict[int, list[Array]] = {}
    for i, state in np.argwhere(new).tolist():
        gradients = (state,) if state < ones else (state, state + len(rows.second))
        jumps.setdefault(i, []).extend(by_state[i, row] for row in gradients)
    return {i: np.array(each) for i, each in jumps.items()}
