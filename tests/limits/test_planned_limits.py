"""Plans within limits of drives, joints, workspace and load, against independent answers."""

from __future__ import annotations

from math import asinh, sqrt
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.errors import Infeasible, SceneError
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.output.facts import facts
from deltaopt.output.in_words import told
from deltaopt.planning.comparisons import straight_lines
from deltaopt.planning.first_motions.initial_motion import straight_line
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.way import Rotation

PICK = deltaopt.load_scene("problems/pick_and_place.yaml")
CROSS = deltaopt.load_scene("problems/industrial_cross.yaml")
DISTANCE = float(np.linalg.norm(np.subtract(PICK.goal, PICK.start)))
IPOPT = {"formulation": deltaopt.multiplier}


def changed(scene: Scene, limits: dict[str, float] | None = None, **keys: dict) -> Scene:
    """A scene with keys added to its robot's file and to its limits."""
    content = scene.robot.model_dump(exclude_none=True)
    for key, value in keys.items():
        content[key] = {**content.get(key, {}), **value}
    given = scene.limits.model_dump(exclude_none=True) if scene.limits else {}
    return Scene(
        robot=Robot.model_validate(content),
        payload=scene.payload,
        start=scene.start,
        goal=scene.goal,
        limits=deltaopt.Limits.model_validate(given | (limits or {})),
    )


def duration(scene: Scene, tolerance: float = 1e-3, **settings) -> float:
    """Of a plan, which is verified."""
    plan = deltaopt.plan(scene, tolerance=tolerance, **settings)
    verified = deltaopt.verify(scene, plan.trajectory)
    assert verified.ok, verified.failures()
    assert plan.gap <= tolerance
    return plan.duration


def root(function, low: float, high: float) -> float:
    """Where an increasing function is zero, by halving."""
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return (low + high) / 2


# Answers in closed form


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_platform_speed_on_a_line(tolerance):
    """T = d / v + v / a: full acceleration, full speed, full braking."""
    scene = changed(PICK, {"platform_speed": 1.0, "acceleration": 20.0})
    expected = DISTANCE / 1.0 + 1.0 / 20.0
    assert duration(scene, tolerance) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_specific_force_of_a_point_mass(tolerance):
    """With no other limit a(t) = g + f p / ‖p‖, p = (1 - 2 t / T, -c) in the plane of motion and
    gravity, by Pontryagin: c is such that no vertical speed is left, T such that the way is d."""
    f, g = 14.0, 9.81  # far below what the motors could do
    c = root(lambda c: c * asinh(1 / c) - g / f, 1e-6, 10.0)
    expected = 2 * sqrt(DISTANCE / (f * (sqrt(1 + c**2) - c**2 * asinh(1 / c))))
    scene = changed(PICK, {"specific_force": f})
    assert duration(scene, tolerance) == pytest.approx(expected, rel=tolerance)


def test_torque_that_falls_with_speed_on_the_axis():
    """Straight down the robot's axis all motors do the same: drive along the curve, then brake at
    peak torque. Both arcs are integrated by Runge's method and meet at one depth and speed."""
    scene = changed(PICK, drive={"torque_curve": [[0.0, 10.0], [15.0, 0.0]]})
    content = {"robot": scene.robot, "payload": 1.0, "start": (0.36, 0, 0), "goal": (0.5, 0, 0)}
    scene = Scene.model_validate(content)
    model = delta_model(scene.robot, 1.0)

    def acceleration(x: float, v: float, driving: bool) -> float:
        place, rate = np.array([x, 0, 0]), np.array([v, 0, 0])
        arm = model.motion(place, rate, np.zeros(3))[1][3]
        down = model.motion(place, np.array([1.0, 0, 0]), np.zeros(3))[1][3]  # dθ / dx
        torque = np.sign(down) * (10 - 10 / 15 * abs(arm) if driving else -10)
        return model.forward_dynamics(place, rate, np.full(3, torque))[0]

    def arc(x: float, driving: bool, h: float) -> np.ndarray:
        """Depth and speed from rest at a depth on, in steps of h; backwards where h < 0."""
        y, found = np.array([x, 0.0]), []
        while abs(y[0] - x) < 0.14:
            found.append(y)

            def rate(z):
                return np.array([z[1], acceleration(*z, driving)])

            k1 = rate(y)
            k2 = rate(y + h / 2 * k1)
            k3 = rate(y + h / 2 * k2)
            y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(y + h * k3))
        return np.array(found)

    h = 2e-3
    go, stop = arc(0.36, True, h), arc(0.5, False, -h)

    def at_speed(curve: np.ndarray, v: float) -> float:
        """Time since rest, by the cubic through four neighbours."""
        i = int(np.clip(np.searchsorted(curve[:, 1], v) - 2, 0, len(curve) - 4))
        return h * (i + float(_interpolated(curve[i : i + 4, 1], np.arange(4.0), v)))

    def depth(curve: np.ndarray, t: float) -> float:
        i = int(np.clip(t / h - 1, 0, len(curve) - 4))
        return float(_interpolated(np.arange(4.0), curve[i : i + 4, 0], t / h - i))

    def apart(v: float) -> float:
        return depth(go, at_speed(go, v)) - depth(stop, at_speed(stop, v))

    v = root(apart, 0.3, min(go[-1, 1], stop[-1, 1]))
    expected = at_speed(go, v) + at_speed(stop, v)
    plain = duration(scene.model_copy(update={"robot": PICK.robot}), 1e-4)
    found = duration(scene, 1e-5)
    assert found == pytest.approx(expected, rel=1e-5)
    assert found > 1.005 * plain


def _interpolated(x: np.ndarray, y: np.ndarray, at: float) -> float:
    """Lagrange's polynomial through four points."""
    weights = [np.prod([(at - x[j]) / (x[i] - x[j]) for j in range(4) if j != i]) for i in range(4)]
    return float(np.dot(weights, y))


# Limits of position

PLACED = changed(
    CROSS,
    joints={"arm": [-1.0, -0.30], "ball": 0.167},
    workspace={"depth": [0.80, 0.86], "radius": 0.154},
)
"""The best motion without limits of position rises to a depth of 0.785 m, and its arms to -0.27."""


def test_limits_of_position_in_two_formulations():
    free, best = duration(CROSS), duration(PLACED, 1e-5)
    assert best > free * 1.002
    assert duration(PLACED) == pytest.approx(best, rel=1e-3)
    assert duration(PLACED, **IPOPT) == pytest.approx(best, rel=1e-3)


def test_from_and_to_the_edge_of_the_workspace():
    """Start and goal are on it: there a motion has no room at all, and beside them little."""
    scene = changed(
        CROSS,
        joints={"arm": [-0.9256, -0.2], "ball": 0.5},
        workspace={"depth": [0.70, 0.85], "radius": 0.1525},
    )
    scene = changed(scene, joints={"arm": [_arms(scene).min(), -0.2]})
    assert duration(scene) == pytest.approx(duration(CROSS, 1e-5), rel=1e-3)


def _arms(scene: Scene) -> np.ndarray:
    model = delta_model(scene.robot, scene.payload)
    return model.inverse_kinematics(np.array([scene.start, scene.goal]))[:, 3::3]


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"joints": {"arm": [-0.3, 0.1]}}, "start: .* arm angle of motor 1 .* by joints.arm"),
        ({"joints": {"ball": 0.1}}, "goal: .* ball joint angle of chain 2 .* by joints.ball"),
        ({"workspace": {"depth": [0.5, 0.6]}}, "start: .* at least 0.5 m .* by workspace.depth"),
        ({"workspace": {"radius": 0.09}}, "goal: .* at most 0.09 m .* by workspace.radius"),
    ],
)
def test_an_end_out_of_bounds_is_refused_by_its_key(keys, sentence):
    with pytest.raises(Infeasible, match=sentence):
        deltaopt.plan(changed(PICK, **keys))


def test_a_line_beyond_a_limit_of_position_is_no_matter_of_speed():
    """The straight line between two points of a ring leaves it; no slowing changes that."""
    scene = changed(PICK, workspace={"depth": [0.449, 0.6]})
    line = straight_line(delta_model(scene.robot, 1.0), (0.45, -0.05, 0), (0.44, 0.1, 0), 1.0)
    assert safe_factor(problem_of(scene), line) == np.inf
    found = deltaopt.verify(scene, line)
    assert found.workspace_depth_excess > 0.1
    assert any("slowing it down does not help" in each for each in found.failures())
    lower = scene.model_copy(update={"start": (0.46, -0.3, 0.0), "goal": (0.46, 0.3, 0.0)})
    with pytest.raises(deltaopt.errors.DeltaOptError):
        deltaopt.baseline(changed(lower, workspace={"depth": [0.3, 0.5], "radius": 0.2}))


def test_specific_force_below_that_at_rest_is_refused():
    with pytest.raises(SceneError) as error:
        changed(PICK, {"specific_force": 9.0})
    assert error.value.key == "limits.specific_force"
    assert "9.81" in error.value.expected


# Slowing

FRICTION = {"viscous": 0.2, "coulomb": 1.0, "speed": 0.05}


@pytest.mark.parametrize("friction", [None, FRICTION], ids=["without friction", "with friction"])
def test_safe_factor_against_every_speed(friction):
    """The largest of 2,000 speeds at which all measures of a line are within their bounds."""
    drive = {"torque_curve": [[0.0, 10.0], [9.0, 4.0]]}
    scene = changed(
        PICK, {"specific_force": 30.0}, drive=drive | ({"friction": friction} if friction else {})
    )
    line = straight_line(delta_model(scene.robot, 1.0), scene.start, scene.goal, 0.1)

    def keeps(speed: float) -> bool:
        curves = limit_curves(problem_of(scene), line.slowed(1 / speed), np.linspace(0, 1, 801))
        return all(((c.lower <= c.values) & (c.values <= c.upper)).all() for c in curves)

    speeds = np.linspace(0.2, 1.0, 401)
    expected = max(speed for speed in speeds if keeps(speed))
    factor = safe_factor(problem_of(scene), line)
    assert expected <= 1 / factor + 1e-6
    assert 1 / factor < expected + 2.1e-3
    assert deltaopt.verify(scene, line.slowed(factor)).torque_at_speed_excess < 1e-9
    assert safe_factor(problem_of(scene), line, at_least=0.0) == pytest.approx(factor, rel=1e-9)
    assert safe_factor(problem_of(scene), line.slowed(factor)) == pytest.approx(1.0, rel=1e-9)


# A fourth axis


def test_rotation_takes_as_long_as_its_profile():
    """Full acceleration to the speed limit and back, or to the middle where that is not reached."""
    assert Rotation(angle=2.0, speed=10.0, acceleration=100.0).duration == pytest.approx(0.3)
    assert Rotation(angle=0.25, speed=10.0, acceleration=100.0).duration == pytest.approx(0.1)
    at_the_border = Rotation(angle=1.0, speed=10.0, acceleration=100.0)
    assert at_the_border.duration == pytest.approx(0.2)


def test_a_motion_waits_for_the_rotation():
    turning = {"angle": 2.0, "speed": 10.0, "acceleration": 100.0}
    scene = PICK.model_copy(update={"rotation": turning})
    fast = deltaopt.plan(PICK)
    plan = deltaopt.plan(scene)
    assert plan.duration == pytest.approx(0.3, rel=1e-12)
    assert plan.gap < 1e-12
    assert deltaopt.verify(scene, plan.trajectory).ok
    early = deltaopt.verify(scene, fast.trajectory)
    assert early.rotation_left == pytest.approx(0.3 - fast.duration)
    assert "before the fourth axis has turned" in early.failures()[0]
    assert straight_lines(scene) == {}  # the line takes as long
    said = list(told(facts(plan)))
    assert said[-1] == "limited by the rotation, which takes 0.300 s"
    assert not any("line" in line or "others may be better" in line for line in said)
    quick = PICK.model_copy(update={"rotation": turning | {"angle": 0.1}})
    assert deltaopt.plan(quick).duration == pytest.approx(fast.duration, rel=1e-12)
    assert straight_lines(quick) == straight_lines(PICK) != {}
    with pytest.raises(SceneError) as error:
        Scene.model_validate(
            {**PICK.model_dump(), "objective": "effort", "duration": 0.25, "rotation": turning}
        )
    assert error.value.key == "duration"


# Example scenes

EXAMPLES = {
    "drive_joints_workspace": {
        "torque at speed",
        "arm angle",
        "ball joint angle",
        "workspace depth",
        "workspace radius",
    },
    "platform_speed": {"platform speed"},
    "specific_force": {"specific force"},
    "rotation": set(),
    "parallel_singularity": {"distance to the parallel singularity"},
    "tilt_singularity": {"distance to the tilt of the platform"},
}
"""Scenes in problems/limits, and limits that they have and no other shipped scene."""


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_scene_has_its_limits(name):
    scene = deltaopt.load_scene(Path("problems/limits") / f"{name}.yaml")
    limits = {limit.name for limit in limits_of(scene).constraints.limits}
    assert limits >= EXAMPLES[name]
    assert (scene.rotation is not None) == (name == "rotation")
    check_feasible(scene)
