"""Peers that fix the path: TOPP-RA times a given one, Ruckig draws one between motor angles.

TOPP-RA is given our inverse dynamics along a path x(s) of the platform, τ = a s̈ + b ṡ² + c,
which is linear in what it seeks, at all points of its grid in one call. Ruckig knows nothing
of torques: it is given the largest constant motor acceleration whose motion keeps them, which
nobody has without our model either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array
from deltaopt.errors import MissingPackage, Singular, Unreachable, installed
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.joint_table import platform_motion
from deltaopt.planning.planner import Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points
from studies.bench.random_scenes import random_scenes
from studies.timed import timed

_LINE = (100, 400)
"""Intervals of TOPP-RA's grids on straight lines: one that takes no longer than a plan of ours, and
one four times as fine, which shows that the duration no longer changes."""
_PIECES = (4, 32)
"""And for each interval of ours on the path that we found."""
_SAMPLES = np.linspace(0.0, 1.0, 301)
"""Fractions of Ruckig's motions at which torques are looked at."""


@dataclass(frozen=True)
class Timing:
    """A peer's duration and processor seconds over ours; NaN where it found no motion."""

    duration: float
    seconds: float


# TOPP-RA


@dataclass(frozen=True)
class Path:
    """Points of a path by arc length ``s`` (n,), m, with x (m), dx/ds and d²x/ds² (1/m), (n, 3)
    each; ``before``: d²x/ds² where an interval ends, should it jump there, (n, 3)."""

    s: Array
    derivatives: tuple[Array, Array, Array]
    before: Array

    @property
    def dof(self) -> int:
        return 3

    @property
    def path_interval(self) -> Array:
        return self.s[[0, -1]]


def straight(scene: Scene, intervals: int) -> Path:
    """Return the line from start to goal."""
    start, goal = (np.array(point) for point in given_points(scene.task))
    way = goal - start
    length = float(np.linalg.norm(way))
    s = np.linspace(0.0, length, intervals + 1)
    tangent = np.broadcast_to(way / length, (intervals + 1, 3))
    none = np.zeros_like(tangent)
    return Path(s, (start + np.outer(s, way / length), tangent, none), none)


def driven(trajectory: Trajectory, pieces: int) -> Path:
    """Return the path of a motion, each of its intervals cut in ``pieces`` of equal time.

    Its curvature jumps where acceleration does, at the knots.
    """
    knots, fine = trajectory.knots, 40
    u = np.linspace(0.0, 1.0, fine * pieces + 1)[:-1]
    t = np.append((knots[:-1, None] + np.diff(knots)[:, None] * u).ravel(), knots[-1])
    speed = np.linalg.norm(trajectory.position.derivative().at(t), axis=1)
    s = np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t)))[::fine]
    t = t[::fine]
    tangent, curvature = _bends(trajectory, t + 1e-9 * knots[-1])
    _, before = _bends(trajectory, t - 1e-9 * knots[-1])
    return Path(s, (trajectory.position.at(t), tangent, curvature), before)


def _bends(trajectory: Trajectory, t: Array) -> tuple[Array, Array]:
    """Return dx/ds and d²x/ds² of a motion at times t, s, those at rest a little within it."""
    motion = trajectory(np.clip(t, 1e-4 * trajectory.duration, (1 - 1e-4) * trajectory.duration))
    squared = (motion.v**2).sum(axis=1, keepdims=True)
    along = (motion.a * motion.v).sum(axis=1, keepdims=True) * motion.v / squared
    return motion.v / np.sqrt(squared), (motion.a - along) / squared


def toppra_duration(scene: Scene, path: Path) -> float:
    """Return the duration of the fastest motion along a path, from rest to rest, s; NaN if there
    is none. Raises MissingPackage."""
    speeds = toppra_speeds(scene, path)
    if speeds is None:
        return np.nan
    return float(np.sum(2 * np.diff(path.s) / (speeds[1:] + speeds[:-1])))


def toppra_speeds(scene: Scene, path: Path) -> Array | None:
    """Return the speeds ds/dt of that motion at the path's points, (n,), m/s; None if there is no
    motion. Between points d²s/dt² is constant; the limits of torque hold at both ends of an
    interval. Raises MissingPackage."""
    toppra = installed("toppra", "bench")
    limits = _limits(toppra, scene)
    algorithm = toppra.algorithm.TOPPRA([limits], path, gridpoints=path.s)
    speeds = algorithm.compute_parameterization(0.0, 0.0)[1]
    return None if speeds is None else np.asarray(speeds, dtype=float)


def loads_along(
    scene: Scene, derivatives: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array, Array]:
    """Return c, a and b of the torques τ = a s̈ + b ṡ² + c, and the motors' speeds over ṡ, at the
    points of a path, (n, 3) each, by moving at rest, with s̈ of 1 alone and with ṡ of 1 alone."""
    model = DeltaModel(as_delta(scene.robot), scene.payload)
    x, dx, ddx = derivatives
    rest = np.zeros_like(x)
    states = np.vstack([x, x, x]), np.vstack([rest, rest, dx]), np.vstack([rest, dx, ddx])
    torques, rates = _loads(model.functions)(*states, parameters=model.parameters)
    c, a, b = np.split(np.asarray(torques), 3)
    return c, a - c, b - c, np.asarray(rates)[-len(x) :]


def _limits(toppra: Any, scene: Scene) -> Any:
    """Return the limits of torque, and of motor speed if there are any, as TOPP-RA's constraint.

    Torques are held at both ends of an interval, as TOPP-RA does with the limits that it knows:
    where they are held at its beginning alone they are exceeded at its end, and slowing is dear.
    """
    base: Any = toppra.constraint.LinearConstraint
    torque = np.array(scene.robot.torque_limits)

    class Limits(base):  # type: ignore[misc]
        def compute_constraint_params(self, path: Path, s: Array) -> Any:
            *loads, rates = loads_along(scene, path.derivatives)
            c, a, b = (each / torque for each in loads)
            before = loads_along(scene, (*path.derivatives[:2], path.before))[2] / torque
            step = 2 * np.diff(s)[:, None]  # ṡ² grows by this times s̈
            a = np.hstack([a, np.vstack([a[1:] + step * before[1:], a[-1:]])])
            b, c = (
                np.hstack([of, np.vstack([end[1:], end[-1:]])]) for of, end in ((b, before), (c, c))
            )
            F, g = np.vstack([np.eye(6), -np.eye(6)]), np.ones(12)
            highest = np.full(len(s), 1e6)
            if scene.robot.speed_limits is not None:
                highest = 1 / ((rates / np.array(scene.robot.speed_limits)) ** 2).max(axis=1)
            bound = np.column_stack([np.zeros(len(s)), highest])
            return a, b, c, F, g, None, bound

    limits = Limits()
    limits.identical = True
    return limits


@lru_cache(maxsize=4)
def _loads(functions: DeltaFunctions) -> RowFunction:
    """Return the function (x, v, a, p) -> τ, θ̇, in machine code where there is a compiler, as our
    planner's are."""
    x, v, a = (ca.SX.sym(name, 3) for name in ("x", "v", "a"))
    p = functions.symbols()
    rates = functions.explicit_equations(x, v, a, ca.SX.zeros(3), p)[2]
    loads = [functions.explicit_torques(x, v, a, p), rates]
    return RowFunction.of("loads", [x, v, a, p], loads)


# Ruckig


@dataclass(frozen=True)
class MotorLine:
    """A move between the motor angles of start and goal at constant accelerations."""

    scene: Scene

    def trajectory(self, acceleration: float) -> Any:
        """Return Ruckig's motion at this acceleration of every motor (rad/s²), jerk unlimited."""
        ruckig = installed("ruckig", "bench")
        request = ruckig.InputParameter(3)
        model = DeltaModel(as_delta(self.scene.robot), self.scene.payload)
        ends = model.inverse_kinematics(given_points(self.scene.task))[:, 3::3]
        request.current_position, request.target_position = ends.tolist()
        request.max_velocity = list(self.scene.robot.speed_limits or 3 * [1e3])
        request.max_acceleration = 3 * [acceleration]
        found = ruckig.Trajectory(3)
        ruckig.Ruckig(3).calculate(request, found)
        return found

    def duration(self, acceleration: float) -> float:
        """Return Ruckig's duration, s; NaN if the acceleration is NaN. Raises MissingPackage."""
        installed("ruckig", "bench")
        return float(self.trajectory(acceleration).duration) if acceleration > 0 else np.nan

    def keeps_torques(self, acceleration: float) -> bool:
        found = self.trajectory(acceleration)
        samples = [found.at_time(t) for t in found.duration * _SAMPLES]
        theta, rates, accelerations = (np.array(part) for part in zip(*samples, strict=True))
        model = DeltaModel(as_delta(self.scene.robot), self.scene.payload)
        try:
            torque = model.inverse_dynamics(*platform_motion(model, theta, rates, accelerations))
        except (Unreachable, Singular):
            return False
        return bool((np.abs(torque) <= np.array(self.scene.robot.torque_limits)).all())

    def largest_acceleration(self) -> float:
        """Find the largest acceleration that keeps the torques, by bisection to 1e-4; NaN if none
        does."""
        low, high = 1e-2, 1e5
        if not self.keeps_torques(low):
            return np.nan
        while high / low > 1 + 1e-4:
            middle = float(np.sqrt(low * high))
            low, high = (middle, high) if self.keeps_torques(middle) else (low, middle)
        return low


# Both


def fixed_path_comparison(
    robot: Robot, payload: float, number: int, seed: int, progress: Callable[[int], None]
) -> str:
    """Compare durations and processor times on random moves; a peer that is not installed is named.
    ``progress`` is called after each move with how many are done."""
    planner = Planner(robot, payload)
    timings: dict[str, list[Timing]] = {}
    missing: dict[str, str] = {}
    ours = []
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        planner.plan(scene.start, scene.goal)
        plan, seconds = timed(partial(planner.plan, scene.start, scene.goal))
        ours.append(seconds)
        for name, duration in _peers(scene, plan.trajectory).items():
            try:
                duration()
            except MissingPackage as error:
                missing[str(error)] = name
                continue
            found, theirs = timed(duration)
            timing = Timing(found / plan.duration, theirs / seconds)
            timings.setdefault(name, []).append(timing)
        progress(i + 1)
    lines = [f"{robot.name}, {number} moves, ours {1e3 * np.median(ours):.1f} ms"]
    lines += [_line(name, of) for name, of in timings.items()]
    return "\n  ".join([*lines, *missing])


def _peers(scene: Scene, ours: Trajectory) -> dict[str, Callable[[], float]]:
    """Return what computes the duration (s) of every peer; what we hand over to them is computed
    here already, so that it is not in their time."""
    peers: dict[str, Callable[[], float]] = {}
    for number in _LINE:
        path = straight(scene, number)
        name = f"TOPP-RA on the straight line, {number} intervals"
        peers[name] = partial(toppra_duration, scene, path)
    for number in _PIECES:
        path = driven(ours, number)
        name = f"TOPP-RA on our path, {number} for each of our intervals"
        peers[name] = partial(toppra_duration, scene, path)
    motors = MotorLine(scene)
    try:
        acceleration = motors.largest_acceleration()
    except MissingPackage:
        acceleration = np.nan
    peers["Ruckig, accelerations known"] = lambda: motors.duration(acceleration)
    peers["Ruckig, and their bisection"] = lambda: motors.duration(motors.largest_acceleration())
    return peers


def _line(name: str, timings: list[Timing]) -> str:
    durations = np.array([t.duration for t in timings])
    there = durations[np.isfinite(durations)]
    if not len(there):
        return f"{name}: none found"
    return (
        f"{name}: found on {len(there)} of {len(durations)}; duration over ours median "
        f"{np.median(there):.4f}, from {there.min():.4f} to {there.max():.4f}; time over ours "
        f"{np.median([t.seconds for t in timings]):.3g}"
    )
