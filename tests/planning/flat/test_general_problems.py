"""The interior-point method on small problems of every kind, against Ipopt.

Each problem is solved twice on the same polynomials and points: by the method, with torques
eliminated and knots as unknowns, and by a transcription of its own (``oracles.point_motion``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen.compile import compiler
from deltaopt.planning.flat import interior_point as module
from deltaopt.planning.flat.interior_point import (
    Boundary,
    InteriorPoint,
    InteriorPointSolution,
    Phase,
    PointProblem,
    Settings,
    Sides,
    interior_point,
)
from tests.oracles.point_motion import (
    Array,
    End,
    Instant,
    Leg,
    Row,
    System,
    fastest,
    quintic,
)

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

FOUR = np.array([0.0, 1 / 3, 2 / 3, 1.0])
EIGHT = np.array([0.0, 0.06, 0.2, 0.4, 0.6, 0.8, 0.94, 1.0])
EXACT = Settings(tolerance=1e-10, iterations=200)


# Systems


def particle(now: Instant) -> ca.SX:
    """A mass p_0 with drag, in a field, pushed by motors whose directions turn with x."""
    m = now.x.numel()
    B = ca.SX.eye(m)
    for i in range(m):
        for j in range(m):
            B[i, j] += 0.2 * ca.sin(now.x[i] + j)
    field_of_force = 0.3 * ca.sin(2 * now.x) + 0.2
    return now.p[0] * (now.a + field_of_force) + 0.3 * now.v * ca.sumsqr(now.v) - B @ now.tau


def elbow(x: ca.SX) -> ca.SX:
    """Of an arm of two links of length one whose tip is at x."""
    return x / 2 + ca.sqrt(1 / ca.sumsqr(x) - 0.25) * ca.vertcat(-x[1], x[0])


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    return a[0] * b[1] - a[1] * b[0]


def joint_rates(now: Instant) -> ca.SX:
    """Angular velocities of both links."""
    e = elbow(now.x)
    de = ca.jtimes(e, now.x, now.v) if now.x.is_valid_input() else _at(now, "rate")
    return ca.vertcat(cross(e, de), cross(now.x - e, now.v - de))


def arm(now: Instant) -> ca.SX:
    """A mass of 1 at the elbow and p_0 at the tip, gravity along -y: virtual work of a motion of
    the tip, torques acting on the absolute angles of both links."""
    return _at(now, "force")


@lru_cache
def _arm() -> dict[str, ca.Function]:
    x, v, a = (ca.SX.sym(name, 2) for name in "xva")
    tau, mass = ca.SX.sym("tau", 2), ca.SX.sym("mass")
    e = elbow(x)
    E = ca.jacobian(e, x)
    de = E @ v
    dde = E @ a + ca.jtimes(de, x, v)
    gravity = ca.DM([0.0, -2.0])
    turn = ca.DM([[0.0, -1.0], [1.0, 0.0]])
    work = E.T @ (turn @ e) * tau[0] + (ca.SX.eye(2) - E).T @ (turn @ (x - e)) * tau[1]
    force = E.T @ (dde - gravity) + mass * (a - gravity) - work
    return {
        "force": ca.Function("force", [x, v, a, tau, mass], [force]),
        "rate": ca.Function("rate", [x, v, a, tau, mass], [de]),
    }


def _at(now: Instant, what: str) -> ca.SX:
    return _arm()[what](now.x, now.v, now.a, now.tau, now.p[0])


def torques(limit: float) -> Callable[[Instant], list[Row]]:
    return lambda now: [Row(now.tau[k] / limit) for k in range(now.tau.numel())]


# Problems


@dataclass(frozen=True)
class Case:
    """A system and its phases; ``watched``: rows that a limit is expected to hold back."""

    system: System
    legs: Sequence[Leg]
    ends: Sequence[End]
    points: Array = field(default_factory=lambda: FOUR)
    watched: Sequence[int] = ()


def rest(*x: float) -> End:
    state = np.zeros((3, len(x)))
    state[0] = x
    return End(state, np.ones((3, len(x)), dtype=bool), np.zeros(len(x)))


def passed(x: Sequence[float], v: Sequence[float]) -> End:
    """A point passed with a velocity that is only guessed."""
    end = rest(*x)
    end.state[1], end.fixed[1:] = v, False
    return end


def met(x: Sequence[float], drift: Sequence[float]) -> End:
    """A point that moves, met at its velocity."""
    end = rest(*x)
    end.state[1] = drift
    return End(end.state, end.fixed, np.array(drift))


def started(x: Sequence[float], v: Sequence[float]) -> End:
    end = rest(*x)
    end.state[1] = v
    return end


def leg(n: int, duration: float, *p: float) -> Leg:
    """Intervals that are not all as long."""
    mesh = 1 + 0.3 * np.sin(np.arange(n))
    return Leg(mesh / mesh.sum(), duration, np.array(p))


def powers(now: Instant) -> list[Row]:
    rates = joint_rates(now)
    return torques(6.0)(now) + [Row(now.tau[k] * rates[k] / 2.5) for k in range(2)]


def floor(now: Instant) -> list[Row]:
    """Row 2: the height above y = 0.9 is nonnegative; row 3: a wall at x = 3, never reached."""
    above, wall = now.x[1] - 0.9, now.x[0] - 3
    return torques(6.0)(now) + [Row(above - 1, upper=False), Row(wall + 1, lower=False)]


def jerks(now: Instant) -> list[Row]:
    return torques(3.0)(now) + [Row(now.j[k] / 25) for k in range(now.j.numel())]


def mean_square(bound: float) -> Callable[[Instant], ca.SX]:
    return lambda now: ca.sumsqr(now.tau) / bound


LEFT, RIGHT = (-0.9, 1.0), (0.9, 1.1)
ARM = System(2, 2, arm, torques(6.0))
CASES = {
    "one coordinate": Case(
        System(1, 2, particle, torques(2.0)), [leg(12, 2.0, 1.0)], [rest(0.0), rest(1.0)]
    ),
    "two coordinates": Case(ARM, [leg(12, 1.5, 0.7)], [rest(*LEFT), rest(*RIGHT)]),
    "three coordinates": Case(
        System(3, 2, particle, torques(2.0)),
        [leg(12, 2.0, 1.0)],
        [rest(0.0, 0.0, 0.0), rest(1.0, -0.5, 0.3)],
    ),
    "power": Case(
        System(2, 2, arm, powers), [leg(12, 1.5, 0.7)], [rest(*LEFT), rest(*RIGHT)], watched=(2, 3)
    ),
    "floor": Case(
        System(2, 2, arm, floor), [leg(12, 1.5, 0.7)], [rest(*LEFT), rest(*RIGHT)], watched=(2,)
    ),
    "integral": Case(
        System(2, 2, arm, torques(6.0), mean_square(20.0)),
        [leg(12, 1.5, 0.7)],
        [rest(*LEFT), rest(*RIGHT)],
    ),
    "integral alone": Case(
        System(2, 2, arm, lambda _: [], mean_square(20.0)),
        [leg(8, 1.5, 0.7)],
        [rest(*LEFT), rest(*RIGHT)],
    ),
    "jerk": Case(
        System(3, 3, particle, jerks),
        [leg(8, 2.0, 1.0)],
        [rest(0.0, 0.0, 0.0), rest(1.0, -0.5, 0.3)],
        watched=(3, 4, 5),
    ),
    "jerk at eight points": Case(
        System(1, 3, particle, jerks),
        [leg(8, 2.0, 1.0)],
        [rest(0.0), rest(1.0)],
        EIGHT,
        watched=(1,),
    ),
    "two phases": Case(
        ARM,
        [leg(8, 1.0, 0.7), leg(7, 1.0, 0.3)],
        [rest(*LEFT), passed((0.1, 1.5), (1.0, 0.0)), rest(*RIGHT)],
    ),
    "two phases of quintics": Case(
        System(2, 3, arm, lambda now: torques(6.0)(now) + jerks(now)[2:]),
        [leg(6, 1.0, 0.7), leg(5, 1.0, 0.3)],
        [rest(*LEFT), passed((0.1, 1.5), (1.0, 0.0)), rest(*RIGHT)],
    ),
    "rest between phases": Case(
        ARM,
        [leg(6, 1.5, 0.7), leg(7, 1.5, 0.3)],
        [rest(*LEFT), rest(0.1, 1.5), rest(*RIGHT)],
    ),
    "a given duration": Case(
        ARM,
        [replace(leg(8, 1.2, 0.7), given=True), leg(7, 1.0, 0.3)],
        [rest(*LEFT), passed((0.1, 1.5), (1.0, 0.0)), rest(*RIGHT)],
    ),
    "moving start": Case(ARM, [leg(12, 1.5, 0.7)], [started(LEFT, (0.3, -0.4)), rest(*RIGHT)]),
    "moving goal": Case(
        ARM, [leg(12, 1.5, 0.7)], [started(LEFT, (0.3, -0.4)), met((0.9, 0.9), (-0.2, 0.3))]
    ),
    "moving goal of quintics": Case(
        System(2, 3, arm, lambda now: torques(6.0)(now) + jerks(now)[2:]),
        [leg(6, 1.5, 0.7)],
        [started(LEFT, (0.3, -0.4)), met((0.9, 0.9), (-0.2, 0.3))],
    ),
    "one interval after a moving joint": Case(
        System(1, 3, particle, torques(2.0)),
        [leg(6, 2.0, 1.0), leg(1, 1.0, 1.5)],
        [rest(0.0), met((0.8,), (0.1,)), met((1.0,), (0.2,))],
    ),
    "all at once": Case(
        System(2, 2, arm, powers, mean_square(25.0)),
        [leg(8, 1.0, 0.7), leg(7, 1.0, 0.3)],
        [started(LEFT, (0.3, -0.4)), passed((0.1, 1.5), (1.0, 0.0)), met((0.9, 0.9), (-0.2, 0.3))],
        watched=(2, 3),
    ),
}


# Solved by the method


@lru_cache
def point_problem(system: System, parameters: int) -> PointProblem:
    """The same system in units of the duration of a phase."""
    m, r = system.coordinates, system.pieces
    y, tau = ca.SX.sym("y", m * (r + 1) + 1), ca.SX.sym("tau", m)
    p, T = ca.SX.sym("p", parameters), y[-1]
    motion = [y[m * d : m * (d + 1)] / T**d for d in range(r + 1)]
    if r == 2:
        motion.append(ca.SX.nan(m))
    now = Instant(*motion, tau, p)
    rows = system.rows(now)
    sides = {(True, True): Sides.BOTH, (True, False): Sides.UPPER, (False, True): Sides.LOWER}
    return PointProblem(
        coordinates=m,
        derivatives=r,
        y=y,
        tau=tau,
        p=p,
        force=system.force(now),
        rows=ca.vertcat(*(row.quantity for row in rows)) if rows else ca.SX(0, 1),
        sides=tuple(sides[row.upper, row.lower] for row in rows),
        integrands=system.integrands(now),
    )


@lru_cache
def method_of(name: str) -> InteriorPoint:
    case = CASES[name]
    method = interior_point(point_problem(case.system, 1), tuple(case.points.tolist()))
    assert method is not None
    return method


def phases_of(case: Case) -> list[Phase]:
    rows = len(point_problem(case.system, 1).sides)
    phases, time = [], 0.0
    for q, leg in enumerate(case.legs):
        fractions = np.append(0.0, np.cumsum(leg.mesh))
        begin, end = (case.ends[q + k].at(time + k * leg.duration) for k in (0, 1))
        path = quintic(begin, end, leg.duration, fractions)
        time += leg.duration
        units = leg.duration ** np.arange(case.system.pieces)[:, None]
        knots = (path[:, : case.system.pieces] * units).reshape(len(path), -1)
        share = np.ones((len(leg.mesh), rows))
        phases.append(Phase(leg.mesh, leg.p, share, knots, leg.duration, leg.given))
    return phases


def boundaries_of(case: Case) -> list[Boundary]:
    r = case.system.pieces
    return [Boundary(end.state[:r], ~end.fixed[:r], end.drift) for end in case.ends]


def solved(name: str, settings: Settings = EXACT) -> InteriorPointSolution:
    case = CASES[name]
    return method_of(name).solve(phases_of(case), boundaries_of(case), settings)


@pytest.mark.parametrize("name", CASES)
def test_durations_are_those_of_ipopt(name):
    case = CASES[name]
    ours = solved(name)
    assert ours.status == "Solve_Succeeded"
    theirs = fastest(case.system, case.legs, case.ends, case.points)
    durations = [phase.duration for phase in ours.phases]
    assert sum(durations) == pytest.approx(theirs.sum(), rel=1e-8)
    np.testing.assert_allclose(durations, theirs, rtol=1e-7)
    for row in case.watched:
        assert max(abs(phase.multipliers[:, :, row]).max() for phase in ours.phases) > 1e-3
    assert (ours.integral_multipliers > 1e-3).all()
