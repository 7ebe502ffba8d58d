"""What a controller's interpolation of a joint table asks for, against differences of positions."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import Infeasible
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.joint_table import (
    CUBIC,
    QUINTIC,
    JointTable,
    Rows,
    checked_table,
    demand_of,
    table_within_limits,
)
from deltaopt.robot.model import delta_model
from studies.problems import PROBLEMS

SCENE = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
MODEL = delta_model(SCENE.robot, SCENE.payload)


@pytest.fixture(scope="module")
def trajectory(picked):
    return picked.trajectory


@pytest.mark.parametrize("interpolation", [CUBIC, QUINTIC], ids=lambda i: i.name)
def test_demand_is_what_positions_ask_for(trajectory, interpolation):
    """The interpolated angles alone, differentiated by central differences, give the torques."""
    found = checked_table(SCENE, trajectory, Rows(1e-3), interpolation)
    angles, demand = interpolation.pieces(found.table), found.demand
    step = 2e-6
    inside = np.linspace(0.003, 0.997, 60)  # of a millisecond: no difference spans a jump
    t = (angles.knots[:-1, None] + inside * np.diff(angles.knots)[:, None]).ravel()
    before, x, after = (
        MODEL.forward_kinematics(angles.at(t + shift)) for shift in (-step, 0.0, step)
    )
    v, a = (after - before) / (2 * step), (after - 2 * x + before) / step**2
    share = np.abs(MODEL.inverse_dynamics(x, v, a)) / SCENE.robot.torque_limits
    assert demand.limit == "torque"
    assert demand.share == pytest.approx(share.max(), rel=1e-2)
    assert demand.share > 1.1  # angles every millisecond hide where torques jump
    motor = int(demand.subject.removeprefix("motor ")) - 1  # of two, where the move is symmetric
    assert share[:, motor].max() == pytest.approx(share.max(), rel=1e-2)
    assert share[np.abs(t - demand.t) < 1e-3, motor].max() > 0.98 * demand.share


def test_rows_of_a_knot_have_its_very_time(trajectory):
    """A time that differs in its last digit would be a piece of its own, of no length to speak of
    and accelerations that no motor has. It did after intervals that are shorter than the next."""
    for first in np.random.default_rng(1).uniform(1e-3, 1e-2, 20):
        knots = trajectory.duration * np.array([0.0, first, 0.1, 0.5, 1.0])
        position = PiecewisePolynomial.hermite(knots, *trajectory.position.with_rate_at(knots))
        uneven = Trajectory(position, trajectory.model)
        assert np.isin(JointTable.at_own_knots(uneven).t, knots).all()


def test_quintic_pieces_at_own_knots_are_the_plan(trajectory):
    found = checked_table(SCENE, trajectory, Rows(), QUINTIC)
    assert found.slowed == 1
    assert found.demand.share < 1.0003
    angles = found.table.quintic()
    t = np.linspace(*trajectory.knots[[0, -1]], 301)
    np.testing.assert_allclose(angles.at(t), trajectory(t).theta, atol=2e-7)
    doubled = np.diff(found.table.t) == 0
    assert 0 < doubled.sum() < len(trajectory.knots)
    jumps = np.abs(np.diff(found.table.ddtheta, axis=0)[doubled]).max(axis=1)
    assert jumps.min() > 1e-9 * np.abs(found.table.ddtheta).max()


@pytest.mark.parametrize("interpolation", [CUBIC, QUINTIC], ids=lambda i: i.name)
@pytest.mark.parametrize("rows", [Rows(), Rows(2e-3)], ids=["own knots", "2 ms"])
def test_tables_that_keep_limits(trajectory, rows, interpolation):
    found = table_within_limits(SCENE, trajectory, rows, interpolation, in_time=False)
    assert found.demand.share <= 1 + 1e-9
    assert found.slowed >= 1
    again = demand_of(SCENE, interpolation.pieces(found.table))
    assert again == found.demand
    hurried = checked_table(SCENE, trajectory, rows, interpolation)
    assert found.slowed > hurried.slowed  # none of these keeps limits at the plan's own speed


def test_steps_are_whole(trajectory):
    found = checked_table(SCENE, trajectory, Rows(4e-3), CUBIC)
    steps = np.diff(found.table.t)
    np.testing.assert_allclose(steps, 4e-3, rtol=1e-12)
    assert found.slowed * trajectory.duration == pytest.approx(steps.sum())
    assert 0 <= steps.sum() - trajectory.duration < 4e-3
    with pytest.raises(ValueError, match="no whole number of cycles"):
        JointTable.at_cycle(trajectory, 4e-3)


def test_a_table_has_a_million_rows_at_most(trajectory):
    """Instead of as many as memory holds, or more."""
    with pytest.raises(Infeasible, match=r"at most 1000000 rows: .* s apart, not 1e-09"):
        checked_table(SCENE, trajectory, Rows(1e-9), CUBIC)


def test_a_polynomial_of_the_same_degree_is_reproduced():
    """Cubic and quintic pieces from values and derivatives of a polynomial are that polynomial."""
    rng = np.random.default_rng(4)
    t = np.array([0.0, 0.3, 0.35, 1.0])
    for interpolation, degree in ((CUBIC, 3), (QUINTIC, 5)):
        p = rng.normal(size=(degree + 1, 3))
        exact = PiecewisePolynomial(np.array([0.0, 1.0]), p[None])
        rate = exact.derivative()
        table = JointTable(t, exact.at(t), rate.at(t), rate.derivative().at(t))
        u = np.linspace(0, 1, 50)
        np.testing.assert_allclose(interpolation.pieces(table).at(u), exact.at(u), atol=1e-12)


def test_what_slowing_cannot_cure_is_said(trajectory, monkeypatch):
    """A robot so weak that it cannot even hold the platform on the way."""
    drive = SCENE.robot.drive.model_copy(update={"torque": 0.5})
    robot = SCENE.robot.model_copy(update={"drive": drive})
    weak = SCENE.model_copy(update={"robot": robot, "limits": None})
    monkeypatch.setattr("deltaopt.output.joint_table._MOST_SLOWINGS", 5)
    with pytest.raises(Infeasible, match=r"torque of motor \d is exceeded however slow"):
        table_within_limits(weak, trajectory, Rows(4e-3), CUBIC, in_time=False)


def test_a_limit_of_places_that_is_used_up_keeps_no_table_from_others(trajectory):
    """The goal is on the rim of the workspace, of which slowing leaves no room."""
    workspace = {"depth": [0.3, 0.5], "radius": SCENE.goal[1]}
    robot = SCENE.robot.model_copy(update={"workspace": workspace})
    rim = SCENE.model_copy(update={"robot": robot})
    found = table_within_limits(rim, trajectory, Rows(), CUBIC, in_time=False)
    assert found.demand.limit == "workspace radius"
    assert found.demand.kept
    assert found.demand.share == pytest.approx(1.0, abs=1e-9)
    assert (
        found.slowed == table_within_limits(SCENE, trajectory, Rows(), CUBIC, in_time=False).slowed
    )
