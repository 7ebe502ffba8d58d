"""Terms that the paper's Delta does not have, against a mechanism with a body for each of them.

The package joins what is rigidly connected: elbow and drive to the arm, pins and tool to the
platform. Here every one is a body of its own, with its own kinetic and potential energy.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Body, Effort, Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, load_robot
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS

ROBOTS = PROBLEMS / "robots"
PLAIN = load_robot(ROBOTS / "industrial.yaml")
PAYLOAD = 0.7
ARM = PLAIN.upper_arm.model_copy(update={"centre": (0.10, 0.012), "inertia": 6e-3})
DRIVE = PLAIN.drive.model_copy(
    update={"inertia": 0.02, "friction": {"viscous": 0.3, "coulomb": 2.0, "speed": 0.05}}
)
TERMS = {
    "centre of the arm's mass": {"upper_arm": ARM},
    "elbow": {"elbow": {"mass": 0.25}},
    "pins": {"platform": PLAIN.platform.model_copy(update={"pins": 0.1})},
    "tool": {"tool": {"offset": [0.12, 0.03, -0.02], "mass": 0.4}},
    "tilted gravity": {"gravity": (9.0, 2.5, -1.5)},
    "hanging from the floor": {"gravity": (-9.81, 0.0, 0.0)},
    "inertia of the drive": {"drive": DRIVE.model_copy(update={"friction": None})},
    "viscous friction": {
        "drive": PLAIN.drive.model_copy(update={"friction": {"viscous": 0.3}}),
    },
    "friction": {"drive": DRIVE.model_copy(update={"inertia": None})},
}
TERMS["all"] = {key: value for own in TERMS.values() for key, value in own.items()}
TERMS["all"] |= {"gravity": (9.0, 2.5, -1.5), "drive": DRIVE}
TERMS["all, bars not slender"] = TERMS["all"] | {
    "forearm": PLAIN.forearm.model_copy(update={"inertia": (2.4e-2, 1e-3, 2.3e-2)})
}
ALONE = ("tool", "hanging from the floor", "viscous friction", "friction")
"""What is in none of the others, or by itself in one of the tests below."""
ROBOT = {
    name: PLAIN.model_copy(update=terms)
    for name, terms in TERMS.items()
    if name in ALONE or name.startswith("all")
}


def by_bodies(robot: Robot) -> Mechanism:
    """The mechanism in twelve coordinates; x is the tool's point."""
    q, dq, tau = ca.SX.sym("q", 12), ca.SX.sym("dq", 12), ca.SX.sym("tau", 3)
    arm, bars, friction = robot.upper_arm, robot.forearm, robot.drive.friction
    offset = np.zeros(3) if robot.tool is None else np.array(robot.tool.offset)
    centre = q[:3] - offset
    slender = bars.mass * bars.length**2 / 12
    inertia = bars.inertia or (slender, 0.0, slender)
    bodies = [
        Body("platform", robot.platform.mass, centre),
        Body("payload", PAYLOAD, q[:3]),
    ]
    if robot.tool:
        bodies.append(Body("tool", robot.tool.mass, centre + 0.3 * offset))
    efforts, closures = [], []
    for k, azimuth in enumerate((0.0, 2 * pi / 3, -2 * pi / 3)):
        q1, q2, q3 = ca.vertsplit(q[3 + 3 * k : 6 + 3 * k])
        dq1, dq2, dq3 = ca.vertsplit(dq[3 + 3 * k : 6 + 3 * k])

        def place(down, outward, sideways, azimuth=azimuth):
            c, s = cos(azimuth), sin(azimuth)
            return ca.vertcat(down, c * outward - s * sideways, s * outward + c * sideways)

        def on_arm(along, across, q1=q1, place=place):
            out = robot.base_radius + along * ca.cos(q1) - across * ca.sin(q1)
            return place(-along * ca.sin(q1) - across * ca.cos(q1), out, 0)

        along, across = arm.centre or (arm.length / 2, 0.0)
        moment = arm.mass * arm.length**2 / 12 if arm.inertia is None else arm.inertia
        spin = ca.vertcat(0, 0, dq1)
        bodies.append(Body("arm", arm.mass, on_arm(along, across), [0, 0, moment], spin))
        if robot.elbow:
            bodies.append(Body("elbow", robot.elbow.mass, on_arm(arm.length, 0)))
        if robot.platform.pins:
            bodies.append(Body("pins", robot.platform.pins, centre))
        if robot.drive.inertia:
            rotor = [0, 0, robot.drive.inertia]
            bodies.append(Body("rotor and gear", 0, ca.SX.zeros(3), rotor, spin))
        bar = bars.length * place(-ca.cos(q3) * ca.sin(q2), ca.cos(q3) * ca.cos(q2), ca.sin(q3))
        omega = ca.vertcat(dq3, ca.sin(q3) * dq2, ca.cos(q3) * dq2)
        bodies.append(Body("bars", bars.mass, on_arm(arm.length, 0) + bar / 2, inertia, omega))
        efforts.append(Effort(tau[k], dq1))
        if friction:
            efforts.append(Effort(-friction.viscous * dq1, dq1))
        if friction and friction.coulomb:
            efforts.append(Effort(-friction.coulomb * ca.tanh(dq1 / friction.speed), dq1))
        attached = centre + place(0, robot.platform_radius, 0)
        closures.append(attached - on_arm(arm.length, 0) - bar)
    gravity = robot.gravity if isinstance(robot.gravity, tuple) else (robot.gravity, 0, 0)
    bodies = [
        replace(b, inertia=ca.SX(b.inertia) if isinstance(b.inertia, list | tuple) else b.inertia)
        for b in bodies
    ]
    return Mechanism(
        "delta by bodies",
        q,
        dq,
        tuple(bodies),
        tuple(efforts),
        tau,
        ca.vertcat(*closures),
        gravity=ca.SX(gravity),
    )


def states(robot: Robot):
    """x, v, a, (20, 3) each, as in fast motions; the last of them slow, where friction turns."""
    rng = np.random.default_rng(7)
    scenes = random_scenes(robot, PAYLOAD, 10, seed=7)
    x = np.array([point for scene in scenes for point in (scene.start, scene.goal)])
    v, a = (size * rng.normal(size=x.shape) for size in (2.0, 100.0))
    v[-5:] *= 1e-3
    return x, v, a


@pytest.mark.parametrize("name", ROBOT)
def test_bodies_joined_are_bodies_apart(name):
    """Torques and multipliers, the multipliers being the forces in the joints of the platform."""
    model, separate = DeltaModel(ROBOT[name], PAYLOAD), by_bodies(ROBOT[name])
    x, v, a = states(ROBOT[name])
    inverse = Multiplier().inverse_dynamics(separate)
    motion = model.motion(x, v, a)
    expected = [np.array(r).T for r in inverse(0, *(m.T for m in motion), [])]
    for found, right in zip(
        (model.inverse_dynamics(x, v, a), model.multipliers(x, v, a)), expected, strict=True
    ):
        np.testing.assert_allclose(found, right, rtol=0, atol=1e-12 * np.abs(right).max())
    joints = model.joint_inverse_dynamics(*motion)
    np.testing.assert_allclose(joints, expected[0], rtol=0, atol=1e-12 * np.abs(expected[0]).max())


@pytest.mark.parametrize("name", ROBOT)
def test_power_of_the_motors_is_rate_of_energy_and_losses(name):
    robot = ROBOT[name]
    model, m = DeltaModel(robot, PAYLOAD), by_bodies(robot)
    x, v, a = states(robot)
    q, dq, ddq = model.motion(x, v, a)
    rate = ca.Function("rate", [m.q, m.dq, m.ddq], [m.rate_of_change(m.T + m.V)])
    speed, losses = dq[:, 3::3], 0.0
    if friction := robot.drive.friction:
        torque = friction.viscous * speed
        if friction.coulomb:
            torque = torque + friction.coulomb * np.tanh(speed / friction.speed)
        assert (torque * speed >= 0).all()
        losses = (torque * speed).sum(axis=1)
    power = (model.inverse_dynamics(x, v, a) * speed).sum(axis=1)
    expected = np.array(rate(q.T, dq.T, ddq.T)).ravel() + losses
    np.testing.assert_allclose(power, expected, rtol=0, atol=1e-12 * np.abs(power).max())


@pytest.mark.parametrize("name", ["all", "all, bars not slender"])
def test_four_formulations_agree_and_are_inverted(name):
    model = DeltaModel(ROBOT[name], PAYLOAD)
    x, v, a = states(ROBOT[name])
    torque = model.inverse_dynamics(x, v, a)
    for formulation in (Explicit(), Multiplier(), VirtualWork(), Kane()):
        functions = delta_functions(model.functions.terms, formulation)
        p = model.parameters
        found, _ = evaluate_rows(functions.inverse_dynamics, x, v, a, parameters=p)
        assert np.abs(found - torque).max() < 1e-12 * np.abs(torque).max()
        (back,) = evaluate_rows(functions.forward_dynamics, x, v, torque, parameters=p)
        assert np.abs(back - a).max() < 1e-12 * np.abs(a).max()
    np.testing.assert_allclose(model.forward_dynamics(x, v, torque), a, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("name", ["tool", "all"])
def test_forward_kinematics_gives_the_tools_point(name):
    model = DeltaModel(ROBOT[name], PAYLOAD)
    x, _, _ = states(ROBOT[name])
    theta = model.inverse_kinematics(x)[:, 3::3]
    np.testing.assert_allclose(model.forward_kinematics(theta), x, atol=1e-12)
    angles = DeltaModel(PLAIN, PAYLOAD).inverse_kinematics(x - ROBOT[name].tool_offset)[:, 3:]
    np.testing.assert_allclose(model.inverse_kinematics(x)[:, 3:], angles, atol=1e-13)
