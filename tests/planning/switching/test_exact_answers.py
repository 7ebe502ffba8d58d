"""A unit mass on a line, whose fastest motions are known, through the planner's machinery.

The robot is replaced by force = acceleration, axis by axis; everything else, from the mesh to
the certificate, is what plans are made with.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.joints import SPEED_LIMIT, TORQUE_LIMIT
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.flat.flat_problem import compiled_flat
from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate, error_estimate, refined
from deltaopt.planning.nlp.problem import FASTEST, Cost, Guess, Solved
from deltaopt.planning.nlp.scaling import Parameters, Scaling
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.problem import Problem


def solved_on(
    equations: PointEquations, scaling: Scaling, mesh, guess: Trajectory, cost: Cost = FASTEST
) -> Solved:
    """The best motion on a mesh by the compiled method, to ten digits."""
    compiled = compiled_flat(equations, LINEAR, cost)
    if compiled is None:
        pytest.skip("without a compiler")
    first = Guess(guess, near=False, tolerance=1e-10)
    return compiled(mesh).solve(first, scaling)


class UnitMass:
    """What a trajectory needs of a model: coordinates and forces of a mass of 1 kg."""

    functions = SimpleNamespace(motors=slice(3, None, 3), layers=lambda parameters: ())
    layers = ()
    parameters = np.zeros(0)

    def motion(self, x, v, a):
        """Twelve coordinates, as a trajectory expects of three chains."""
        return tuple(np.repeat(part, 4, axis=1) for part in (x, v, a))

    def inverse_dynamics(self, x, v, a):
        return a


@dataclass(frozen=True)
class Line:
    """A way of d along the first axis with |force| ≤ u and, if given, |speed| ≤ v."""

    d: float
    u: float
    v: float | None

    @property
    def duration(self) -> float:
        if self.v is None:
            return 2 * np.sqrt(self.d / self.u)
        return self.d / self.v + self.v / self.u

    @property
    def switches(self) -> list[float]:
        """Where the force jumps."""
        if self.v is None:
            return [self.duration / 2]
        return [self.v / self.u, self.duration - self.v / self.u]

    @property
    def scaling(self) -> Scaling:
        """In a unit of time that is none of the answers."""
        ends = Boundary((0.0, 0.0, 0.0)), Boundary((self.d, 0.0, 0.0))
        return Scaling(Problem(UnitMass(), self.limits, ends), 1.3 * self.duration)

    @property
    def limits(self) -> SceneLimits:
        """Of force and speed, three each."""
        items, numbers = [(TORQUE_LIMIT, 3)], [self.u] * 3
        if self.v:
            items, numbers = [*items, (SPEED_LIMIT, 3)], [*numbers, *[self.v] * 3]
        return SceneLimits(Constraints(tuple(items)), np.array(numbers))

    @cached_property
    def equations(self) -> PointEquations:
        """Force is mass times acceleration."""
        constraints = self.limits.constraints
        y, p = (
            ca.SX.sym("y", 13),
            Parameters.symbols(constraints, UnitMass().functions, ca.SX(0, 1)),
        )
        time = p.time * y[12]
        speed, acceleration = p.length * y[3:6] / time, p.length * y[6:9] / time**2
        rows = constraints.rows(SimpleNamespace(tau=p.torque * y[9:12], dtheta=speed), p.limits)
        rows[:3] = y[9:12]
        force = y[9:12] - acceleration / p.torque
        return PointEquations(constraints, y, p, force, rows, ca.SX(0))

    @property
    def guess(self) -> Trajectory:
        """As of a plan: the straight line, smoothly, at 1.6 times the duration."""
        shares = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])[:, None]
        way = shares * np.array([self.d, 0.0, 0.0])
        position = PiecewisePolynomial(np.array([0.0, 1.0]), way[None])
        return Trajectory(position.slowed(1.6 * self.duration), UnitMass())

    def rows(self, motion: Trajectory) -> ByOrder:
        """Normalised rows inside the intervals, as the planner takes them."""
        inside = motion.inside_intervals(FRACTIONS)
        shape = (-1, len(FRACTIONS), 3)
        speed = (inside.v / self.v).reshape(shape) if self.v else None
        return ByOrder((inside.a / self.u).reshape(shape), (None, speed))

    def on_mesh(self, mesh, guess: Trajectory):
        """The motion of a mesh and what it is estimated to give away."""
        solution = solved_on(self.equations, self.scaling, mesh, guess)
        motion = Trajectory(solution.position, UnitMass())
        rows = self.rows(motion)
        speed = rows.states[1]
        both = rows.control if speed is None else np.concatenate([rows.control, speed], axis=2)
        force = np.abs(rows.control).max(axis=(1, 2)) - 1
        slowing = 1 + force / 2
        if speed is not None:
            slowing = np.maximum(slowing, np.abs(speed).max(axis=(1, 2)))
        controls = np.arange(both.shape[2]) < rows.control.shape[2]
        return motion, error_estimate(mesh, solution.multipliers, both, controls, slowing)


LINES = [Line(0.7, 3.0, None), Line(0.7, 3.0, 0.9), Line(200.0, 0.5, None), Line(200.0, 0.5, 7.0)]
UNEVEN = np.array([0.13, 0.09, 0.1, 0.08, 0.12, 0.07, 0.11, 0.06, 0.14, 0.1])
"""A mesh that has no knot at any of the switches."""


@pytest.fixture(scope="module", params=LINES, ids=str)
def line(request) -> Line:
    return request.param


@pytest.fixture(scope="module")
def meshes(line):
    """Refined twice: (mesh, motion, what it gives away)."""
    found, mesh, guess = [], UNEVEN, line.guess
    for _ in range(3):
        motion, lost = line.on_mesh(mesh, guess)
        found.append((mesh, motion, lost))
        tightened = np.full(len(mesh), 4e-3)
        mesh, guess = refined(mesh, lost, lost.total / 10, mesh / 4, tightened), motion
    return found


def gap(line: Line, motion: Trajectory, lost: ErrorEstimate) -> float:
    """Of the motion once it is slowed to its limits, the true one."""
    return motion.duration * (1 + lost.exceeded.max()) / line.duration - 1


def test_meshes_are_never_faster_than_possible(line, meshes):
    assert all(gap(line, motion, lost) > -1e-7 for _, motion, lost in meshes)


def test_meshes_come_to_the_answer(line, meshes):
    gaps = [gap(line, motion, lost) for _, motion, lost in meshes]
    assert gaps[-1] < 0.2 * gaps[0]


def test_estimated_gap_is_about_the_true_one(line, meshes):
    for _, motion, lost in meshes:
        estimated = lost.exceeded.max() + lost.total
        assert 0.99 * gap(line, motion, lost) < estimated < 2.5 * gap(line, motion, lost)
