"""Inverse dynamics of the Delta with Pinocchio and with MuJoCo, one point at a time from Python.

Neither has a function for it: both know trees. So their inverse dynamics is taken of the open tree,
the platform on three slides and three chains of three hinges, and the loops are closed by what is
left: a chain's Jacobian at its end passes the joint forces that no motor takes to the platform.
Both are given all coordinates and their derivatives, as ``DeltaModel.joint_inverse_dynamics`` is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import installed
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.robot import Robot

Peer = Callable[[Array, Array, Array], Array]
"""(q, q̇, q̈), 12 each, with the bars' angle relative to the arm -> result."""


def relative(q: Array) -> Array:
    """Coordinates of the trees, (N, 12), of the paper's: a hinge turns relative to the last."""
    turned = q.copy()
    turned[:, 4::3] -= q[:, 3::3]
    return turned


def pinocchio_tree(robot: Robot, payload: float) -> Peer:
    """One recursive Newton-Euler pass over the open tree: 12 joint forces, no torques yet."""
    pin, model, _ = _pinocchio(robot, payload)
    data = model.createData()
    result: Peer = lambda q, v, a: pin.rnea(model, data, q, v, a)  # noqa: E731
    return result


def pinocchio_torques(robot: Robot, payload: float) -> Peer:
    """Torques: the pass over the open tree, frame Jacobians, and the loops closed in NumPy."""
    pin, model, tips = _pinocchio(robot, payload)
    data = model.createData()
    world = pin.LOCAL_WORLD_ALIGNED

    def torques(q: Array, v: Array, a: Array) -> Array:
        forces = pin.rnea(model, data, q, v, a)
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = [pin.getFrameJacobian(model, data, tip, world)[:3] for tip in tips]
        return closed_loops(forces, J)

    return torques


def mujoco_torques(robot: Robot, payload: float) -> Peer:
    """Torques: mj_inverse of the open tree, site Jacobians, and the loops closed in NumPy.

    MuJoCo's own way to close loops, equality constraints, is no inverse dynamics of a closed chain:
    they are soft, and forces appear in all twelve joints.
    """
    mujoco = installed("mujoco", "studies")
    model = mujoco.MjModel.from_xml_string(mjcf(robot, payload))
    data = mujoco.MjData(model)
    J = np.zeros((3, 3, model.nv))

    def torques(q: Array, v: Array, a: Array) -> Array:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        for k in range(3):
            mujoco.mj_jacSite(model, data, J[k], None, k)
        return closed_loops(data.qfrc_inverse, list(J))

    return torques


def closed_loops(forces: Array, J: list[Array]) -> Array:
    """Motor torques, 3, N·m, of 12 joint forces of the open tree, and the Jacobians, 3 × 12, of the
    ends of its chains."""
    blocks = np.stack([J[k][:, 3 + 3 * k : 6 + 3 * k].T for k in range(3)])
    inverses = np.linalg.inv(blocks)  # joint forces of a chain -> force at its end
    passed = np.einsum("kij,kj->i", inverses, forces[3:].reshape(3, 3))
    result: Array = np.linalg.solve(inverses[:, :, 0].T, forces[:3] + passed)
    return result


def _pinocchio(robot: Robot, payload: float) -> tuple[Any, Any, list[int]]:
    """The package, the open tree in the paper's base frame, and the frames at the chains' ends."""
    pin = installed("pinocchio", "studies")
    model, identity = pin.Model(), pin.SE3.Identity()
    model.gravity.linear = np.array(_gravity(robot))
    arm, bars = robot.upper_arm, robot.forearm
    platform = model.addJoint(0, pin.JointModelTranslation(), identity, "platform")
    mass = robot.platform.mass + payload
    model.appendBodyToJoint(platform, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), identity)
    tips = []
    for k, azimuth in enumerate(AZIMUTHS):
        turn = pin.utils.rotate("x", azimuth)
        place = pin.SE3(turn, turn @ np.array([0.0, robot.base_radius, 0.0]))
        first = model.addJoint(0, pin.JointModelRZ(), place, f"arm {k}")
        model.appendBodyToJoint(first, _pinocchio_bar(pin, arm.mass, arm.length), identity)
        elbow = pin.SE3(np.eye(3), np.array([0.0, arm.length, 0.0]))
        second = model.addJoint(first, pin.JointModelRZ(), elbow, f"bars {k}")
        third = model.addJoint(second, pin.JointModelRX(), identity, f"sideways {k}")
        model.appendBodyToJoint(third, _pinocchio_bar(pin, bars.mass, bars.length), identity)
        end = pin.SE3(np.eye(3), np.array([0.0, bars.length, 0.0]))
        tips.append(model.addFrame(pin.Frame(f"tip {k}", third, end, pin.FrameType.OP_FRAME)))
    return pin, model, tips


def _pinocchio_bar(pin: Any, mass: float, length: float) -> Any:
    moment = mass * length**2 / 12
    return pin.Inertia(mass, np.array([0, length / 2, 0]), np.diag([moment, 0.0, moment]))


def mjcf(robot: Robot, payload: float) -> str:
    """The open tree in MuJoCo's format, in the paper's base frame: x down."""
    chains = "\n".join(_mjcf_chain(robot, k, azimuth) for k, azimuth in enumerate(AZIMUTHS))
    gravity = " ".join(map(str, _gravity(robot)))
    return f"""<mujoco><option gravity="{gravity}"/><worldbody>
<body name="platform">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/>
<inertial mass="{robot.platform.mass + payload}" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/></body>
{chains}
</worldbody></mujoco>"""


def _gravity(robot: Robot) -> tuple[float, float, float]:
    return robot.gravity if isinstance(robot.gravity, tuple) else (robot.gravity, 0.0, 0.0)


def _mjcf_chain(robot: Robot, k: int, azimuth: float) -> str:
    arm, bars = robot.upper_arm, robot.forearm
    y, z = robot.base_radius * np.cos(azimuth), robot.base_radius * np.sin(azimuth)
    return f"""<body pos="0 {y} {z}" quat="{np.cos(azimuth / 2)} {np.sin(azimuth / 2)} 0 0">
<joint axis="0 0 1"/>{_mjcf_bar(arm.mass, arm.length)}
<body pos="0 {arm.length} 0"><joint axis="0 0 1"/><joint axis="1 0 0"/>
{_mjcf_bar(bars.mass, bars.length)}<site name="tip{k}" pos="0 {bars.length} 0"/></body></body>"""


def _mjcf_bar(mass: float, length: float) -> str:
    """A slender bar; MuJoCo wants some inertia about its axis."""
    moment = mass * length**2 / 12
    return (
        f'<inertial mass="{mass}" pos="0 {length / 2} 0" '
        f'diaginertia="{moment} {moment * 1e-12} {moment}"/>'
    )
