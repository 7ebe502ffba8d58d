"""A robot's kinematics and dynamics, and plans with a player, as C for a controller.

The code is plain C99 without allocation, and of the C library it needs sin, cos, sqrt and atan2
alone. What does not depend on the robot stands in ``c_templates``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from string import Template

import casadi as ca
import numpy as np

from deltaopt.codegen.simd_c import c_function
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.mechanism import SX
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.files.output_folder import write_texts
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.boundary import REST
from deltaopt.robot.joints import Joints
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, as_delta


def export_c(robot: Robot, directory: Path) -> list[Path]:
    """Write delta.h, delta.c and test_delta.c into a directory, made if need be.

    Returns their paths. All of them appear there at once, or none. Raises OSError, naming the file,
    if one cannot be written.
    """
    return write_texts(directory, _model_texts(robot) | {"test_delta.c": program(robot)})


def export_plan_c(
    trajectory: Trajectory, directory: Path, remarks: Sequence[str] = ()
) -> list[Path]:
    """Write the C code of a trajectory's robot, with plan.h and plan.c: the motion for the player,
    after comments with ``remarks``.

    ``trajectory``: whose coordinates follow from the platform's position. Raises OSError.
    """
    robot, position = as_delta(trajectory.model.robot), trajectory.position
    pieces, powers, _ = position.coefficients.shape
    header = _filled(
        "plan.h",
        name=_in_comment(robot.name),
        begin=repr(float(position.knots[0])),
        end=repr(float(position.knots[-1])),
    )
    data = _filled(
        "plan.c",
        pieces=pieces,
        powers=powers,
        knots_number=pieces + 1,
        knots=",\n".join(f"    {t!r}" for t in position.knots.tolist()),
        number=3 * pieces * powers,
        coefficients=",\n".join(f"    {_numbers(c)}" for c in position.coefficients.reshape(-1, 3)),
        payload=repr(float(trajectory.model.payload or 0.0)),
    )
    head = "".join(f"/* {remark} */\n" for remark in remarks)
    texts = {"plan.h": head + header, "plan.c": head + data}
    texts["test_delta.c"] = program(robot, trajectory)
    return write_texts(directory, _model_texts(robot) | texts)


def _model_texts(robot: Robot) -> dict[str, str]:
    header = _filled("delta.h", name=_in_comment(robot.name), joints=_joints(robot))
    return {"delta.h": header, "delta.c": source(robot)}


def _filled(file: str, **values: object) -> str:
    """A file of ``c_templates`` with values in place of ``${names}``."""
    text = (files("deltaopt.output") / "c_templates" / file).read_text(encoding="utf-8")
    return Template(text).substitute(values)


def _joints(robot: Robot) -> str:
    """A comment on how the controller's angles are counted, where the robot names that.

    The functions are in the model's angles, for a controller has its own place to scale encoders.
    """
    if robot.joints is None or robot.joints.zero is robot.joints.sign is None:
        return ""
    signs, zeros = robot.joints.signs.tolist(), robot.joints.zeros.tolist()
    rows = (
        f"\n     motor {k}: theta = {sign:+g} * angle - {zero!r}; speed, acceleration and torque "
        f"* {sign:+g}"
        for k, (sign, zero) in enumerate(zip(signs, zeros, strict=True), 1)
    )
    return "\n\n   This robot's controller counts its angles otherwise:" + "".join(rows)


def _in_comment(name: str) -> str:
    """A name that neither ends the comment that it stands in nor begins another."""
    return name.replace("*/", "* /").replace("/*", "/ *")


def source(robot: Robot) -> str:
    """The text of delta.c: the robot's numbers are constants, the payload is an argument."""
    joints = robot.joints or Joints()
    functions = [c_function(function, function.name()) for function in c_functions(robot)]
    return _filled(
        "delta.c",
        name=_in_comment(robot.name),
        zeros=_numbers(joints.zeros),
        signs=_numbers(joints.signs),
        functions="\n".join(functions),
    )


def c_functions(robot: Robot) -> list[ca.Function]:
    """Inverse and forward kinematics, the motion of the motors, inverse and forward dynamics.

    The last argument of the dynamics is the payload, kg.
    """
    model = DeltaModel(robot)
    functions, p = model.functions, SX(model.parameters)
    x, v, a, theta = (SX.sym(name, 3) for name in ("x", "v", "a", "theta"))
    payload = SX.sym("payload")
    p[functions.payload] = payload
    angles = functions.inverse_kinematics(x, p)[3::3]
    *_, speeds, accelerations = functions.explicit_equations(x, v, a, SX.zeros(3), p)
    position = functions.forward_kinematics(theta, p)
    tau, tau_given = functions.explicit_torques(x, v, a, p), SX.sym("tau", 3)
    acceleration = functions.explicit_acceleration(x, v, tau_given, p)  # both by eq. (39)
    return [
        ca.Function(name, inputs, results, {"cse": True})
        for name, inputs, results in (
            ("inverse_kinematics", [x], [angles]),
            ("forward_kinematics", [theta], [position]),
            ("joint_motion", [x, v, a], [angles, speeds, accelerations]),
            ("inverse_dynamics", [x, v, a, payload], [tau]),
            ("forward_dynamics", [x, v, tau_given, payload], [acceleration]),
        )
    ]


def program(robot: Robot, plan: Trajectory | None = None) -> str:
    """The text of test_delta.c: states near the middle of the workspace with the torques by virtual
    work there, and instants of a plan, to compare with."""
    payload = 0.2
    model = DeltaModel(robot, payload, VirtualWork())
    rng = np.random.default_rng(5)
    theta = rng.uniform(-0.4, 0.4, (20, 3))
    x = model.forward_kinematics(theta)
    v, a = rng.uniform(-2, 2, x.shape), rng.uniform(-50, 50, x.shape)
    _, dq, ddq = model.motion(x, v, a)
    rates = [dq[:, 3::3], ddq[:, 3::3]]
    angles = (robot.joints or Joints()).angle_to_controller(theta)
    rows = np.hstack([x, v, a, theta, *rates, model.inverse_dynamics(x, v, a), angles])
    return _filled(
        "test_delta.c",
        sources="" if plan is None else "plan.c ",
        header="delta.h" if plan is None else "plan.h",
        number=len(rows),
        payload=repr(payload),
        states=_braced(rows),
        played="" if plan is None else "\n" + _played(plan),
        play="" if plan is None else _filled("play.c"),
    )


def _played(plan: Trajectory) -> str:
    """Instants of a plan, its knots and some before and after it among them, where it rests."""
    begin, end = plan.knots[[0, -1]].tolist()
    plan = replace(plan, end_velocities=(REST, REST))
    inside = np.random.default_rng(6).uniform(begin, end, 100)
    t = np.concatenate([plan.knots, inside, [begin - 0.1, end + 0.1]])
    motion, joints = plan(t), plan.model.robot.joints or Joints()
    rates = (
        joints.rate_to_controller(each) for each in (motion.dtheta, motion.ddtheta, motion.tau)
    )
    rows = np.hstack([t[:, None], joints.angle_to_controller(motion.theta), *rates])
    return _filled("played.c", number=len(rows), rows=_braced(rows))


def _braced(rows: Array) -> str:
    return ",\n".join(f"    {{{_numbers(row)}}}" for row in rows)


def _numbers(row: Array) -> str:
    return ", ".join(map(repr, row.tolist()))
