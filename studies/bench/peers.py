"""A peer that plans path and time together: rockit, on the same model and tasks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import RULED_OUT, installed
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.controller_c import c_functions
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.planner import Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.scene import Scene
from studies.bench.plan_timing import finer
from studies.bench.random_scenes import random_scenes
from studies.timed import timed


@dataclass(frozen=True)
class PeerPlan:
    """A duration (s), and the processor's seconds of the solve alone, the program being built
    already. ``torques``: (intervals, 3), N·m, constant in each of the equal intervals."""

    duration: float
    seconds: float
    intervals: int
    solved: bool
    torques: Array


def rockit_plan(scene: Scene, guess: Trajectory, intervals: int) -> PeerPlan:
    """Plan a scene by rockit's multiple shooting with Ipopt, torques constant in an interval,
    starting from the motion ``guess``."""
    rockit = installed("rockit", "bench")
    model = DeltaModel(as_delta(scene.robot), scene.payload)
    forward = c_functions(as_delta(scene.robot))[-1]
    problem = rockit.Ocp(T=rockit.FreeTime(guess.duration))
    x, v, tau = problem.state(3), problem.state(3), problem.control(3)
    limit = np.array(scene.robot.torque_limits)
    problem.set_der(x, v)
    problem.set_der(v, forward(x, v, tau * limit, scene.payload or 0.0))
    problem.subject_to((tau <= 1) >= -1)
    problem.subject_to(problem.at_t0(x) == scene.start)
    problem.subject_to(problem.at_tf(x) == scene.goal)
    problem.subject_to(problem.at_t0(v) == 0)
    problem.subject_to(problem.at_tf(v) == 0)
    if scene.robot.speed_limits is not None:
        dtheta = _motor_speed(model)(x, v) / np.array(scene.robot.speed_limits)
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
    return _timed(problem, tau * limit, intervals)


def rockit_within(
    scene: Scene, guess: Trajectory, best: float, tolerance: float
) -> PeerPlan | None:
    """Return rockit's plan on the coarsest grid whose duration is within a tolerance of the best
    known (s); None if none is."""
    for intervals in (20, 40, 80):
        found = rockit_plan(scene, guess, intervals)
        if found.solved and found.duration <= best * (1 + tolerance):
            return found
    return None


def rockit_comparison(robot: Robot, payload: float, number: int, seed: int) -> str:
    """Compare times over random moves, both plans within 1e-3 of the best duration known.

    rockit starts from the straight line at its shortest duration, as we do; moves on which that
    line is impossible are left out.
    """
    planner = Planner(robot, payload)
    reference = finer(planner)
    ours, theirs, blocked, failed = [], [], 0, 0
    for scene in random_scenes(robot, payload, number, seed):
        try:
            line = baseline(scene)
        except RULED_OUT:
            blocked += 1
            continue
        planner.plan(scene.start, scene.goal)
        _, seconds = timed(partial(planner.plan, scene.start, scene.goal))
        best = reference.plan(scene.start, scene.goal).duration
        found = rockit_within(scene, line, best, 1e-3)
        if found is None:
            failed += 1
            continue
        ours.append(seconds)
        theirs.append(found.seconds)
    left_out = (
        f"not within 1e-3 with up to 80 intervals on {failed} of {number} moves, left out on "
        f"{blocked} whose straight line is impossible"
    )
    if not ours:
        return f"{robot.name}: rockit with Ipopt: {left_out}"
    ratio = np.median(np.array(theirs) / np.array(ours))
    return (
        f"{robot.name}: ours {1e3 * np.median(ours):.1f} ms, rockit with Ipopt "
        f"{1e3 * np.median(theirs):.0f} ms, median ratio {ratio:.0f}; from the straight line, "
        f"{left_out}"
    )


def _motor_speed(model: DeltaModel) -> ca.Function:
    """Return the function (x, v) -> θ̇, m, m/s and rad/s, of three motors."""
    x, v, rest = ca.SX.sym("x", 3), ca.SX.sym("v", 3), ca.SX.zeros(3)
    rows = model.functions.explicit_equations(x, v, rest, rest, model.parameters)
    return ca.Function("motor_speed", [x, v], [rows[2]])


def _start_from(
    problem: Any, variables: Any, guess: Trajectory, intervals: int, limit: Array
) -> None:
    motion = guess(np.linspace(0, guess.duration, intervals + 1))
    x, v, tau = variables
    problem.set_initial(x, motion.x.T)
    problem.set_initial(v, motion.v.T)
    problem.set_initial(tau, np.clip(motion.tau / limit, -0.9, 0.9)[:-1].T)


def _timed(problem: Any, torques: Any, intervals: int) -> PeerPlan:
    """Solve twice from the same start, and time the second."""
    try:
        problem.solve()
        solution, seconds = timed(problem.solve)
    except RuntimeError:
        return PeerPlan(np.nan, np.nan, intervals, False, np.full((intervals, 3), np.nan))
    found = np.asarray(solution.sample(torques, grid="control")[1])[:intervals]
    return PeerPlan(float(solution.value(problem.T)), seconds, intervals, True, found)
