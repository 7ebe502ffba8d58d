"""Other programs on the same model and tasks: rockit, Pinocchio and MuJoCo, where installed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.errors import MissingPackage
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.motion.trajectory import Array
from deltaopt.output.controller_c import c_functions
from deltaopt.planning.planner import Plan, Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene


def installed(package: str) -> Any:
    """The module. Raises MissingPackage."""
    try:
        return __import__(package)
    except ImportError:
        raise MissingPackage(f"{package} is not installed: pip install deltaopt[bench]") from None


# Planning


@dataclass(frozen=True)
class PeerPlan:
    """A duration and the seconds of the solve alone, the program being built already."""

    duration: float
    seconds: float
    intervals: int
    solved: bool


def rockit_plan(scene: Scene, guess: Plan, intervals: int) -> PeerPlan:
    """The scene by rockit's multiple shooting, torques constant in an interval, Ipopt.

    ``guess``: what rockit begins from, already a solution: it gets all the help there is.
    """
    rockit = installed("rockit")
    model = DeltaModel(scene.robot, scene.payload)
    forward = c_functions(scene.robot)[-1]
    problem = rockit.Ocp(T=rockit.FreeTime(guess.duration))
    x, v, tau = problem.state(3), problem.state(3), problem.control(3)
    limit = np.array(scene.torque_limits)
    problem.set_der(x, v)
    problem.set_der(v, forward(x, v, tau * limit, scene.payload or 0.0))
    problem.subject_to((tau <= 1) >= -1)
    problem.subject_to(problem.at_t0(x) == scene.start)
    problem.subject_to(problem.at_tf(x) == scene.goal)
    problem.subject_to(problem.at_t0(v) == 0)
    problem.subject_to(problem.at_tf(v) == 0)
    if scene.speed_limits is not None:
        dtheta = _motor_speed(model)(x, v) / np.array(scene.speed_limits)
        problem.subject_to((dtheta <= 1) >= -1, include_last=False)
    problem.add_objective(problem.T)
    _start_from(problem, (x, v, tau), guess, intervals, limit)
    options = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "expand": True,
        "show_eval_warnings": False,
    }
    problem.solver("ipopt", options)
    problem.method(rockit.MultipleShooting(N=intervals, M=1, intg="rk"))
    return _timed(problem, intervals)


def rockit_within(scene: Scene, ours: Plan, best: float, tolerance: float) -> PeerPlan | None:
    """The coarsest of rockit's grids whose duration is within a tolerance of the best known."""
    for intervals in (20, 40, 80):
        found = rockit_plan(scene, ours, intervals)
        if found.solved and found.duration <= best * (1 + tolerance):
            return found
    return None


def rockit_comparison(robot: Robot, payload: float, number: int, seed: int) -> str:
    """Medians over random moves, both within 1e-3 of the best duration known."""
    planner = Planner(robot, payload)
    finer = replace(planner, tolerance=1e-4, intervals=40, resolved_below=0.0)
    ours, theirs, failed = [], [], 0
    for scene in random_scenes(robot, payload, number, seed):
        planner.plan(scene.start, scene.goal)
        begin = perf_counter()
        plan = planner.plan(scene.start, scene.goal)
        seconds = perf_counter() - begin
        best = finer.plan(scene.start, scene.goal, near=plan).duration
        found = rockit_within(scene, plan, best, 1e-3)
        if found is None:
            failed += 1
            continue
        ours.append(seconds)
        theirs.append(found.seconds)
    if not ours:
        return f"{robot.name}: rockit was within 1e-3 on none of {number} moves"
    ratio = np.median(np.array(theirs) / np.array(ours))
    return (
        f"{robot.name}: ours {1e3 * np.median(ours):.1f} ms, rockit with Ipopt "
        f"{1e3 * np.median(theirs):.0f} ms, median ratio {ratio:.0f}; rockit began at our "
        f"solution, and was not within 1e-3 with up to 80 intervals on {failed} of {number}"
    )


def _motor_speed(model: DeltaModel) -> ca.Function:
    """(x, v) -> θ̇."""
    x, v, rest = ca.SX.sym("x", 3), ca.SX.sym("v", 3), ca.SX.zeros(3)
    rows = model.functions.explicit_equations(x, v, rest, rest, model.parameters)
    return ca.Function("motor_speed", [x, v], [rows[2]])


def _start_from(problem: Any, variables: Any, guess: Plan, intervals: int, limit: Array) -> None:
    motion = guess.trajectory(np.linspace(0, guess.duration, intervals + 1))
    x, v, tau = variables
    problem.set_initial(x, motion.x.T)
    problem.set_initial(v, motion.v.T)
    problem.set_initial(tau, np.clip(motion.tau / limit, -0.9, 0.9)[:-1].T)


def _timed(problem: Any, intervals: int) -> PeerPlan:
    """The second of two solutions from the same start."""
    try:
        problem.solve()
        begin = perf_counter()
        solution = problem.solve()
        seconds = perf_counter() - begin
    except RuntimeError:
        return PeerPlan(np.nan, np.nan, intervals, False)
    return PeerPlan(float(solution.value(problem.T)), seconds, intervals, True)


# Inverse dynamics


def pinocchio_seconds(robot: Robot, payload: float, calls: int) -> float:
    """Of one recursive Newton-Euler pass over the open tree: a part of inverse dynamics."""
    pin = installed("pinocchio")
    model = pin.Model()
    _add_tree(pin, model, robot, payload)
    data = model.createData()
    q, v, a = (np.full(size, 0.1) for size in (model.nq, model.nv, model.nv))
    return _seconds(lambda: pin.rnea(model, data, q, v, a), calls)


def _add_tree(pin: Any, model: Any, robot: Robot, payload: float) -> None:
    """Platform on three slides, and three chains of three hinges: the paper's twelve."""
    arm, bars, identity = robot.upper_arm, robot.forearm, pin.SE3.Identity()
    platform = model.addJoint(0, pin.JointModelTranslation(), identity, "platform")
    mass = robot.platform.mass + payload
    model.appendBodyToJoint(platform, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), identity)
    for k, azimuth in enumerate(AZIMUTHS):
        place = pin.SE3(pin.utils.rotate("x", azimuth), np.zeros(3))
        first = model.addJoint(0, pin.JointModelRZ(), place, f"arm {k}")
        model.appendBodyToJoint(first, _bar(pin, arm.mass, arm.length), identity)
        elbow = pin.SE3(np.eye(3), np.array([0.0, arm.length, 0.0]))
        second = model.addJoint(first, pin.JointModelRZ(), elbow, f"bars {k}")
        third = model.addJoint(second, pin.JointModelRX(), identity, f"sideways {k}")
        model.appendBodyToJoint(third, _bar(pin, bars.mass, bars.length), identity)


def _bar(pin: Any, mass: float, length: float) -> Any:
    moment = mass * length**2 / 12
    return pin.Inertia(mass, np.array([0, length / 2, 0]), np.diag([moment, 0.0, moment]))


def mujoco_seconds(robot: Robot, payload: float, calls: int) -> float:
    """Of mj_inverse of the closed mechanism, its loops closed by three connections."""
    mujoco = installed("mujoco")
    model = mujoco.MjModel.from_xml_string(mjcf(robot, payload))
    data = mujoco.MjData(model)
    return _seconds(lambda: mujoco.mj_inverse(model, data), calls)


def mjcf(robot: Robot, payload: float) -> str:
    """The mechanism in MuJoCo's format, z up: twelve coordinates, nine constraints."""
    chains = "\n".join(_mjcf_chain(robot, k, azimuth) for k, azimuth in enumerate(AZIMUTHS))
    connections = "\n".join(
        f'<connect site1="tip{k}" site2="corner{k}"/>' for k in range(len(AZIMUTHS))
    )
    radius = robot.platform_radius
    corners = "\n".join(
        f'<site name="corner{k}" pos="{radius * np.cos(a)} {radius * np.sin(a)} 0"/>'
        for k, a in enumerate(AZIMUTHS)
    )
    depth = -((robot.forearm.length**2 - (robot.base_radius - radius) ** 2) ** 0.5)
    return f"""<mujoco><option gravity="0 0 -{robot.gravity}"/><worldbody>
<body name="platform" pos="0 0 {depth}">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/>
<inertial mass="{robot.platform.mass + payload}" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/>
{corners}</body>
{chains}
</worldbody><equality>{connections}</equality></mujoco>"""


def _mjcf_chain(robot: Robot, k: int, azimuth: float) -> str:
    arm, bars = robot.upper_arm, robot.forearm
    y, z = robot.base_radius * np.cos(azimuth), robot.base_radius * np.sin(azimuth)
    return f"""<body pos="{y} {z} 0"
 euler="0 0 {np.degrees(azimuth)}"><joint axis="0 1 0"/>{_mjcf_bar(arm.mass, arm.length)}
<body pos="{arm.length} 0 0"><joint axis="0 1 0"/><joint axis="0 0 1"/>
{_mjcf_bar(bars.mass, bars.length)}<site name="tip{k}" pos="{bars.length} 0 0"/></body></body>"""


def _mjcf_bar(mass: float, length: float) -> str:
    moment = mass * length**2 / 12
    return (
        f'<inertial mass="{mass}" pos="{length / 2} 0 0" '
        f'diaginertia="{moment * 1e-3} {moment} {moment}"/>'
    )


def _seconds(call: Callable[[], object], calls: int) -> float:
    """Median of batches, per call."""
    batches = []
    for _ in range(11):
        begin = perf_counter()
        for _ in range(calls):
            call()
        batches.append((perf_counter() - begin) / calls)
    return float(np.median(batches))


PEERS: dict[str, Callable[[Robot, float, int], float]] = {
    "Pinocchio, one pass over the open tree": pinocchio_seconds,
    "MuJoCo, mj_inverse with closed loops": mujoco_seconds,
}
"""What the exported inverse dynamics is held against, each called from Python."""
