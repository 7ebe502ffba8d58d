"""A turnpike: ẋ = u, |u| ≤ 1, from x = 1 to x = 1/2 in the time 2, least ∫ x² dt.

The best motion goes to x = 0 as fast as it may, stays as long as it can, and leaves: switches
at 1 and 1.5, cost ∫_0^1 t² dt + ∫_0^½ t² dt = 3/8. The arcs' states are positions and velocities:
x is the velocity of a unit mass, u its force, the place where it ends is free.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.limits.torque import Torque
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.nlp.cost import Cost
from deltaopt.planning.nlp.scaling import Parameters, Scaling
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.planning.switching.structure import SwitchingStructure
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.problem import Problem
from tests.oracles.arcs import ArcProblem
from tests.oracles.certify import certify
from tests.planning.switching.test_exact_answers import UnitMass

T, SWITCHES, LEAST = 2.0, [1.0, 1.5], 3 / 8
COST = Cost(time=0.0, running=1.0, duration_is_given=True)


@dataclass(frozen=True)
class Turnpike(Scaling):
    """Along the first axis; the others rest. The unit of velocity is 1 / T."""

    @property
    def at_start(self):
        return np.array([0, 0, 0, T * 1.0, 0, 0])

    @property
    def at_goal(self):
        return np.array([np.inf, 0, 0, T * 0.5, 0, 0])


LIMITS = SceneLimits(Constraints(((Torque(), 3),)), np.ones(3))


def scaling() -> Turnpike:
    return Turnpike(Problem(None, LIMITS, (Boundary((0, 0, 0)), Boundary((1, 0, 0)))), T)


def equations() -> PointEquations:
    """∫ |v|² dt: the other axes' rest costs least."""
    y, p = ca.SX.sym("y", 13), Parameters.symbols(LIMITS.constraints, ca.SX(0, 1))
    force = y[9:12] - y[6:9] / T**2
    cost = T * ca.sumsqr(y[3:6] / T)
    return PointEquations(LIMITS.constraints, y, p, force, y[9:12], cost)


def guess() -> Trajectory:
    """Slows down evenly."""
    line = np.zeros((1, 3, 3))
    line[0, 1:, 0] = 1.0, -0.125
    return Trajectory(PiecewisePolynomial(np.array([0.0, T]), line), UnitMass())


def structure() -> SwitchingStructure:
    """As detected on a mesh of ten intervals: down, singular, up."""
    control = np.zeros((10, 3, 3))
    control[:, :, 0] = np.array([-1.0] * 4 + [0.0] * 4 + [1.0] * 2)[:, None]
    return detect_structure(np.full(10, 0.1), ByOrder(control))


@pytest.fixture(scope="module", params=[3, 5, 8])
def solved(request):
    """(problem, solution) from lengths that are not the answer's."""
    problem, scaled = ArcProblem(equations(), structure(), request.param, COST), scaling()
    start = problem.pack(guess(), scaled)
    return problem, problem.program.solve(start, *problem.bounds(scaled), scaled.vector())


def test_switches(solved):
    problem, solution = solved
    ends = T * np.cumsum(problem.lengths(solution.z))
    np.testing.assert_allclose(ends, [*SWITCHES, T], atol=1e-6)


def test_cost(solved):
    """Of the motion itself, by Gauss's rule, not of the program."""
    problem, solution = solved
    motion = problem.unpack(solution.z, scaling())
    nodes, weights = np.polynomial.legendre.leggauss(12)
    h = np.diff(motion.knots)
    t = motion.knots[:-1, None] + h[:, None] * (nodes + 1) / 2
    x = motion.derivative().at(t.ravel())[:, 0].reshape(t.shape)
    cost = float((h / 2) @ (x**2 @ weights))
    assert cost == pytest.approx(LEAST, abs=1e-8)
    assert motion.derivative().at(np.array([0.0, T]))[:, 0] == pytest.approx([1.0, 0.5], abs=1e-9)


def test_pontryagins_condition(solved):
    problem, solution = solved
    assert certify(problem, solution, scaling().vector()).residual < 1e-7
