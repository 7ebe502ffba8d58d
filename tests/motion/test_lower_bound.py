"""The lower bound for every path: exact where that is known, and below whatever is driven."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from numpy.testing import assert_allclose

from deltaopt.errors import DeltaOptError
from deltaopt.motion.lower_bound import lower_bound, soonest
from deltaopt.planning.planner import Planner, plan
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.known_limits import Limits
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS

SHIPPED = [PROBLEMS / f"robots/{n}.yaml" for n in ("orsino", "industrial", "hornet_565", "rl5")]


def robot(**others) -> Robot:
    """A robot of the industrial one's proportions; ``others`` replace its keys."""
    content = {
        "name": "test",
        "base_radius": 0.2,
        "platform_radius": 0.045,
        "upper_arm": {"length": 0.235, "mass": 1.0},
        "forearm": {"length": 0.8, "mass": 0.4},
        "platform": {"mass": 0.5},
        "drive": {"torque": 40.0, "speed": 10.0},
    }
    return Robot(**{**content, **others})


VARIANTS = {
    "every term": robot(
        drive={
            "torque": [20.0, 40.0, 60.0],
            "speed": [8.0, 9.0, 5.0],
            "inertia": 0.02,
            "friction": {"viscous": 0.8, "coulomb": 3.0, "speed": 0.1},
        },
        gravity=[3.0, -8.0, 4.0],
        tool={"offset": [0.1, 0.02, 0.03], "mass": 0.4},
        elbow={"mass": 0.2},
    ),
    "unequal motors": robot(drive={"torque": [20.0, 40.0, 60.0], "speed": [8.0, 9.0, 5.0]}),
    "haptic": robot(
        base_radius=0.037,
        platform_radius=0.027,
        upper_arm={"length": 0.06, "mass": 0.02},
        forearm={"length": 0.103, "mass": 0.015},
        platform={"mass": 0.05},
        drive={"torque": 0.3, "speed": 30.0},
    ),
    "massless arms": robot(
        base_radius=0.0,
        platform_radius=0.0,
        upper_arm={"length": 0.25, "mass": 0.0},
        forearm={"length": 0.6, "mass": 0.0},
        gravity=0.0,
        drive={"torque": 15.0, "speed": 15.0},
    ),
}
VARIANTS |= {file.stem: load_robot(file) for file in SHIPPED}


@pytest.mark.parametrize("name", VARIANTS)
def test_no_plan_is_shorter(name):
    """Of six random moves each of robots of all kinds."""
    payload = 1.0 if name in ("orsino", "industrial", "unequal motors") else None
    planner = Planner(VARIANTS[name], payload, tolerance=1e-2)
    planned = 0
    for scene in random_scenes(planner.robot, payload, 6, 7):
        bound = lower_bound(scene)
        assert bound > 0
        try:
            found = planner.plan(scene.start, scene.goal)
        except DeltaOptError:
            continue
        planned += 1
        assert bound < found.duration
    assert planned >= 5


@pytest.mark.parametrize(
    "name",
    [
        "industrial_cross",
        "industrial_drive",
        "light_and_fast",
        "long_diagonal",
        "pick_and_place",
    ],
)
def test_half_of_the_duration_on_shipped_scenes(name):
    found = plan(load_scene(PROBLEMS / f"{name}.yaml"))
    assert 0.5 < found.lower_bound / found.duration < 1


HEAVY = {"torque": 40.0, "inertia": 5.0}


def heavy_drives(**drive) -> Robot:
    """A robot of which nothing but the rotors has a noticeable mass: three double integrators."""
    return robot(
        upper_arm={"length": 0.235, "mass": 0.0},
        forearm={"length": 0.8, "mass": 0.0},
        platform={"mass": 1e-9},
        gravity=0.0,
        drive={**HEAVY, **drive},
    )


def straight_down(robot: Robot) -> tuple[Scene, float]:
    """A move along the robot's axis, in which all arms turn by the same angle, and that angle."""
    scene = Scene(robot=robot, start=(0.55, 0.0, 0.0), goal=(0.75, 0.0, 0.0))
    start, goal = delta_model(robot, None).inverse_kinematics([scene.start, scene.goal])[:, 3]
    return scene, abs(goal - start)


def test_exact_for_three_equal_double_integrators():
    """Full torque half the way and against it the other half: T = 2 √(Δθ I / τ)."""
    scene, angle = straight_down(heavy_drives())
    assert_allclose(lower_bound(scene), 2 * sqrt(angle * 5.0 / 40.0), rtol=1e-6)


def test_the_soonest_that_a_place_is_passed_is_exact_for_them():
    """Full torque all the way: T = √(2 Δθ I / τ)."""
    scene, angle = straight_down(heavy_drives())
    assert_allclose(soonest(scene, scene.goal), sqrt(2 * angle * 5.0 / 40.0), rtol=1e-6)


def test_no_time_to_where_the_platform_is():
    """As from a stop to a run-up that begins there; all bounds divide by the way."""
    scene, _ = straight_down(heavy_drives())
    assert soonest(scene, scene.start) == 0.0
    x, y, z = scene.start
    for goal in (scene.start, (x, y, z + 1e-20)):  # which turns no motor
        assert lower_bound(scene.model_copy(update={"goal": goal})) == 0.0


@pytest.mark.parametrize("name", ["every term", "unequal motors", "rl5"])
def test_no_plan_passes_a_place_sooner(name):
    """Of places at which plans from rest pass at the speed that they have there."""
    planner = Planner(VARIANTS[name], tolerance=1e-2)
    for scene in random_scenes(planner.robot, None, 4, 7):
        found = planner.plan(scene.start, scene.goal).trajectory
        for share in (0.2, 0.5, 0.8):
            t = share * found.duration
            place = tuple(found(t).x.tolist())
            assert 0.0 < soonest(scene, place) < t


def test_exact_with_a_speed_limit():
    """T = Δθ / ω + ω I / τ, where the limit is reached."""
    scene, angle = straight_down(heavy_drives(speed=1.2))
    assert angle > 1.2**2 * 5.0 / 40.0
    assert_allclose(lower_bound(scene), angle / 1.2 + 1.2 * 5.0 / 40.0, rtol=1e-6)


def test_exact_with_coulomb_friction_against_which_braking_is_faster():
    """Friction of no effect on the way up: the bound leaves it out there, so that it is what a
    drive with torque τ to accelerate and τ + c to brake needs: √(2 Δθ I (1/τ + 1/(τ + c)))."""
    scene, angle = straight_down(heavy_drives(friction={"coulomb": 10.0, "speed": 0.01}))
    exact = sqrt(2 * angle * 5.0 * (1 / 40.0 + 1 / 50.0))
    assert_allclose(lower_bound(scene), exact, rtol=1e-6)


def test_exact_for_a_limit_on_acceleration():
    """T = 2 √(d / A) of a point that may accelerate by A."""
    scene = Scene(
        robot=robot(),
        start=(0.6, -0.1, 0.0),
        goal=(0.6, 0.1, 0.0),
        limits=Limits(acceleration=1.0),
    )
    assert_allclose(lower_bound(scene), 2 * sqrt(0.2), rtol=1e-12)


def test_a_point_mass_that_power_alone_drives():
    """Arms without inertia: motors of power P give a mass m the energy P t, so that it covers
    (4 / 3) √(2 P / m) (T / 2)^(3/2) in a time T."""
    massless = VARIANTS["massless arms"]
    scene = Scene(robot=massless, start=(0.5, -0.3, 0.0), goal=(0.5, 0.3, 0.0))
    bound, power = lower_bound(scene), 3 * 15.0 * 15.0
    covered = 4 / 3 * sqrt(2 * power / 0.5) * (bound / 2) ** 1.5
    assert covered > 0.6 * (1 - 1e-9)


def test_more_torque_and_speed_lower_it_and_payload_raises_it():
    scenes = [load_scene(PROBLEMS / "industrial_cross.yaml")]
    drive = scenes[0].robot.drive
    stronger = drive.model_copy(update={"torque": 1.5 * np.max(drive.torque)})
    more = scenes[0].robot.model_copy(update={"drive": stronger})
    assert lower_bound(scenes[0].model_copy(update={"robot": more})) < lower_bound(scenes[0])
    heavier = scenes[0].model_copy(update={"payload": 3.0})
    assert lower_bound(heavier) > lower_bound(scenes[0])
    tighter = scenes[0].model_copy(update={"limits": Limits(torque=20.0)})
    assert lower_bound(tighter) > lower_bound(scenes[0])


def extremal(work, progress, steps):
    """The largest ∫ v (p·n) dt over |n| ≤ 1 with v' = c·n, v(0) = 0, in one unit of time, by the
    largest eigenvalue of the quadratic form on steps: another way than the proof's."""
    h = 1 / steps
    before = np.tril(np.ones((steps, steps)), -1) + np.eye(steps) / 2
    form = h * h * np.einsum("ij,a,b->iajb", before, progress, work).reshape(2 * steps, -1)
    return np.linalg.eigvalsh((form + form.T) / 2)[-1] / h


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2, np.pi / 2, 2.4])
def test_the_inequality_behind_it(angle):
    """At most c |p| sin φ / (2 φ), φ the angle between c and p (docs/dev/lower-bound.md)."""
    work, progress = np.array([1.7, 0.0]), np.array([np.cos(angle), np.sin(angle)])
    assert_allclose(extremal(work, progress, 150), 1.7 * np.sinc(angle / np.pi) / 2, rtol=1e-4)
