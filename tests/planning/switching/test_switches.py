"""Newton's method on the conditions of a structure: against Ipopt, exact answers, differences."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from deltaopt import Planner, load_scene, plan, verify
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.joints import SPEED_LIMIT, TORQUE_LIMIT
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import ConstraintRows, constraint_rows
from deltaopt.planning.flat.equations import PointEquations, point_equations
from deltaopt.planning.nlp.scaling import Parameters, Scaling
from deltaopt.planning.switching.active_set import ActiveSetUpdate
from deltaopt.planning.switching.arc_mesh import ArcMesh
from deltaopt.planning.switching.conditions import OptimalityConditions
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.planning.switching.kkt_system import KKTSystem
from deltaopt.planning.switching.newton import solve_conditions
from deltaopt.planning.switching.residuals import OptimalityResiduals
from deltaopt.planning.switching.structure import (
    INACTIVE,
    ActiveLimits,
    SwitchingStructure,
)
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.robot.model import DeltaModel
from tests.oracles.arcs import ArcProblem
from tests.planned_scenes import machine_code, random_move
from tests.planning.switching.test_exact_answers import (
    LINES,
    UNEVEN,
    Line,
    UnitMass,
)

UP, DOWN = ActiveLimits(control=1), ActiveLimits(control=-1)


def structure(*arcs: tuple[float, str]) -> SwitchingStructure:
    """Arcs of (length, limit of each motor's control)."""
    words = {"+": UP, "-": DOWN, "0": INACTIVE}
    return SwitchingStructure(
        np.array([length for length, _ in arcs]),
        tuple(tuple(words[letter] for letter in motors) for _, motors in arcs),
    )


@pytest.fixture(scope="module")
def cross():
    """industrial_cross: its rows and parameters; velocities are limited."""
    scene = load_scene("problems/industrial_cross.yaml")
    model = DeltaModel(scene.robot, scene.payload)
    scaling = Scaling(problem_of(scene), 0.15)
    rows = constraint_rows(point_equations(model.functions, scaling.constraints))
    return scene, model, scaling, rows, scaling.parameters


def test_rows_are_those_of_the_model(cross):
    """Torques by inverse dynamics of the twelve coordinates, in units of their limits."""
    _, model, scaling, constraints, p = cross
    rng = np.random.default_rng(1)
    y = rng.uniform(-0.3, 0.3, (5, 9))
    x = scaling.origin + scaling.length * y[:, :3]
    v, a = scaling.length * y[:, 3:6] / scaling.time, scaling.length * y[:, 6:] / scaling.time**2
    rows = constraints.values(y, p)
    limits = scaling.limits
    tau = model.inverse_dynamics(x, v, a) / limits.upper("torque")
    np.testing.assert_allclose(rows[:, constraints.control], tau, rtol=1e-9, atol=1e-12)
    above = model.alignments(x) - 0.01
    position, velocity = constraints.state(0), constraints.state(1)
    np.testing.assert_allclose(rows[:, position.value] + 1, above, rtol=1e-9)
    speed = model.motion(x, v, a)[1][:, 3::3] / limits.upper("speed")
    np.testing.assert_allclose(rows[:, velocity.value], speed, rtol=1e-9, atol=1e-12)


def test_derivatives_of_the_rows_by_differences(cross):
    *_, rows, p = cross
    rng = np.random.default_rng(2)
    y, along = rng.uniform(-0.3, 0.3, (4, 9)), rng.standard_normal((4, 9))
    multipliers, step = rng.standard_normal((4, rows.number)), 1e-5
    _, J, H = rows.derivatives(y, multipliers, p)
    after, before = (rows.derivatives(y + s * step * along, multipliers, p) for s in (1, -1))
    slope = (after[0] - before[0]) / (2 * step)
    np.testing.assert_allclose(np.einsum("nra,na->nr", J, along), slope, rtol=1e-6, atol=1e-6)
    bend = np.einsum("nr,nra->na", multipliers, after[1] - before[1]) / (2 * step)
    np.testing.assert_allclose(np.einsum("nab,nb->na", H, along), bend, rtol=1e-5, atol=1e-5)


def test_rows_that_hold_a_state_limit_are_its_derivatives_by_time(cross):
    """The chain rule with the Jacobian of the limited quantity, along any motion."""
    *_, rows, p = cross
    rng = np.random.default_rng(4)
    y = rng.uniform(-0.3, 0.3, (6, 9))
    r, J, _ = rows.derivatives(y, np.zeros((6, rows.number)), p)
    dy = np.hstack([y[:, 3:], np.zeros((6, 3))])
    assert [state.order for state in rows.states] == [1, 0]
    for state in rows.states:
        assert len(state.derivatives) == 3 - state.order
        assert (J[:, state.holding, 6:] != 0).any()
        for value, rate in pairwise(state.derivatives):
            assert (J[:, value, 6:] == 0).all()
            by_chain = np.einsum("nra,na->nr", J[:, value], dy)
            np.testing.assert_allclose(r[:, rate], by_chain, rtol=1e-9, atol=1e-12)


def test_newton_and_ipopt_find_the_same_switches():
    scene = load_scene("problems/light_and_fast.yaml")
    arcs = structure((0.234, "++-"), (0.166, "+--"), (0.057, "+-+"), (0.19, "--+"))
    arcs = SwitchingStructure(
        np.array([*arcs.lengths, 0.211, 0.142]), (*arcs.limits, (DOWN, UP, UP), (UP, UP, UP))
    )
    guess = plan(scene, tolerance=1e-3).trajectory
    model = guess.model
    scaling = Scaling(problem_of(scene), 0.15)
    equations = point_equations(model.functions, scaling.constraints)
    rows, mesh = ConstraintRows(equations), ArcMesh.of(arcs, 8)
    conditions = OptimalityConditions(rows, arcs, mesh, scaling.at_goal, scaling.parameters)
    found = solve_conditions(conditions, guess, scaling).point
    problem = ArcProblem(equations, arcs, 8)
    p = scaling.parameters
    other = problem.program.solve(problem.pack(guess, scaling), *problem.bounds(scaling), p)
    np.testing.assert_allclose(found.lengths, problem.lengths(other.z), atol=1e-8)
    np.testing.assert_allclose(found.A, problem.accelerations(other.z), atol=1e-5)
    np.testing.assert_allclose(KKTSystem(conditions, found).hamiltonian, -1, atol=1e-9)
    multipliers = conditions.multipliers(found)
    assert ((multipliers * arcs.control[problem.arc][:, None]) > -1e-7).all()
    weight = (
        problem.interval_lengths(other.z)[:, None, None]
        * conditions.mesh.polynomials.quadrature[:, None]
    )
    ipopts = np.abs(problem.control_multipliers(other, p)) / weight
    np.testing.assert_allclose(np.abs(multipliers), ipopts, atol=1e-4)


@pytest.mark.parametrize("line", LINES, ids=str)
@pytest.mark.parametrize("barrier", [0.0, 1e-9], ids=["plain", "barrier"])
def test_exact_answers(line: Line, barrier: float):
    """Also where two axes have nothing to do: their force is singular and has no multiplier."""
    motion, _ = line.on_mesh(UNEVEN, line.guess)
    arcs = detect_structure(UNEVEN, line.rows(motion))
    rows, mesh = ConstraintRows(line.equations), ArcMesh.of(arcs, 5)
    conditions = OptimalityConditions(
        rows, arcs, mesh, line.scaling.at_goal, line.scaling.parameters, (), barrier
    )
    found = solve_conditions(conditions, motion, line.scaling).point
    assert found.duration * line.scaling.time == pytest.approx(line.duration, rel=2e-8)
    ends = np.cumsum(found.lengths)[:-1] * line.scaling.time
    np.testing.assert_allclose(ends, line.switches, rtol=1e-6)
    np.testing.assert_allclose(KKTSystem(conditions, found).hamiltonian, -1, atol=1e-6)


def test_one_motor_with_one_coordinate():
    """The same line without the two idle axes: nothing in the method is made for three motors."""
    line = Line(0.7, 3.0, 0.9)
    constraints = Constraints(((TORQUE_LIMIT, 1), (SPEED_LIMIT, 1)), motors=1)
    limits = SceneLimits(constraints, np.array([line.u, line.v]))
    ends = Boundary((0.0,)), Boundary((line.d,))
    scaling = Scaling(Problem(UnitMass(), limits, ends), 1.3 * line.duration)
    y, p = ca.SX.sym("y", 5), _one_coordinate(constraints)
    time = p.time * y[4]
    speed, acceleration = p.length * y[1] / time, p.length * y[2] / time**2
    motion = SimpleNamespace(tau=p.torque * y[3], dtheta=speed)
    c = constraints.rows(motion, p.limits)
    off = y[3] - acceleration / p.torque
    rows = ConstraintRows(PointEquations(constraints, y, p, off, c, ca.SX(0)))
    up, at_speed, down = ((ActiveLimits(*limits),) for limits in ((1,), (0, (0, 1)), (-1,)))
    arcs = SwitchingStructure(np.array([0.3, 0.4, 0.3]), (up, at_speed, down))
    way = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])[:, None] * line.d
    position = PiecewisePolynomial(np.array([0.0, 1.0]), way[None]).slowed(1.6 * line.duration)
    conditions = OptimalityConditions(
        rows, arcs, ArcMesh.of(arcs, 5), scaling.at_goal, scaling.parameters
    )
    found = solve_conditions(conditions, Trajectory(position, UnitMass()), scaling).point
    assert found.duration * scaling.time == pytest.approx(line.duration, rel=1e-9)
    np.testing.assert_allclose(KKTSystem(conditions, found).hamiltonian, -1, atol=1e-9)
    assert ActiveSetUpdate(OptimalityResiduals(conditions, found, 5e-9)).changes == []


def _one_coordinate(constraints: Constraints) -> Parameters:
    """Parameters of a mechanism on a line."""
    names = ("origin", "length", "time", "torque")
    none, units = ca.SX(0, 1), (ca.SX.sym(name) for name in names)
    others = dict.fromkeys(("motors", "mechanism", "cover", "widths"), none)
    return Parameters(*units, limits=constraints.numbers(), **others)


@cache
def orsino(which: int):
    """One of the seeded random moves, and its plan."""
    scene = random_move("orsino", which)
    return scene, plan(scene, tolerance=1e-6)


def test_a_move_with_a_torque_that_no_limit_holds():
    """Motor 2 has a stretch where more or less of it gains nothing."""
    scene, found = orsino(1)
    assert found.certificate is not None
    assert found.gap <= 1e-6
    assert verify(scene, found.trajectory).ok
    middles = found.trajectory.inside_intervals([0.5])
    share = np.abs(middles.tau) / np.array(scene.robot.torque_limits)
    assert share[:, [0, 2]].min() > 0.99999
    assert share[:, 1].min() < 0.9


@pytest.mark.parametrize(("which", "motor", "rides"), [(34, 3, True), (26, 3, False)])
def test_a_move_along_the_margin_of_a_singularity(which: int, motor: int, rides: bool):
    """A chain stays at the margin for a while, or touches it at an instant; never below."""
    scene, found = orsino(which)
    assert found.certificate is not None
    assert found.gap <= 1e-6
    assert verify(scene, found.trajectory).ok
    times = np.linspace(0, found.duration, 2001)
    alignments = found.trajectory.model.alignments(found.trajectory.position.at(times))
    margin = alignments[:, motor - 1].min()
    assert margin == pytest.approx(0.1**2, abs=2e-6)
    assert ((alignments[:, motor - 1] < margin + 1e-6).sum() > 40) == rides


@machine_code
def test_an_arc_at_a_position_limit_that_should_be_left_is_not_the_answer():
    """One structure of this move meets all other conditions and is slower by 1.4e-5 than what
    meshes find, which know of no structure."""
    scene, found = orsino(34)
    on_meshes = Planner(scene.robot, 1.0, tolerance=1e-6, resolved_below=0.0)
    duration = on_meshes.plan(scene.start, scene.goal).duration
    assert found.duration == pytest.approx(duration, rel=2e-6)
