"""A motion of the platform as a callable of time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.robot.model import DeltaModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PiecewisePolynomial:
    """K polynomials of degree d in m components between K + 1 knots.

    ``knots``: (K + 1,), increasing, s. ``coefficients``: (K, d + 1, m), of the ascending
    powers of the time since the interval began.
    """

    knots: Array
    coefficients: Array

    @classmethod
    def hermite(cls, knots: Array, x: Array, v: Array) -> PiecewisePolynomial:
        """The cubics with values x and derivatives v, (K + 1, m), at the knots."""
        h = np.diff(knots)[:, None]
        secant = np.diff(x, axis=0) / h
        square = (3 * secant - 2 * v[:-1] - v[1:]) / h
        cube = (v[:-1] + v[1:] - 2 * secant) / h**2
        return cls(knots, np.stack([x[:-1], v[:-1], square, cube], axis=1))

    def derivative(self) -> PiecewisePolynomial:
        """Its derivative with respect to time."""
        powers = np.arange(1, self.coefficients.shape[1])
        return replace(self, coefficients=self.coefficients[:, 1:] * powers[:, None])

    def slowed(self, factor: float) -> PiecewisePolynomial:
        """The same path, ``factor`` times as slow."""
        powers = np.arange(self.coefficients.shape[1])
        return PiecewisePolynomial(
            self.knots * factor, self.coefficients / factor ** powers[:, None]
        )

    def at(self, t: Array) -> Array:
        """Values, (N, m), at times (N,) between the first knot and the last."""
        intervals = self.interval(t)
        return self.inside(intervals, t - self.knots[intervals])

    def with_rate_at(self, t: Array) -> tuple[Array, Array]:
        """Values and their derivatives with respect to time, (N, m) each, at times (N,)."""
        intervals = self.interval(t)
        since = (t - self.knots[intervals])[:, None]
        values = rates = np.zeros((len(t), self.coefficients.shape[2]))
        for power in reversed(range(self.coefficients.shape[1])):  # Horner, differentiated
            rates = rates * since + values
            values = values * since + self.coefficients[intervals, power]
        return values, rates

    def interval(self, t: Array) -> NDArray[np.intp]:
        """The interval of each time (N,); of a knot the one it begins, if there is one."""
        last = len(self.knots) - 2
        return np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, last)

    def inside(self, intervals: NDArray[np.intp], since: Array) -> Array:
        """Values, (N, m), a time after the beginning of an interval, (N,) each."""
        values = np.zeros((len(since), self.coefficients.shape[2]))
        for power in reversed(range(self.coefficients.shape[1])):  # Horner
            values = values * since[:, None] + self.coefficients[intervals, power]
        return values


@dataclass(frozen=True)
class Motion:
    """Platform and motors at N instants: t (N,), the others (N, 3).

    x, v, a: m, m/s, m/s². theta, dtheta, ddtheta: rad, rad/s, rad/s². tau: N·m.
    """

    t: Array
    x: Array
    v: Array
    a: Array
    theta: Array
    dtheta: Array
    ddtheta: Array
    tau: Array


@dataclass(frozen=True)
class Trajectory:
    """The path of the platform's centre over time, and the model that gives its torques.

    ``coordinates``: all twelve as polynomials, where they were planned as such and need not
    close the loops; without them they follow from the path.
    """

    position: PiecewisePolynomial
    model: DeltaModel
    coordinates: PiecewisePolynomial | None = None

    @property
    def knots(self) -> Array:
        """Where one polynomial ends and the next begins, s; torques may jump there."""
        return self.position.knots

    @property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return float(self.knots[-1] - self.knots[0])

    def __call__(self, t: ArrayLike) -> Motion:
        """The motion at times t, (N,) or a number, s; just after a knot where it jumps.

        Before the start and after the goal the first and last instant hold.
        """
        begin, end = self.knots[0], self.knots[-1]
        instants: Array = np.clip(np.atleast_1d(np.asarray(t, dtype=float)), begin, end)
        intervals = self.position.interval(instants)
        return self._motion(instants, intervals, instants - self.knots[intervals])

    def inside_intervals(self, fractions: ArrayLike) -> Motion:
        """The motion at these fractions of every interval, 0 and 1 from inside of it."""
        intervals, since = _inside(self.position, fractions)
        return self._motion(self.knots[intervals] + since, intervals, since)

    def path_inside(self, fractions: ArrayLike) -> tuple[Array, Array, Array]:
        """x, v, a, (K · len(fractions), 3) each, there: no motor is asked."""
        return _with_derivatives(self.position, *_inside(self.position, fractions))

    def coordinates_inside(self, fractions: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈, (K · len(fractions), 12) each, at these fractions of every interval: as
        planned where they were planned, else from the path."""
        if self.coordinates is None:
            return self.model.motion(*self.path_inside(fractions))
        return _with_derivatives(self.coordinates, *_inside(self.position, fractions))

    def slowed(self, factor: float) -> Trajectory:
        """The same path, uniformly ``factor`` times as slow."""
        coordinates = self.coordinates and self.coordinates.slowed(factor)
        return replace(self, position=self.position.slowed(factor), coordinates=coordinates)

    def _motion(self, t: Array, intervals: NDArray[np.intp], since: Array) -> Motion:
        x, v, a = _with_derivatives(self.position, intervals, since)
        q, dq, ddq = self.model.motion(x, v, a)
        tau = self.model.inverse_dynamics(x, v, a)
        motors = slice(3, None, 3)  # q_{1,1}, q_{2,1}, q_{3,1}
        return Motion(t, x, v, a, q[:, motors], dq[:, motors], ddq[:, motors], tau)


def _inside(position: PiecewisePolynomial, fractions: ArrayLike) -> tuple[NDArray[np.intp], Array]:
    """Intervals, and times since they began, of these fractions of every interval."""
    fractions, lengths = np.asarray(fractions, dtype=float), np.diff(position.knots)
    intervals = np.repeat(np.arange(len(lengths)), len(fractions))
    return intervals, (lengths[:, None] * fractions).ravel()


def _with_derivatives(
    of: PiecewisePolynomial, intervals: NDArray[np.intp], since: Array
) -> tuple[Array, Array, Array]:
    """Values and their first two derivatives with respect to time, (N, m) each."""
    rate = of.derivative()
    values, rates, second = (q.inside(intervals, since) for q in (of, rate, rate.derivative()))
    return values, rates, second
