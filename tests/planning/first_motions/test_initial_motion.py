"""The straight line: its torques against the reference, its duration, its power balance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deltaopt.errors import Infeasible, Unreachable
from deltaopt.motion.time_scaling import highest_rows
from deltaopt.planning.first_motions.initial_motion import baseline, straight_line
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify

ROOT = Path(__file__).parents[3]
ORSINO = load_robot(ROOT / "problems/robots/orsino.yaml")
SCENES = [load_scene(ROOT / f"problems/{n}.yaml") for n in ("pick_and_place", "industrial_cross")]
LINE = np.load(Path(__file__).parents[2] / "data/line_paper.npz")


def reference_line():
    model = DeltaModel(ORSINO, payload=1.0)
    return straight_line(model, tuple(LINE["x"][0]), tuple(LINE["x"][-1]), float(LINE["duration"]))


def test_motion_of_the_reference():
    motion = reference_line()(LINE["t"])
    np.testing.assert_allclose(motion.x, LINE["x"], atol=1e-15)
    np.testing.assert_allclose(motion.v, LINE["xd"], atol=1e-14)
    np.testing.assert_allclose(motion.a, LINE["xdd"], atol=1e-13)


def test_torques_of_the_reference():
    error = np.linalg.norm(reference_line()(LINE["t"]).tau - LINE["tau"], axis=1)
    scale = np.linalg.norm(LINE["tau"], axis=1)
    assert (error / scale < 1e-12 * (1 + LINE["cond"])).all()


def energy(model: DeltaModel, motion):
    """Kinetic and potential energy, (N,) J, from the speeds of the ends of slender bars.

    A bar whose ends move at u and w has the kinetic energy m (u·u + u·w + w·w) / 6.
    """
    robot, payload = model.robot, model.payload or 0.0
    arm, bars = robot.upper_arm, robot.forearm
    mass = robot.platform.mass + payload

    def dot(u, w):
        return np.einsum("ni,ni->n", u, w)

    kinetic, drop = mass * dot(motion.v, motion.v) / 2, mass * motion.x[:, 0]
    for k, azimuth in enumerate(2 * np.pi / 3 * np.array([0, 1, -1])):
        s, c = np.sin(motion.theta[:, k]), np.cos(motion.theta[:, k])
        speed = arm.length * motion.dtheta[:, k]
        elbow = np.stack([-c, -s * np.cos(azimuth), -s * np.sin(azimuth)], 1) * speed[:, None]
        kinetic += arm.mass * dot(elbow, elbow) / 6
        ends = dot(elbow, elbow) + dot(elbow, motion.v) + dot(motion.v, motion.v)
        kinetic += bars.mass * ends / 6
        elbow_drop = -arm.length * s
        drop += arm.mass * elbow_drop / 2 + bars.mass * (elbow_drop + motion.x[:, 0]) / 2
    return kinetic, -robot.gravity * drop


@pytest.mark.parametrize("scene", SCENES, ids=["orsino", "industrial"])
def test_power_balance(scene):
    """What the motors do, ∫ τ·θ̇ dt, is what the energies gain, between any two instants."""
    line = baseline(scene)
    instants = np.linspace(0, line.duration, 41)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = line.duration / 80
    motion = line(((instants[:-1] + half)[:, None] + half * nodes).ravel())
    power = np.einsum("nk,nk->n", motion.tau, motion.dtheta).reshape(40, 12)
    total = sum(energy(line.model, line(instants)))
    assert np.abs(power @ weights * half - np.diff(total)).max() < 1e-12 * np.ptp(total)


@pytest.mark.parametrize("scene", SCENES, ids=["orsino", "industrial"])
def test_duration_touches_the_limit(scene):
    line = baseline(scene)
    tau = line(np.linspace(0, line.duration, 8_001)).tau
    most = (np.abs(tau) / limits_of(scene).upper("torque")).max()
    assert 1 - 1e-6 < most <= 1 + 1e-12
    assert highest_rows(problem_of(scene), line.slowed(0.999)).values.max() - 1 > 1e-3


AROUND_THE_TOP = Scene(
    robot=ORSINO, payload=1.0, start=(0.22, 0.442, -0.135), goal=(0.163, 0.129, 0.427)
)
"""Both ends are in reach, and the middle of the line is too high for folded arms."""


def test_line_out_of_the_workspace():
    check_feasible(AROUND_THE_TOP)
    with pytest.raises(Unreachable, match=r"the straight line from start to goal: .*chain"):
        baseline(AROUND_THE_TOP)


def test_detour():
    """It is a motion like any other, and touches a limit."""
    around = first_motion(AROUND_THE_TOP)
    found = verify(AROUND_THE_TOP, around)
    assert found.failures() == []
    assert abs(found.torque_excess) < 1e-9


def test_gravity_alone_on_the_line():
    """The ends can be held, a point of the line between them cannot."""
    scene = Scene(
        robot=ORSINO, payload=1.0, start=(0.505, -0.137, -0.17), goal=(0.114, -0.337, 0.383)
    )
    check_feasible(scene)
    with pytest.raises(Infeasible, match="gravity alone"):
        baseline(scene)
