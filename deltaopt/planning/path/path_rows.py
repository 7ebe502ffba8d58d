"""The limits of a scene on a given path, as rows that are affine in b and u.

On a path x = p(s) the motion has one coordinate. With b = ṡ² and u = s̈ = b′/2

    ẋ = p′ √b        ẍ = p″ b + p′ u,

so that torques are affine in b and u, and so are the squares of speeds, which are signed here to
keep both of their bounds. Other rows are replaced by tangents at a motion that is known already,
and again at the next one, until they no longer change. Rows that are curved in u, the square of a
norm of acceleration, get a fan of tangents all around as well, without which the first motions
would be far off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import pi

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index
from deltaopt.errors import SceneError
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import PlatformInstant
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

_STRAIGHT = 1e-12
"""Share of the square of p″ that is across p′, below which a path counts as straight."""

Places = tuple[Array, Array, Array]
"""p and its first two derivatives by s at N places of a path, (N, 3) each."""
State = tuple[Array, Array]
"""b and u of a motion at N places, (N,) each."""

_USUAL = 0.3
"""Seconds in which a path is driven at the usual ṡ."""
_SLOWEST, _RESTING = 0.2, 1e-6
"""Shares of the usual ṡ below which slopes by b are taken at it: of rows that depend on ṡ = √b, as
by friction, and of others. The slope of the former has no limit at rest; where a motion is slow it
would tell the next one that friction takes all torque at higher speeds, and that one would creep.
"""
_SPEEDS = np.geomspace(1e-4, 1.0, 9)
"""Shares of the usual ṡ at which it is seen whether tangents are the same: slow ones as well, for
Coulomb friction depends on the speed beside rest alone."""
_FAN = 12
"""Tangents around a row that is curved in u. Each costs as much as a row; with fewer the first
motions exceed the limit by more (by 2 % with 8), and another motion is needed."""


@dataclass(frozen=True)
class AffineRows:
    """Rows low <= alpha u + beta b <= high at N places, (N, rows) each."""

    alpha: Array
    beta: Array
    low: Array
    high: Array

    def only(self, rows: Index) -> AffineRows:
        """Some of the rows."""
        return AffineRows(*(each[:, rows] for each in vars(self).values()))

    def tightened(self, by: Array) -> AffineRows:
        """With both bounds moved inwards, (N, rows)."""
        return AffineRows(self.alpha, self.beta, self.low + by, self.high - by)


class PathRows:
    """The limits that a motion must keep, on a path.

    ``sides``: whether each row has a lower and an upper bound, (rows, 2). ``curved``: indices of
    those that are not affine in u. ``ends``: ṡ² at start and goal.
    """

    def __init__(self, scene: Scene) -> None:
        """Those of a scene, without margins that only a planner of free paths keeps.

        Raises SceneError for a limit that tangents do not bound: one curved in u from below.
        """
        self.limits, self.model = limits_of(scene).up_to(2), model_of(scene.robot, scene.payload)
        functions, constraints = self.model.functions, self.limits.constraints
        assert isinstance(scene.task, OnPath)
        self.path, self.curved = scene.task.path, _curved(functions, constraints)
        self.ends = tuple(rate**2 for rate in scene.task.rates)
        for row in kept_rows(constraints)[self.curved].tolist():
            if constraints.sides[row, 0]:
                name = constraints.label(row)
                expected = f"no limit beside it that bounds {name} from below by a curved row"
                raise SceneError(None, "path", scene.task.description, expected)
        self.function = _function(functions, constraints)
        self.expansion = _expansion(functions, constraints) if len(self.curved) else None
        self.parameters = np.concatenate([self.limits.numbers, self.model.parameters])
        self.sides = constraints.sides[kept_rows(constraints)]

    @cached_property
    def owners(self) -> Index:
        """The row that each affine row stands for: itself, or one that is curved."""
        fans = np.repeat(self.curved, _FAN + 1)
        return np.concatenate([np.arange(len(self.sides)), self.curved, fans])

    def tangents(self, places: Places, motion: State, other: State) -> AffineRows:
        """At the states of two known motions, in the order of ``owners``: all rows at the first,
        curved ones at the other too.

        Raises Unreachable or Singular where the platform cannot be.
        """
        own, others = self._tangents(places, *motion, self.slowest), self.others(places, other)
        return own if others is None else _joined(own, others)

    def others(self, places: Places, motion: State) -> AffineRows | None:
        """The tangents of curved rows beside their own: at a second motion, and all around; None
        where no row is curved."""
        if self.expansion is None:
            return None
        curved = self._tangents(places, *motion, self.slowest).only(self.curved)
        return _joined(curved, self._fans(places))

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper bounds of all rows, ±1 or infinite, (2, rows)."""
        return np.where(self.sides.T, 1.0, np.inf) * [[-1.0], [1.0]]

    @cached_property
    def usual_speed(self) -> float:
        """ṡ that drives the path in some tenths of a second."""
        return float(self.path.knots[-1] - self.path.knots[0]) / _USUAL

    @cached_property
    def slowest(self) -> float:
        """ṡ below which slopes by b are taken at it. Values are those of the motion itself, so that
        rows and what stands for them agree once motions no longer change. Beside rows that are
        curved in u, of which other slopes are no tangents, it is hardly any."""
        has_steep_slopes = not (self.are_convex or len(self.curved))
        return (_SLOWEST if has_steep_slopes else _RESTING) * self.usual_speed

    def _tangents(self, places: Places, b: Array, u: Array, slowest: float) -> AffineRows:
        speed = np.sqrt(np.maximum(b, 0.0))
        values, _, alpha = self._evaluated(places, speed, u)
        faster = np.maximum(speed, slowest)
        _, by_speed, _ = self._evaluated(places, faster, u)
        beta = by_speed / (2 * faster[:, None])
        rest = values - alpha * u[:, None] - beta * (speed**2)[:, None]
        low = np.where(self.sides[:, 0], -1.0 - rest, -np.inf)
        high = np.where(self.sides[:, 1], 1.0 - rest, np.inf)
        return AffineRows(alpha, beta, low, high)

    def beyond(self, places: Places, b: Array, u: Array) -> Array:
        """By how much each row exceeds its bounds, negative within them, (N, rows)."""
        values, _, _ = self._evaluated(places, np.sqrt(b), u)
        constraints = self.limits.constraints
        return constraints.size(values, kept_rows(constraints).tolist()) - 1

    @property
    def are_affine(self) -> bool:
        """Whether tangents are the rows themselves, at any state."""
        return not len(self.curved) and self.are_convex

    @cached_property
    def are_convex(self) -> bool:
        """Whether tangents of rows are the rows themselves, at any state, but for rows that are
        curved in u."""
        pieces, n = len(self.path.knots) - 1, len(_SPEEDS)
        middles = np.diff(self.path.knots) / 2
        places = self.path.with_derivatives(np.repeat(np.arange(pieces), n), np.repeat(middles, n))
        b, u = (_SPEEDS * self.usual_speed) ** 2, np.resize([0.5, -0.7], n)
        others = np.setdiff1d(np.arange(len(self.sides)), self.curved)
        found = self._tangents(places, np.tile(b, pieces), np.tile(u, pieces), 0.0).only(others)
        at_speeds = (each.reshape(pieces, n, -1) for each in vars(found).values())
        return all(np.allclose(each, each[:, -1:], rtol=1e-9, atol=1e-9) for each in at_speeds)

    def _evaluated(self, places: Places, speed: Array, u: Array) -> tuple[Array, ...]:
        states = np.column_stack([speed, u])
        results = self.function(*places, states, parameters=self.parameters)
        if not np.isfinite(results[0]).all():
            bad = np.logical_not(np.isfinite(results[0]).all(axis=1))
            (x, dx, ddx), rate = (each[bad] for each in places), speed[bad][:, None]
            # It raises what is the matter with places where there are no torques.
            self.model.inverse_dynamics(x, dx * rate, ddx * rate**2 + dx * u[bad][:, None])
        return results

    def _fans(self, places: Places) -> AffineRows:
        """Tangents of rows that are curved in u, where rays from rest meet their bounds and where b
        is largest: there a motion stays that follows a bend as fast as the bend allows."""
        assert self.expansion is not None
        n = len(places[0])
        parts = self.expansion(*places, parameters=self.parameters)
        shapes = ((n, len(self.curved), *rest) for rest in ((1,), (2,), (2, 2)))
        constant, slope, bend = (
            part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)
        )
        angles = (np.arange(_FAN) + 0.5) / _FAN * pi - pi / 2  # b is not negative
        scales = np.sqrt(np.maximum(np.diagonal(bend, axis1=2, axis2=3), np.finfo(float).tiny) / 2)
        scales = np.maximum(scales, 1e-6 * scales.max(axis=2, keepdims=True))
        ways = np.stack([np.cos(angles), np.sin(angles)], axis=1) / scales[:, :, None]
        ahead = np.einsum("ncfi,nci->ncf", ways, slope)
        square = np.einsum("ncfi,ncij,ncfj->ncf", ways, bend, ways) / 2
        room = 1 - constant
        far = 2 * room / (ahead + np.sqrt(np.maximum(ahead**2 + 4 * square * room, 0.0)))
        there = np.concatenate([ways * far[..., None], _largest(constant, slope, bend)], axis=2)
        slopes = slope[:, :, None] + np.einsum("ncij,ncfj->ncfi", bend, there)
        value = constant + ((slope[:, :, None] + slopes) * there).sum(axis=3) / 2
        high = 1 - value + (slopes * there).sum(axis=3)
        none = np.logical_not(np.isfinite(high))
        slopes[none], high[none] = 0.0, np.inf
        size = (n, len(self.curved) * (_FAN + 1))
        beta, alpha = slopes[..., 0].reshape(size), slopes[..., 1].reshape(size)
        return AffineRows(alpha, beta, np.full(size, -np.inf), high.reshape(size))


def _largest(constant: Array, slope: Array, bend: Array) -> Array:
    """The state (b, u) of largest b at which quadratic rows are at 1, (N, curved, 1, 2), from their
    values, slopes and second derivatives at rest; not finite where b has no bound."""
    by_b, by_u = slope[..., 0], slope[..., 1]
    bb, bu, uu = bend[..., 0, 0], bend[..., 0, 1], bend[..., 1, 1]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        square = bb - bu**2 / uu
        ahead = by_b - bu * by_u / uu
        room = 1 - constant[..., 0] + by_u**2 / (2 * uu)
        square = np.where(square > _STRAIGHT * bb, square, np.nan)
        b = (-ahead + np.sqrt(ahead**2 + 2 * square * room)) / square
        u = -(by_u + bu * b) / uu
    return np.stack([b, u], axis=-1)[:, :, None]


def _joined(*parts: AffineRows) -> AffineRows:
    """All rows of all parts."""
    arrays = zip(*(vars(part).values() for part in parts), strict=True)
    return AffineRows(*(np.hstack(each) for each in arrays))


def kept_rows(constraints: Constraints) -> Index:
    """Indices of the rows of limits that a verified motion keeps, but for limits of position: on a
    given path these are kept or not at any speed."""
    return np.flatnonzero(constraints.promised & (constraints.orders > 0))


@lru_cache(maxsize=32)
def _curved(functions: Functions, constraints: Constraints) -> Index:
    """Which of the kept rows are not affine in u."""
    inputs, rows = _rows_on_path(functions, constraints)
    return np.flatnonzero(ca.which_depends(rows, inputs[3][1], 2, True))


@lru_cache(maxsize=32)
def _function(functions: Functions, constraints: Constraints) -> RowFunction:
    """(p, p′, p″, (ṡ, u), numbers of the limits and p) -> rows, ∂rows/∂ṡ, ∂rows/∂u."""
    inputs, rows = _rows_on_path(functions, constraints)
    slopes = ca.jacobian(rows, inputs[3])
    return RowFunction.of("tangents_on_path", inputs, [rows, slopes[:, 0], slopes[:, 1]])


@lru_cache(maxsize=32)
def _expansion(functions: Functions, constraints: Constraints) -> RowFunction:
    """(p, p′, p″, numbers of the limits and p) -> of the curved rows, at rest: their values, slopes
    by (b, u) and second derivatives, 1, 2 and 4 numbers each."""
    (x, dx, ddx, _, parameters), _ = _rows_on_path(functions, constraints)
    b, u = ca.SX.sym("b"), ca.SX.sym("u")
    z = ca.vertcat(b, u)
    all_rows = _rows(functions, constraints, (x, dx, ddx), (ca.sqrt(b), b, u), parameters)
    rows = [all_rows[i] for i in _curved(functions, constraints).tolist()]
    parts = [
        ca.vertcat(*rows),
        ca.vertcat(*(ca.jacobian(row, z).T for row in rows)),
        ca.vertcat(*(ca.vec(ca.hessian(row, z)[0]) for row in rows)),
    ]
    at_rest = [ca.substitute(part, z, ca.SX.zeros(2)) for part in parts]
    return RowFunction.of("expansion", [x, dx, ddx, parameters], at_rest)


@lru_cache(maxsize=32)
def _rows_on_path(functions: Functions, constraints: Constraints) -> tuple[list[ca.SX], ca.SX]:
    """p, p′, p″, (ṡ, u), numbers of the limits and p; and the rows that a motion must keep."""
    x, dx, ddx = (ca.SX.sym(name, 3) for name in ("x", "dx", "ddx"))
    state = ca.SX.sym("state", 2)
    parameters = ca.SX.sym("parameters", constraints.parameters + functions.symbols().numel())
    motion = state[0], state[0] ** 2, state[1]
    rows = _rows(functions, constraints, (x, dx, ddx), motion, parameters)
    return [x, dx, ddx, state, parameters], rows


def _rows(
    functions: Functions,
    constraints: Constraints,
    place: tuple[ca.SX, ca.SX, ca.SX],
    motion: tuple[ca.SX, ca.SX, ca.SX],
    parameters: ca.SX,
) -> ca.SX:
    """The rows at a place p, p′, p″ for a motion ṡ, ṡ², s̈; of order 1 their signed squares."""
    (x, dx, ddx), (speed, b, u) = place, motion
    numbers, p = parameters[: constraints.parameters], parameters[constraints.parameters :]
    instant = PlatformInstant(functions, x, dx * speed, ddx * b + dx * u, p)
    rows, orders = constraints.rows(instant, numbers), constraints.orders
    kept = (
        rows[i] * ca.fabs(rows[i]) if orders[i] == 1 else rows[i]
        for i in kept_rows(constraints).tolist()
    )
    return ca.vertcat(*kept)
