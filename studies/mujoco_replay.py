"""Plans in MuJoCo, whose bodies and joints know nothing of this package's equations.

First the torques of random fast motions: MuJoCo's masses, forces and the Jacobian of its joints
give the torques that these motions need, and the difference to inverse dynamics is printed. Then a
verified plan is replayed: its torques, nothing else, drive the robot in MuJoCo, and the miss at the
goal is printed for ever shorter steps. Coulomb friction is applied from outside, for MuJoCo's own
is not tanh (θ̇ / w). Last the same for a plan of a robot without the terms that the paper's model
does not have, replayed on the robot that has them.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from math import ceil
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.cli.arguments import positive
from deltaopt.compare.model_terms import MODEL_TERMS
from deltaopt.curves.piecewise import Array
from deltaopt.output.mujoco_replay import InMujoco, of_joints
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.task import given_points
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS

HELP = "torques and open-loop replay against MuJoCo"
SMALL: Mapping[str, object] = {"steps": (1e-3, 5e-4), "states": 5}

BEYOND_THE_PAPER = {
    "drive.inertia",
    "drive.friction.viscous",
    "drive.friction.coulomb",
    "upper_arm.centre",
    "elbow.mass",
    "platform.pins",
}


def torques(there: InMujoco, q: Array, dq: Array, ddq: Array) -> Array:
    """Motor torques, (3,), N·m, that a motion of the twelve coordinates needs in MuJoCo.

    MuJoCo's forces on all 21 coordinates are what the three motors and eighteen forces in the
    joints of the platform must give together.
    """
    data, model = there.data, there.model
    there.put(q, dq)
    data.qacc[:3] = ddq[:3]
    for k in range(3):
        data.qacc[6 + 5 * k : 11 + 5 * k] = of_joints(ddq[3 + 3 * k : 6 + 3 * k])
    acceleration = np.array(data.qacc)
    there.mujoco.mj_forward(model, data)
    force = np.zeros(model.nv)
    there.mujoco.mj_mulM(model, data, force, acceleration)
    force += data.qfrc_bias - data.qfrc_passive
    joints = np.array(data.efc_J).reshape(data.nefc, model.nv)
    shafts = np.eye(model.nv)[6::5]
    share, *_ = np.linalg.lstsq(np.vstack([shafts, joints]).T, force, rcond=None)
    return np.asarray(share[:3] + there.coulomb(dq[3::3]))


def torque_difference(robot: Robot, payload: float, states: int) -> float:
    """Largest difference of torques in random fast motions, as a share of the largest torque."""
    rng = np.random.default_rng(5)
    model, found = DeltaModel(robot, payload), []
    for scene in random_scenes(robot, payload, states, seed=5):
        v, a = 2.0 * rng.normal(size=3), 100.0 * rng.normal(size=3)
        start, goal = given_points(scene.task)
        there = InMujoco.of(robot, payload, start)
        other = torques(there, *model.motion(goal, v, a))
        found.append((other, model.inverse_dynamics(goal, v, a)))
    theirs, ours = (np.array(each) for each in zip(*found, strict=True))
    return float(np.abs(theirs - ours).max() / np.abs(ours).max())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "scene", nargs="?", type=Path, default=PROBLEMS / "industrial_drive.yaml", help="scene file"
    )
    parser.add_argument(
        "--steps",
        nargs="+",
        type=positive,
        default=(1e-4, 5e-5, 2e-5, 1e-5),
        metavar="S",
        help="of MuJoCo's integrator, s (default: %(default)s)",
    )
    parser.add_argument(
        "--states", type=int, default=50, metavar="N", help="random motions (default: 50)"
    )


def run(arguments: argparse.Namespace) -> int:
    scene = deltaopt.load_scene(arguments.scene)
    robot = as_delta(scene.robot)
    difference = torque_difference(robot, scene.payload or 0.0, arguments.states)
    print(f"{robot.name}: torques of {arguments.states} motions differ by {difference:.1e}")
    simple = scene.model_copy(update={"robot": without_terms(robot)})
    actual = InMujoco.of(robot, scene.payload, given_points(scene.task)[0])
    for name, planned in (("all terms", scene), ("terms left out", simple)):
        motion = deltaopt.plan(planned).trajectory
        for step in arguments.steps:
            miss = actual.miss(motion, ceil(motion.duration / step))
            print(
                f"  planned with {name}, steps of {1e6 * step:g} µs: misses by {1e3 * miss:.3f} mm"
            )
    return 0


def without_terms(robot: Robot) -> Robot:
    """The robot as the paper's model has it: without elbow, pins, drive inertia and friction, and
    with the arm's centre of mass in its middle. The tool stays."""
    for term in MODEL_TERMS:
        if term.name in BEYOND_THE_PAPER:
            robot = term.without(robot)
    return robot
