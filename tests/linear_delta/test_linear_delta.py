"""A robot that is no Delta of rotary drives: planned and verified with no change of the package."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt.errors import Infeasible, SceneError
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.robot.drive import Drive
from deltaopt.robot.joints import Joints
from deltaopt.robot.machine import Machine
from deltaopt.robot.model import delta_model, new_model
from deltaopt.scene.scene import Scene
from tests.linear_delta.robot import LinearDelta, LinearModel
from tests.linear_delta.transcription import Numbers, carriages, shortest

FORCE, SPEED, MOST = 60.0, 1.2, 0.356
PAYLOAD = 0.5
ROBOT = LinearDelta(
    name="linear",
    guides=0.3,
    pins=0.05,
    bar=0.5,
    platform=0.5,
    carriage=0.8,
    bars=0.2,
    drive=Drive(torque=FORCE, speed=SPEED),
    joints=Joints(arm=(0.0, MOST)),
)
NUMBERS = Numbers(0.25, 0.5, 0.5 + PAYLOAD, 0.8, 0.2, FORCE, SPEED, (0.0, MOST))
MASS = 0.5 + PAYLOAD + 3 * (0.8 + 0.2)
"""Of all that moves alike in a vertical move, kg."""
TOP, BOTTOM = (0.55, 0.0, 0.0), (0.75, 0.0, 0.0)


def vertical(force: float, speed: float, way: float) -> float:
    """The duration of a vertical move, along which all bars only translate: full force down, the
    speed limit if it is reached, full force up."""
    down, up = (3 * force / MASS + sign * 9.81 for sign in (1, -1))
    ramps = 1 / down + 1 / up
    if speed**2 * ramps / 2 > way:
        return (2 * way * ramps) ** 0.5
    return way / speed + speed * ramps / 2


def test_dynamics_are_those_written_out_by_hand():
    rng = np.random.default_rng(1)
    symbols = [ca.SX.sym(name, 3) for name in "xva"]
    by_hand = ca.Function("by_hand", symbols, list(carriages(NUMBERS, *symbols)))
    model = LinearModel(ROBOT, PAYLOAD)
    for _ in range(20):
        x, v, a = rng.uniform(-0.1, 0.1, 3) + TOP, rng.normal(size=3), 20 * rng.normal(size=3)
        s, ds, force = (np.array(each).ravel() for each in by_hand(x, v, a))
        q, dq, _ = model.motion(x, v, a)
        assert np.allclose(q[3::3], s, atol=1e-14)
        assert np.allclose(dq[3::3], ds, atol=1e-13)
        assert np.allclose(model.inverse_dynamics(x, v, a), force, atol=1e-11)
        assert np.allclose(model.forward_kinematics(s), x, atol=1e-13)


@pytest.mark.parametrize(("start", "goal"), [(TOP, BOTTOM), (BOTTOM, TOP)])
@pytest.mark.parametrize("speed", [SPEED, 3.0])
def test_vertical_moves_take_what_a_formula_says(start, goal, speed):
    robot = ROBOT.model_copy(update={"drive": Drive(torque=FORCE, speed=speed)})
    scene = Scene(robot=robot, payload=PAYLOAD, start=start, goal=goal)
    plan = deltaopt.plan(scene)
    assert plan.duration == pytest.approx(vertical(FORCE, speed, 0.2), rel=1e-3)
    assert plan.gap <= 1e-3
    assert 0 < lower_bound(scene) <= vertical(FORCE, speed, 0.2)
    assert deltaopt.verify(scene, plan.trajectory).ok


def test_a_via_point_at_which_it_turns_back():
    scene = Scene(robot=ROBOT, payload=PAYLOAD, start=TOP, goal=TOP, via=(BOTTOM,))
    plan = deltaopt.plan(scene)
    assert plan.duration == pytest.approx(2 * vertical(FORCE, SPEED, 0.2), rel=1e-3)
    assert deltaopt.verify(scene, plan.trajectory).ok


def test_past_a_body_at_all_limits_as_an_independent_program_says():
    centre, radius = (0.735, 0.0, 0.0), 0.05
    body = {"sphere": {"centre": centre, "radius": radius}}
    start, goal = (0.75, 0.0, -0.05), (0.745, -0.01, 0.055)
    scene = Scene(robot=ROBOT, payload=PAYLOAD, start=start, goal=goal, keep_out=(body,))
    plan = deltaopt.plan(scene)
    assert plan.gap <= 1e-3
    report = deltaopt.verify(scene, plan.trajectory)
    assert report.ok
    names = ("torque", "speed", "arm_angle", "clearance")
    assert all(report.excesses[f"{name}_excess"].value > -1e-3 for name in names)
    assert [report.excesses[f"{name}_excess"].unit for name in names] == ["N", "m/s", "m", "m"]

    guess = plan.trajectory(np.linspace(0, plan.duration, 31)).x.T
    alone = shortest(NUMBERS, guess, plan.duration, (centre, radius))
    assert plan.duration == pytest.approx(alone, rel=1.5e-3)


def test_a_fault_that_is_planted_is_found():
    scene = Scene(robot=ROBOT, payload=PAYLOAD, start=TOP, goal=BOTTOM)
    faster = deltaopt.plan(scene).trajectory.slowed(0.99)
    report = deltaopt.verify(scene, faster)
    assert not report.ok
    assert "slowed to" in report.failures()[-1]


def test_what_knows_rotary_deltas_alone_says_so():
    given = {"robot": ROBOT, "payload": PAYLOAD, "start": TOP, "goal": BOTTOM}
    with pytest.raises(SceneError, match="the links of this robot are not known"):
        Scene(**given, robot_keeps_clear=True)
    with pytest.raises(SceneError, match="a Delta robot, the only one that this is known for"):
        delta_model(ROBOT, PAYLOAD)
    with pytest.raises(Infeasible, match=r"of motor 1 is 0\.3\d* m, where at most 0\.356 m"):
        deltaopt.plan(Scene(**given | {"goal": (0.8, 0.0, 0.0)}))


def test_a_machine_without_a_model_is_refused():
    with pytest.raises(TypeError, match="of which there is no model"):
        new_model(Nameless(), None)


class Nameless(Machine):
    name: str = "nameless"
