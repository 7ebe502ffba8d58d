"""Motions of least time or least cost by Ipopt from a direct transcription in physical units.

It knows nothing of the interior-point method: the unknowns are the coefficients of every
polynomial piece, in physical units, the torques at every point, and the durations; continuity,
boundary conditions and equations of motion are constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.flat.interior_point import IntervalPoints
from tests.oracles.sparse_program import QUIET

Array = NDArray[np.float64]
OPTIONS = QUIET | {
    "ipopt.tol": 1e-11,
    "ipopt.constr_viol_tol": 1e-11,
    "ipopt.compl_inf_tol": 1e-11,
    "ipopt.acceptable_iter": 0,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.honor_original_bounds": "yes",
    "ipopt.mu_target": 0.0,
}


@dataclass(frozen=True)
class Instant:
    """Symbols at an instant in physical units; ``p``: parameters of the phase."""

    x: ca.SX
    v: ca.SX
    a: ca.SX
    j: ca.SX
    tau: ca.SX
    p: ca.SX


@dataclass(frozen=True)
class Row:
    """A quantity, at most 1 if ``upper`` and at least -1 if ``lower``."""

    quantity: ca.SX
    upper: bool = True
    lower: bool = True


@dataclass(frozen=True)
class System:
    """Equations of motion (as many as torques) and rows of an instant.

    ``pieces``: 2 for a cubic in each interval with continuous velocity, 3 for three cubics in each
    with continuous acceleration.
    ``running``: the rate of a running cost, if there is one.
    """

    coordinates: int
    pieces: int
    force: Callable[[Instant], ca.SX]
    rows: Callable[[Instant], list[Row]]
    running: Callable[[Instant], ca.SX] | None = None


@dataclass(frozen=True)
class End:
    """A state to guess from, (3, coordinates): position, velocity, acceleration.

    ``fixed``: which of its components are boundary conditions, by derivative and coordinate.
    ``drift``: velocity of a position that moves; ``state`` then holds at the time zero.
    ``radius``: of a sphere about the position that a free position must be in; 0 without one.
    """

    state: Array
    fixed: NDArray[np.bool_]
    drift: Array
    radius: float = 0.0

    def at(self, time: float) -> Array:
        """The state at a time."""
        state = self.state.copy()
        state[0] += time * self.drift
        return state


@dataclass(frozen=True)
class Leg:
    """A phase: ``mesh`` in fractions of its duration, a guess of that, and parameters."""

    mesh: Array
    duration: float
    p: Array
    given: bool = False


def quintic(begin: Array, end: Array, duration: float, fractions: Array) -> Array:
    """A guess between two states: position and two derivatives by time, (n, 3, coordinates)."""
    s = np.arange(6)
    falling = [np.ones(6), s, s * (s - 1)]

    def at(time: float) -> Array:
        powers = [np.where(s >= d, time ** np.maximum(s - d, 0), 0.0) for d in range(3)]
        return np.stack([falling[d] * powers[d] for d in range(3)])

    conditions = np.vstack([at(0.0), at(duration)])
    coefficients = np.linalg.solve(conditions, np.vstack([begin, end]))
    return np.stack([at(duration * f) @ coefficients for f in fractions])


def fastest(
    system: System, legs: Sequence[Leg], ends: Sequence[End], points: IntervalPoints
) -> Array:
    """The durations of the legs of the fastest motion through the ends."""
    return best(system, legs, ends, points)[0]


def best(
    system: System,
    legs: Sequence[Leg],
    ends: Sequence[End],
    points: IntervalPoints,
    weights: tuple[float, float] = (1.0, 0.0),
    *,
    sum_is_given: bool = False,
) -> tuple[Array, float]:
    """The durations of the legs of the best motion through the ends, and its cost: the duration
    times the first weight, and the integral of the running cost times the second.
    ``sum_is_given``: whether the legs together take as long as guessed."""
    m, degree = system.coordinates, 3
    cubics = 1 if system.pieces == 2 else 3  # in an interval
    durations = [ca.SX.sym(f"T{q}") for q in range(len(legs))]
    w, guess, g, low, high = [*durations], [leg.duration for leg in legs], [], [], []

    def limit(expression: ca.SX, lower: float, upper: float) -> None:
        g.append(expression)
        low.extend([lower] * expression.numel())
        high.extend([upper] * expression.numel())

    def state(c: ca.SX, s: float, h: ca.SX, order: int) -> ca.SX:
        """Derivative of a piece at a fraction s of its length h."""
        total = ca.SX.zeros(m)
        for k in range(order, degree + 1):
            factor = float(np.prod(np.arange(k - order + 1, k + 1)))
            total += factor * s ** (k - order) * c[m * k : m * (k + 1)]
        return total / h**order

    def keep(end: End, c: ca.SX, s: float, h: ca.SX, time: ca.SX) -> None:
        for d in range(system.pieces):
            wanted = ca.DM(end.state[d]) + (time * ca.DM(end.drift) if d == 0 else 0)
            here = state(c, s, h, d) - wanted
            for k in np.flatnonzero(end.fixed[d]).tolist():
                limit(here[k], 0.0, 0.0)
        if end.radius:
            away = state(c, s, h, 0) - ca.DM(end.state[0])
            limit(ca.sumsqr(away), 0.0, end.radius**2)

    running = ca.SX(0)
    before: tuple[ca.SX, ca.SX] | None = None
    time, guessed = ca.SX(0), 0.0
    for q, (leg, T) in enumerate(zip(legs, durations, strict=True)):
        if leg.given:
            limit(T - leg.duration, 0.0, 0.0)
        mesh = np.repeat(leg.mesh / cubics, cubics)
        borders = np.append(0.0, np.cumsum(mesh))
        for i, e in enumerate(mesh.tolist()):
            c, h = ca.SX.sym(f"c{q}_{i}", m * (degree + 1)), e * T
            w.append(c)
            s = np.linspace(0, 1, degree + 1)
            begin, end = ends[q].at(guessed), ends[q + 1].at(guessed + leg.duration)
            shape = quintic(begin, end, leg.duration, borders[i] + e * s)[:, 0]
            guess.extend(np.linalg.solve(np.vander(s, increasing=True), shape).ravel())
            if before is None:
                keep(ends[0], c, 0.0, h, time)
            else:
                for d in range(system.pieces):
                    limit(state(before[0], 1.0, before[1], d) - state(c, 0.0, h, d), 0.0, 0.0)
            for fraction, third, part in zip(
                points.fractions, points.thirds, points.weights, strict=True
            ):
                if third != i % cubics:
                    continue
                s_j, weight = cubics * fraction - third, cubics * part
                tau = ca.SX.sym(f"tau{q}_{i}_{third}", m)
                w.append(tau)
                guess.extend([0.0] * m)
                motion = [state(c, s_j, h, d) for d in range(4)]
                now = Instant(*motion, tau, ca.SX(ca.DM(leg.p)))
                limit(system.force(now), 0.0, 0.0)
                for row in system.rows(now):
                    lower, upper = -1.0 if row.lower else -np.inf, 1.0 if row.upper else np.inf
                    limit(row.quantity, lower, upper)
                if system.running is not None:
                    running += weight * h * system.running(now)
            before = c, h
        assert before is not None
        time, guessed = time + T, guessed + leg.duration
        keep(ends[q + 1], *(before[0], 1.0, before[1]), time)
    if sum_is_given:
        limit(time - sum(leg.duration for leg in legs), 0.0, 0.0)
    cost = weights[0] * time + weights[1] * running
    cost, rows = ca.cse([cost, ca.vertcat(*g)])  # what is shared is differentiated once
    problem = {"x": ca.vertcat(*w), "f": cost, "g": rows}
    solver = ca.nlpsol("oracle", "ipopt", problem, OPTIONS)
    lower = np.full(problem["x"].numel(), -np.inf)
    lower[: len(legs)] = 1e-3
    found = solver(x0=guess, lbx=lower, ubx=np.inf, lbg=low, ubg=high)
    assert solver.stats()["return_status"] == "Solve_Succeeded", solver.stats()["return_status"]
    return np.asarray(found["x"].full().ravel()[: len(legs)]), float(found["f"])
