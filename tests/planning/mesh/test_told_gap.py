"""The gap that a plan tells, on moves where estimates fell short of the truth."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.robot.drive import Drive
from deltaopt.robot.robot import Forearm, Platform, Robot, UpperArm
from studies.problems import PROBLEMS

ROBOTS = PROBLEMS / "robots"
ORSINO = deltaopt.load_robot(ROBOTS / "orsino.yaml")
INDUSTRIAL = deltaopt.load_robot(ROBOTS / "industrial.yaml")
WITHOUT_SPEED_LIMIT = INDUSTRIAL.model_copy(update={"drive": Drive(torque=40.0)})
UNEQUAL = Robot(
    name="unequal motors",
    base_radius=0.15,
    platform_radius=0.1,
    upper_arm=UpperArm(length=0.3, mass=0.8),
    forearm=Forearm(length=0.55, mass=0.3),
    platform=Platform(mass=0.4),
    drive=Drive(torque=(12.0, 30.0, 20.0)),
)


@pytest.mark.parametrize(
    ("robot", "payload", "start", "goal", "tolerance"),
    [
        # A motor whose torque is at no limit in all of an interval: told 5.8e-4, true 9.6e-4.
        pytest.param(
            WITHOUT_SPEED_LIMIT,
            None,
            (0.5204352966477958, -0.013265958448678061, -0.6616489661603178),
            (0.5192126677973627, 0.45978660469283605, 0.24405665827485112),
            1e-3,
            id="switch in a long interval",
        ),
        # The same: told 5.8e-5, true 9.1e-5.
        pytest.param(
            UNEQUAL,
            None,
            (0.4392115510088418, 0.11159086270989416, 0.31915350750159677),
            (0.6513227445547054, -0.1768917089293185, 0.04044707978921669),
            1e-4,
            id="switch of an unequal motor",
        ),
        # The solver stopped in a flat valley, a limit of the position being held along it: told
        # 6.6e-4, true 7.3e-3, beyond the tolerance.
        pytest.param(
            ORSINO,
            1.0,
            (0.2686587766287196, 0.4502183244653497, 0.17994864329568516),
            (0.06251135912771291, -0.44858356427182283, -0.018627057491628407),
            1e-3,
            id="valley along a limit of the position",
        ),
        # The same without: told 4.9e-4, true 1.4e-3.
        pytest.param(
            UNEQUAL,
            1.0,
            (0.6589756886513596, -0.06272677165539442, 0.3973474088897302),
            (0.37498330873298574, -0.07933006566927514, 0.533015117917627),
            1e-3,
            id="valley",
        ),
    ],
)
def test_no_less_is_told_than_a_finer_plan_gains(robot, payload, start, goal, tolerance):
    scene = deltaopt.Scene(robot=robot, payload=payload, start=start, goal=goal)
    plan, finer = (deltaopt.plan(scene, tolerance=each) for each in (tolerance, tolerance / 10))
    assert plan.within_tolerance
    assert finer.within_tolerance
    assert 0 < plan.duration / finer.duration - 1 <= plan.gap


@pytest.mark.parametrize("azimuth", [0.0, 120.0])
def test_a_motion_between_places_of_a_plane_of_symmetry_is_as_good_as_one_beside_it(azimuth):
    """The best one leaves the plane by 60 mm, to either side. One that stays in it is stationary
    and 6.2e-4 longer, and was told a gap of 6.3e-5."""
    turn = np.deg2rad(azimuth)
    depths, outwards = np.array([0.904, 0.67]), np.array([-0.296, 0.274])
    ends = np.column_stack([depths, np.cos(turn) * outwards, np.sin(turn) * outwards])
    normal = np.array([0.0, -np.sin(turn), np.cos(turn)])
    durations = []
    for aside in (0.0, 1e-5):
        start, goal = (tuple(end) for end in ends + aside * normal)
        scene = deltaopt.Scene(robot=INDUSTRIAL, payload=3.0, start=start, goal=goal)
        plan = deltaopt.plan(scene, tolerance=1e-4)
        assert plan.within_tolerance
        durations.append(plan.duration)
    assert durations[0] <= durations[1] * (1 + 1e-4)
