"""The interior-point method on small problems of every kind, against Ipopt.

Each problem is solved twice on the same polynomials and points: by the method, with torques
eliminated and knots as unknowns, and by a transcription of its own (``oracles.point_motion``).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.compile import library
from deltaopt.limits.constraints import Alike
from deltaopt.planning.flat import interior_point as module
from deltaopt.planning.flat.interior_point import (
    OF_JERK,
    CompiledMethod,
    InteriorPointSolution,
    IntervalPoints,
    Phase,
    PhaseBoundary,
    Settings,
    interior_point,
)
from deltaopt.planning.flat.method_source import source
from deltaopt.planning.flat.point_problem import PointProblem
from tests.oracles.point_motion import (
    Array,
    End,
    Instant,
    Leg,
    Row,
    System,
    best,
    fastest,
    quintic,
)

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

BOTH, LOWER = (True, True), (False, True)
"""Which limits a row has: the upper one, the lower one."""
FOUR = IntervalPoints.of([0.0, 1 / 3, 2 / 3, 1.0])
EIGHT = IntervalPoints(
    (0.0, 1 / 6, 1 / 3, 1 / 3, 2 / 3, 2 / 3, 5 / 6, 1.0),
    (0, 0, 0, 1, 1, 2, 2, 2),
    (1 / 18, 2 / 9, 1 / 18, 1 / 6, 1 / 6, 1 / 18, 2 / 9, 1 / 18),
)
"""Both ends of each third, by Simpson's rule or the trapezoidal rule."""
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


@lru_cache
def arm_terms() -> ca.Function:
    """(x, v, a, tau, mass of the tip) -> equations of motion of an arm of two links of length one,
    and the angular velocities of both, from the position x of its tip.

    A mass of 1 at the elbow, gravity along -y: virtual work of any motion of the tip, torques
    acting on the absolute angles of both links. Their matrix depends on x.
    """
    x, v, a, tau = (ca.SX.sym(name, 2) for name in ("x", "v", "a", "tau"))
    mass = ca.SX.sym("mass")
    gravity, turn = ca.DM([0.0, -2.0]), ca.DM([[0.0, -1.0], [1.0, 0.0]])
    elbow = x / 2 + ca.sqrt(1 / ca.sumsqr(x) - 0.25) * (turn @ x)
    E = ca.jacobian(elbow, x)
    elbow_rate = E @ v
    elbow_acceleration = E @ a + ca.jtimes(elbow_rate, x, v)
    across = ca.horzcat(E.T @ (turn @ elbow), (ca.SX.eye(2) - E).T @ (turn @ (x - elbow)))
    inertia = E.T @ (elbow_acceleration - gravity) + mass * (a - gravity)
    rates = across.T @ v
    return ca.Function("arm", [x, v, a, tau, mass], [inertia - across @ tau, rates])


def arm(now: Instant) -> ca.SX:
    return arm_terms()(now.x, now.v, now.a, now.tau, now.p[0])[0]


def joint_rates(now: Instant) -> ca.SX:
    return arm_terms()(now.x, now.v, now.a, now.tau, now.p[0])[1]


def torques(limit: float) -> Callable[[Instant], list[Row]]:
    return lambda now: [Row(now.tau[k] / limit) for k in range(now.tau.numel())]


# Problems


@dataclass(frozen=True)
class Case:
    """A system and its phases; ``watched``: rows that a limit is expected to hold back.
    ``weights``: of the duration and of the running cost. ``sum_is_given``: whether all legs
    together take as long as they are guessed to."""

    system: System
    legs: Sequence[Leg]
    ends: Sequence[End]
    points: IntervalPoints | None = None
    watched: Sequence[int] = ()
    weights: tuple[float, float] = (1.0, 0.0)
    sum_is_given: bool = False

    @property
    def imposed(self) -> IntervalPoints:
        """Where limits are imposed: at four points unless the case says others."""
        return self.points or (FOUR if self.system.pieces == 2 else OF_JERK)


def rest(*x: float) -> End:
    state = np.zeros((3, len(x)))
    state[0] = x
    return End(state, np.ones((3, len(x)), dtype=bool), np.zeros(len(x)))


def passed(x: Sequence[float], v: Sequence[float]) -> End:
    """A point passed with a velocity that is only guessed."""
    end = rest(*x)
    end.state[1], end.fixed[1:] = v, False
    return end


def near(x: Sequence[float], v: Sequence[float], radius: float) -> End:
    """A place at most a radius from a point, with a velocity that is only guessed."""
    end = passed(x, v)
    return End(end.state, np.zeros_like(end.fixed), end.drift, radius)


def freed(end: End, free: Sequence[Sequence[int]], v: Sequence[float]) -> End:
    """Some components of a state at rest left free, by derivative; a velocity to guess from."""
    state, fixed = end.state.copy(), ~np.array(free, dtype=bool)
    state[1] = np.where(fixed[1], state[1], v)
    return End(state, fixed, end.drift)


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
    """Row 2: the height above y = -0.05 is nonnegative; row 3: a wall at x = 3, never reached."""
    above, beyond = now.x[1] + 0.05, now.x[0] - 3
    return [*torques(2.0)(now), Row(above - 1, upper=False), Row(beyond + 1, lower=False)]


def jerks(now: Instant, limit: float = 12.0) -> list[Row]:
    return torques(3.0)(now) + [Row(now.j[k] / limit) for k in range(now.j.numel())]


def squared_torques(now: Instant) -> ca.SX:
    return ca.sumsqr(now.tau)


def squared_jerks(now: Instant) -> ca.SX:
    return ca.sumsqr(now.j)


def given(n: int, duration: float, *p: float) -> Leg:
    return replace(leg(n, duration, *p), given=True)


LEFT, RIGHT = (-0.9, 1.0), (0.9, 1.1)
ARM = System(2, 2, arm, torques(6.0))
CASES = {
    "one coordinate": Case(
        System(1, 2, particle, torques(2.0)), [leg(12, 2.0, 1.0)], [rest(0.0), rest(1.0)]
    ),
    "two coordinates": Case(ARM, [leg(12, 1.5, 0.7)], [rest(*LEFT), rest(*RIGHT)]),
    "power": Case(
        System(2, 2, arm, powers), [leg(12, 1.5, 0.7)], [rest(*LEFT), rest(*RIGHT)], watched=(2, 3)
    ),
    "floor": Case(
        System(2, 2, particle, floor),
        [leg(12, 2.0, 1.0)],
        [rest(0.0, 0.0), rest(1.0, 0.1)],
        watched=(2,),
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
    "through a sphere": Case(
        ARM,
        [leg(8, 1.0, 0.7), leg(7, 1.0, 0.3)],
        [rest(*LEFT), near((0.1, 1.5), (1.0, 0.0), 0.05), rest(*RIGHT)],
    ),
    "through spheres with limits of jerk, from one": Case(
        System(2, 3, arm, lambda now: torques(6.0)(now) + jerks(now, 25.0)[2:]),
        [leg(6, 1.0, 0.7), leg(4, 1.0, 0.7), leg(5, 1.0, 0.3)],
        [
            replace(rest(*LEFT), fixed=np.repeat([[False], [True], [True]], 2, 1), radius=0.02),
            near((-0.2, 1.5), (1.0, 0.0), 0.05),
            near((0.3, 1.4), (1.0, 0.0), 1e-4),
            met((0.9, 0.9), (-0.2, 0.3)),
        ],
    ),
    "partly free": Case(
        ARM,
        [leg(7, 1.0, 0.7), leg(6, 1.0, 0.3)],
        [
            rest(*LEFT),
            freed(rest(0.1, 1.5), [[1, 0], [1, 0], [1, 1]], (1.0, 0.0)),
            freed(rest(*RIGHT), [[0, 0], [0, 1], [1, 1]], (0.0, 0.0)),
        ],
    ),
    "one interval after a moving joint": Case(
        System(1, 3, particle, torques(2.0)),
        [leg(6, 2.0, 1.0), leg(1, 1.0, 1.5)],
        [rest(0.0), met((0.8,), (0.1,)), met((1.0,), (0.2,))],
    ),
    "all at once": Case(
        System(2, 2, arm, powers),
        [leg(8, 1.6, 0.7), leg(7, 1.6, 0.3)],
        [started(LEFT, (0.3, -0.2)), passed((0.1, 1.5), (1.0, 0.0)), met((0.9, 0.9), (-0.2, 0.3))],
        watched=(2, 3),
    ),
    "effort far from all limits": Case(
        System(2, 2, arm, torques(60.0), running=squared_torques),
        [given(12, 2.5, 0.7)],
        [rest(*LEFT), rest(*RIGHT)],
        weights=(0.0, 1.0),
    ),
    "time and effort": Case(
        System(2, 2, arm, torques(6.0), running=squared_torques),
        [leg(12, 1.5, 0.7)],
        [rest(*LEFT), rest(*RIGHT)],
        watched=(0,),
        weights=(3.0, 0.02),
    ),
    "effort in two phases past a moving goal, within a power": Case(
        System(2, 2, arm, powers, running=squared_torques),
        [leg(8, 1.6, 0.7), leg(7, 1.6, 0.3)],
        [started(LEFT, (0.3, -0.4)), passed((0.1, 1.5), (1.0, 0.0)), met((0.9, 0.9), (-0.2, 0.3))],
        watched=(2, 3),
        weights=(10.0, 0.01),
    ),
    "effort in a given time from phase to phase": Case(
        System(2, 2, arm, torques(6.0), running=squared_torques),
        [leg(6, 1.0, 0.7), leg(5, 0.6, 0.7), leg(6, 0.9, 0.3)],
        [
            rest(*LEFT),
            passed((-0.2, 1.5), (1.0, 0.0)),
            near((0.3, 1.4), (1.0, 0.0), 0.05),
            met((0.9, 0.9), (-0.2, 0.3)),
        ],
        weights=(0.0, 1.0),
        sum_is_given=True,
    ),
    "smoothness": Case(
        System(2, 3, arm, torques(8.0), running=squared_jerks),
        [given(5, 1.4, 0.7), leg(6, 1.0, 0.3)],
        [rest(*LEFT), near((0.1, 1.5), (1.0, 0.0), 0.05), rest(*RIGHT)],
        weights=(1.0, 1e-3),
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
    return PointProblem(
        coordinates=m,
        derivatives=r,
        y=y,
        tau=tau,
        p=p,
        force=system.force(now),
        rows=ca.vertcat(*(row.quantity for row in rows)) if rows else ca.SX(0, 1),
        sides=tuple((row.upper, row.lower) for row in rows),
        running=ca.SX(0, 1) if system.running is None else system.running(now),
    )


@lru_cache
def method_for(system: System, parameters: int, imposed: IntervalPoints) -> CompiledMethod:
    method = interior_point(point_problem(system, parameters), imposed)
    assert method is not None
    return method


def method_of(name: str) -> CompiledMethod:
    """Of the case, shared by all of the same system."""
    case = CASES[name]
    return method_for(case.system, len(case.legs[0].p), case.imposed)


def phases_of(case: Case) -> list[Phase]:
    rows = len(point_problem(case.system, len(case.legs[0].p)).sides)
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


def boundaries_of(case: Case) -> list[PhaseBoundary]:
    r = case.system.pieces
    return [
        PhaseBoundary(end.state[:r], ~end.fixed[:r], end.drift, end.radius) for end in case.ends
    ]


def at_rest(position: Array, derivatives: int = 2) -> PhaseBoundary:
    state = np.zeros((derivatives, len(position)))
    state[0] = position
    return PhaseBoundary(state, np.zeros(state.shape, dtype=bool), np.zeros(len(position)))


def solved(name: str, settings: Settings = EXACT) -> InteriorPointSolution:
    case = CASES[name]
    return method_of(name).solve(
        phases_of(case),
        boundaries_of(case),
        settings,
        case.weights,
        sum_is_given=case.sum_is_given,
    )


PART_OF_OTHERS = {"two coordinates", "power", "effort far from all limits"}
"""Cases of other tests below, of which all is in a case with more phases or limits too."""


@pytest.mark.parametrize("name", [name for name in CASES if name not in PART_OF_OTHERS])
def test_durations_and_costs_are_those_of_ipopt(name):
    case = CASES[name]
    ours = solved(name)
    assert ours.status == "Solve_Succeeded"
    theirs, cost = best(
        case.system,
        case.legs,
        case.ends,
        case.imposed,
        case.weights,
        sum_is_given=case.sum_is_given,
    )
    durations = [phase.duration for phase in ours.phases]
    assert ours.cost == pytest.approx(cost, rel=1e-8)
    if case.system.running is None:
        assert sum(durations) == pytest.approx(theirs.sum(), rel=1e-8)
    np.testing.assert_allclose(durations, theirs, rtol=1e-7)
    for row in case.watched:
        assert max(abs(phase.multipliers[:, :, row]).max() for phase in ours.phases) > 1e-3
    has_sphere = np.array([end.radius > 0 for end in case.ends])
    assert (ours.sphere_multipliers[has_sphere] > 1e-6).all()
    assert (ours.sphere_multipliers[~has_sphere] == 0).all()


# Solved by hand


@pytest.mark.parametrize(("derivatives", "expected"), [(2, 2.0), (3, 32 ** (1 / 3))])
def test_a_point_without_mass(derivatives, expected):
    """|a| <= 1 or |j| <= 1 over a distance of 1, without torques and parameters: the rate switches
    at half of the duration, or at its quarters, T^2 = 4 or T^3 = 32."""
    y, none = ca.SX.sym("y", derivatives + 2), ca.SX(0, 1)
    row = y[derivatives] / y[-1] ** derivatives
    problem = PointProblem(1, derivatives, y, none, none, none, row, (BOTH,))
    method = interior_point(problem, FOUR if derivatives == 2 else OF_JERK)
    assert method is not None
    line = np.linspace(0, 1, 5)[:, None]
    knots = np.hstack([line, 1 + 0 * line, 0 * line])[:, :derivatives]
    phase = Phase(np.full(4, 0.25), np.empty(0), np.ones((4, 1)), knots, 3.0)
    ends = [at_rest(line[i], derivatives) for i in (0, -1)]
    found = method.solve([phase], ends, EXACT)
    assert found.solved
    assert found.phases[0].duration == pytest.approx(expected, rel=1e-9)


# Multipliers


def shorter_by(name: str, change: Callable[[Phase], Phase]) -> float:
    """How much shorter the motion gets after a change of the phases."""
    case = CASES[name]
    phases, boundaries = phases_of(case), boundaries_of(case)
    before = method_of(name).solve(phases, boundaries, EXACT)
    after = method_of(name).solve([change(phase) for phase in phases], boundaries, EXACT)
    assert before.solved
    assert after.solved
    return sum(a.duration - b.duration for a, b in zip(before.phases, after.phases, strict=True))


@pytest.mark.parametrize(("name", "row"), [("power", 2), ("two phases", 0), ("jerk", 4)])
def test_multipliers_are_durations_by_limits(name, row):
    """More of one row's limits, both of them: the motion gets shorter as multipliers say."""
    little = 1e-5

    def more(phase: Phase) -> Phase:
        share = phase.share.copy()
        share[:, row] += little
        return replace(phase, share=share)

    expected = sum(abs(phase.multipliers[:, :, row]).sum() for phase in solved(name).phases)
    assert shorter_by(name, more) == pytest.approx(little * expected, rel=2e-3)


def test_multiplier_of_a_sphere_is_duration_by_its_squared_radius():
    little, found = 1e-5, solved("through a sphere")
    case = CASES["through a sphere"]
    larger = case.ends[1].radius * (1 + little) ** 0.5
    more = replace(case, ends=[case.ends[0], replace(case.ends[1], radius=larger), case.ends[2]])
    after = method_of("through a sphere").solve(phases_of(more), boundaries_of(more), EXACT)
    shorter = sum(a.duration - b.duration for a, b in zip(found.phases, after.phases, strict=True))
    assert shorter == pytest.approx(little * found.sphere_multipliers[1], rel=2e-3)


def test_a_sphere_that_is_passed_anyway_leaves_the_duration():
    """When it is passed is then of no account, and the whole is as short as one phase."""
    case, method = CASES["two coordinates"], method_of("two coordinates")
    whole = replace(case, legs=[leg(80, 1.5, 0.7)])
    (one,) = method.solve(phases_of(whole), boundaries_of(whole), EXACT).phases
    sphere = near(one.knots[40, :2].tolist(), (1.0, 0.0), 0.1)
    halves = [leg(40, 0.75, 0.7), leg(40, 0.75, 0.7)]
    wide = replace(case, legs=halves, ends=[case.ends[0], sphere, case.ends[1]])
    found = method.solve(phases_of(wide), boundaries_of(wide), Settings(1e-4))
    assert found.solved
    assert found.sphere_multipliers[1] < 1e-6
    assert sum(phase.duration for phase in found.phases) == pytest.approx(one.duration, rel=1e-4)


def test_signs_of_multipliers():
    """Torques are held back at both limits; the floor only from below; the far wall not at all."""
    multipliers = solved("floor").phases[0].multipliers
    assert multipliers[:, :, :2].max() > 1e-3
    assert multipliers[:, :, :2].min() < -1e-3
    assert multipliers[:, :, 2].max() <= 0
    assert multipliers[:, :, 3].min() >= 0
    assert multipliers[:, :, 3].max() < 1e-8


def test_infinite_share_is_no_limit():
    """Without its floor the mass dips below it, as it does where there is no such row."""
    case = CASES["floor"]
    (phase,) = phases_of(case)
    share = phase.share.copy()
    share[:, 2] = np.inf
    without = method_of("floor").solve([replace(phase, share=share)], boundaries_of(case), EXACT)
    free = replace(case, system=System(2, 2, particle, torques(2.0)))
    assert without.phases[0].duration == pytest.approx(
        fastest(free.system, free.legs, free.ends, free.imposed)[0], rel=1e-8
    )
    assert without.phases[0].knots[:, 1].min() < -0.1


# Derivatives

PROBE = """
#ifndef LEFT_OUT
#define LEFT_OUT -1
#endif
void probe(const double *y, const double *p, const double *w, const double *s,
           double *c, double *C, double *m, double *S) {
  V Y[NY], P[NP], q[NQ], r[NC + NL + 1], e[NE], W[NC + NL], D[NZ + NL * NY], H[NH], K[NY][NY];
  V stiffness[NC], across[NY];
  double scale[NC];
  for (int a = 0; a < NY; a++) Y[a] = ALL(y[a]);
  for (int k = 0; k < NP; k++) P[k] = ALL(p[k]);
  for (int k = 0; k < NC + NL; k++) W[k] = ALL(w[k]);
  for (int k = 0; k < NC; k++) stiffness[k] = ALL(s[k]);
  for (int k = 0; k < NC; k++) scale[k] = LEFT_OUT != k;
  prepare(P, q);
  values(Y, q, scale, r, r + NC, e);
  second(Y, e, W, q, scale, D, H);
  curvature_of_rows(D, H, stiffness, K);
  across_rows(D, W, across);
  for (int k = 0; k < NC + NL; k++) c[k] = r[k][0];
  for (int a = 0; a < NY; a++) {
    V unit[NY], along[NC];
    for (int b = 0; b < NY; b++) unit[b] = ALL(a == b ? 1.0 : 0.0);
    for (int k = 0; k < NC; k++) along[k] = ALL(0.0);
    along_rows(D, unit, along);
    for (int k = 0; k < NC; k++) C[NY * k + a] = along[k][0];
    for (int k = 0; k < NL; k++) C[NY * (NC + k) + a] = D[NZ + NY * k + a][0];
    m[a] = across[a][0];
    for (int b = 0; b < NY; b++) S[NY * a + b] = K[a][b][0];
  }
}
"""
"""What the generated functions of a method make of one point."""


@dataclass(frozen=True)
class Probe:
    """Generated code at y, with weights of rows and of a running cost, and stiffnesses of rows."""

    code: ctypes.CDLL
    p: Array
    weights: Array
    stiffness: Array
    ny: int

    def __call__(self, y: Array) -> tuple[Array, Array, Array, Array]:
        """Rows, and T times the running cost, c; C; C^T w of the rows; H + C^T diag(s) C."""
        sizes = (len(self.weights), len(self.weights) * self.ny, self.ny, self.ny**2)
        results = [np.empty(size) for size in sizes]
        arrays = [y, self.p, self.weights, self.stiffness, *results]
        self.code.probe(*(ctypes.c_void_p(array.ctypes.data) for array in arrays))
        c, C, m, S = results
        return c, C.reshape(-1, self.ny), m, S.reshape(self.ny, self.ny)


PROBED = ["power", "all at once", "jerk", "floor", "time and effort", "smoothness"]


@pytest.mark.parametrize("name", PROBED)
def test_derivatives_are_those_of_the_values(name):
    """First and second, with torques eliminated, by central differences of the generated code."""
    problem = method_of(name).problem
    built = library(source(problem, 4) + PROBE)
    rng = np.random.default_rng(4)
    nc, m = len(problem.sides), problem.coordinates
    ni = problem.running.numel()
    y = rng.normal(size=problem.y.numel())
    y[:m], y[-1] = rng.uniform(0.3, 0.8, m), 1.3
    p, weights = rng.uniform(0.5, 1.5, problem.p.numel()), rng.normal(size=nc + ni)
    probe = Probe(ctypes.CDLL(str(built)), p, weights, rng.uniform(1, 2, nc), len(y))
    soft = replace(probe, stiffness=np.zeros(nc))

    def differences(of: Callable[[Array], Array]) -> Array:
        step = 1e-5 * np.eye(len(y))
        return np.stack([(of(y + d) - of(y - d)) / 2e-5 for d in step], axis=-1)

    _, C, across, S = probe(y)
    H = soft(y)[3]
    tolerance = {"rtol": 1e-7, "atol": 1e-8 * abs(H).max()}
    np.testing.assert_allclose(C, differences(lambda y: probe(y)[0]), **tolerance)
    np.testing.assert_allclose(H, differences(lambda y: weights @ probe(y)[1]), **tolerance)
    np.testing.assert_allclose(across, weights[:nc] @ C[:nc], rtol=1e-12, atol=1e-12)
    stiff = C[:nc].T @ (probe.stiffness[:, None] * C[:nc])
    np.testing.assert_allclose(S, H + stiff, rtol=1e-12, atol=1e-12 * abs(S).max())


def test_rows_that_are_alike():
    """Distances of a mass from three points, and its force, are what they are one by one, but for
    the curvature of the distances, which is left out; one of them that has no limit, and its
    derivatives, are 0."""
    y, tau, p = ca.SX.sym("y", 7), ca.SX.sym("tau", 2), ca.SX.sym("p", 7)
    own = ca.SX.sym("own", 2)

    def distance(centre: ca.SX) -> ca.SX:
        return ca.norm_2(y[:2] - p[0] * centre) - p[0] ** 2

    problem = PointProblem(
        coordinates=2,
        derivatives=2,
        y=y,
        tau=tau,
        p=p,
        force=y[4:6] - y[6] ** 2 * tau,
        rows=ca.vertcat(tau[0], *(distance(p[k : k + 2]) for k in (1, 3, 5)), tau[1]),
        sides=(BOTH, *[LOWER] * 3, BOTH),
    )
    alike = replace(problem, alike=(Alike(range(1, 4), slice(1, 7), own, distance(own), own[0]),))
    rng = np.random.default_rng(6)
    numbers, w, s = rng.uniform(0.5, 1.5, 7), rng.normal(size=5), rng.uniform(1, 2, 5)
    at = rng.uniform(2.0, 3.0, 7)

    def probe(of: PointProblem, w: Array, before: str = "") -> tuple[Array, ...]:
        built = library(before + source(of, 4) + PROBE)
        return Probe(ctypes.CDLL(str(built)), numbers, w, s, 7)(at)

    straight = w * [1, 0, 0, 0, 1]

    def curvature(weights: Array) -> Array:
        _, C, _, S = probe(problem, weights)
        return S - C.T @ (s[:, None] * C)

    for without, text in ([], ""), ([2], "#define LEFT_OUT 2\n"):
        c, C, across, _ = probe(problem, w * ~np.isin(np.arange(5), without))
        c[without], C[without] = 0, 0
        stiff = C.T @ (s[:, None] * C)
        expected = (c, C, across, curvature(straight) + stiff)
        for one, other in zip(expected, probe(alike, w, text), strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-12)


def test_of_the_curvature_of_friction_the_concave_part_is_left_out():
    """A mass with tau = A + c tanh (V / w) and the row tau: the second derivative by V of weight
    times row is weight c tanh'', and what the method takes of it is never negative."""
    y, tau, p = ca.SX.sym("y", 4), ca.SX.sym("tau"), ca.SX.sym("p")
    u, strength = y[1] / p, ca.SX(0.4)
    problem = PointProblem(
        coordinates=1,
        derivatives=2,
        y=y,
        tau=tau,
        p=p,
        force=y[2] + strength * ca.tanh(u) - tau,
        rows=tau,
        sides=(BOTH,),
        saturating=u,
        strengths=strength,
    )
    built = ctypes.CDLL(str(library(source(problem, 4) + PROBE)))
    w = 0.3
    for v in (-0.7, -0.2, 0.1, 0.9):
        for weight in (-1.5, 1.0):
            probe = Probe(built, np.array([w]), np.array([weight]), np.zeros(1), 4)
            S = probe(np.array([0.2, v, 1.0, 1.3]))[3]
            t = np.tanh(v / w)
            bending = weight * 0.4 * -2 * t * (1 - t**2) / w**2
            expected = np.zeros((4, 4))
            expected[1, 1] = max(bending, 0.0)
            np.testing.assert_allclose(S, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", ["power", "floor"])
def test_rows_see_the_torques_that_move_the_mass(name):
    """Rows at a point are those of the system with tau from its equations, solved by numpy."""
    case, problem = CASES[name], method_of(name).problem
    m, rng = case.system.coordinates, np.random.default_rng(5)
    x, v, a = rng.uniform(0.3, 0.8, m), rng.normal(size=m), rng.normal(size=m)
    p, T, tau = np.array([0.7]), 1.3, ca.SX.sym("tau", m)
    force = case.system.force(Instant(*map(ca.SX, (x, v, a)), ca.SX(m, 1), tau, ca.SX(p)))
    B, rest_ = ca.Function("B", [tau], [ca.jacobian(force, tau), force])(np.zeros(m))
    found = np.linalg.solve(B.full(), -rest_.full())
    now = Instant(*map(ca.SX, (x, v, a)), ca.SX(m, 1), ca.SX(found), ca.SX(p))
    expected = [float(ca.evalf(row.quantity)) for row in case.system.rows(now)]
    y = np.concatenate([x, T * v, T**2 * a, [T]])
    functions = problem.functions
    rows = functions.values(y, functions.prepare(p))[0].full().ravel()
    np.testing.assert_allclose(rows, expected, rtol=1e-12)


# Memory


def test_threads_get_what_one_alone_gets():
    """Eight threads, problems of different sizes in turn: bitwise the same."""
    names = ["power", "two phases", "time and effort", "floor"] * 24

    def knots(name: str) -> bytes:
        phases = solved(name, Settings()).phases
        return b"".join(p.knots.tobytes() + p.multipliers.tobytes() for p in phases)

    alone = [knots(name) for name in names]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(knots, names))
    assert together == alone


def test_what_memory_held_is_of_no_account(monkeypatch):
    before = [solved(name).phases[0].knots.tobytes() for name in CASES]
    memory = np.full(10**6, np.nan)
    monkeypatch.setattr(module._WORKSPACE, "at_least", lambda size: memory)
    after = []
    for name in CASES:
        memory[:] = np.nan
        after.append(solved(name).phases[0].knots.tobytes())
    assert after == before


@pytest.mark.parametrize("name", ["power", "two phases"])
def test_from_its_multipliers_a_moved_limit_is_found_again_sooner(name):
    """With limits a thousandth lower: the same solution as from the barrier's own multipliers."""
    before, boundaries = solved(name), boundaries_of(CASES[name])
    cold, warm = list[Phase](), list[Phase]()
    for phase, found in zip(phases_of(CASES[name]), before.phases, strict=True):
        share, known = 0.999 * phase.share, found.multipliers
        guess = replace(phase, share=share, knots=found.knots, duration=found.duration)
        cold.append(guess)
        warm.append(replace(guess, multipliers=known))
    begin = Settings(tolerance=1e-8, barrier=3e-4, closest=3e-4, iterations=200)
    again = [method_of(name).solve(each, boundaries, begin) for each in (cold, warm)]
    exact = method_of(name).solve(cold, boundaries, EXACT)
    assert all(found.solved for found in (*again, exact))
    assert again[1].iterations < again[0].iterations
    durations = [sum(phase.duration for phase in found.phases) for found in (*again, exact)]
    np.testing.assert_allclose(durations, durations[-1], rtol=1e-7)


# What cannot be solved is told


def ended(name: str, change: Callable[[Phase], Phase], settings: Settings = EXACT) -> str:
    case = CASES[name]
    phases = [change(phase) for phase in phases_of(case)]
    return method_of(name).solve(phases, boundaries_of(case), settings).status


@pytest.mark.parametrize("name", ["power", "all at once", "jerk"])
def test_no_number(name):
    assert ended(name, lambda p: replace(p, p=p.p * np.nan)) == "Invalid_Number_Detected"
    assert ended(name, lambda p: replace(p, knots=p.knots + np.nan)) == "Invalid_Number_Detected"


def test_no_solution():
    """Torques that do not hold the arm against gravity; an iteration is not enough."""
    assert ended("two phases", lambda p: replace(p, share=p.share * 0.01)) != "Solve_Succeeded"
    once = replace(EXACT, iterations=1)
    assert ended("power", lambda p: p, once) == "Maximum_Iterations_Exceeded"


def test_torques_that_are_not_determined():
    """Where the motors' directions coincide there are no torques."""
    y, tau, p = ca.SX.sym("y", 7), ca.SX.sym("tau", 2), ca.SX.sym("p")
    force = y[4:6] / y[6] ** 2 - ca.vertcat(tau[0] + tau[1], p * tau[0] + tau[1])
    problem = PointProblem(2, 2, y, tau, p, force, tau, (BOTH,) * 2)
    method = interior_point(problem, FOUR)
    assert method is not None
    knots = np.linspace(0, 1, 5)[:, None] * [1.0, 1.0, 0.0, 0.0]
    phase = Phase(np.full(4, 0.25), np.ones(1), np.ones((4, 2)), knots, 1.0)
    ends = [at_rest(knots[i, :2]) for i in (0, -1)]
    assert method.solve([phase], ends, EXACT).status == "Invalid_Number_Detected"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"derivatives": 4}, "derivatives"),
        ({"coordinates": 3}, "components"),
        ({"force": ca.SX.zeros(1)}, "equations for"),
        ({"sides": (BOTH,)}, "sides of"),
    ],
)
def test_sizes_that_do_not_agree(change, message):
    with pytest.raises(ValueError, match=message):
        replace(method_of("power").problem, **change)


def test_equations_must_be_affine_in_torques():
    problem = method_of("power").problem
    with pytest.raises(ValueError, match="affine"):
        replace(problem, force=problem.force + problem.tau**2)
