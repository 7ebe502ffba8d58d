"""Other programs on the scenes of the frontier: what gap they reach, in what time.

Past bodies TOPP-RA alone has an answer: on the lowest rounded path over them, which is what it
would be given, and on the path that we planned. Else rockit answers the same question by multiple
shooting and Ipopt on our model, from the timed straight line; its torques are integrated anew and
must arrive. TOPP-RA and Ruckig answer easier ones, and get what an expert would give them: TOPP-RA
a path and our dynamics along it in machine code, on the straight line or on the path that we
planned (whose planning is not counted), its motion slowed until it keeps the torques between points
of its grid too; Ruckig the largest constant acceleration of the motors that keeps them (the search
for it is not counted).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.controller_c import c_functions
from deltaopt.planning.comparisons import rounded_path_over
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from studies.bench.fixed_paths import (
    MotorLine,
    Path,
    driven,
    loads_along,
    straight,
    toppra_speeds,
)
from studies.bench.peers import PeerPlan, rockit_plan
from studies.timed import timed

ARRIVES = 1e-6
"""m: rockit's torques must bring the platform so near to the goal, by 20 steps of Runge and Kutta's
method in each of its intervals."""
_STEPS = 20
_FINER = 10
"""Places in each interval of TOPP-RA's grid at which torques are looked at."""


Peer = Callable[[Scene, Trajectory, int], tuple[float, float, bool]]
"""(scene, our best plan, setting) -> duration (s), seconds, and whether it is good."""


def peers_of(scene: Scene) -> dict[str, tuple[Peer, tuple[int, ...]]]:
    """The programs that a scene can fairly be given to, and their settings from coarse to fine."""
    return PAST_BODIES if scene.keep_out else FREE


def rockit(scene: Scene, best: Trajectory, intervals: int) -> tuple[float, float, bool]:
    """With torques constant in so many intervals."""
    found = rockit_plan(scene, deltaopt.baseline(scene), intervals)
    return found.duration, found.seconds, found.solved and miss(scene, found) <= ARRIVES


def miss(scene: Scene, found: PeerPlan) -> float:
    """Return where rockit's torques lead the platform: its distance from the goal, m."""
    forward, payload = c_functions(as_delta(scene.robot))[-1], scene.payload or 0.0

    def rate(state: Array, torque: Array) -> Array:
        x, v = np.split(state, 2)
        return np.concatenate([v, np.array(forward(x, v, torque, payload)).ravel()])

    state, h = np.concatenate([scene.start, np.zeros(3)]), found.duration / len(found.torques)
    h /= _STEPS
    for torque in np.repeat(found.torques, _STEPS, axis=0):
        k1 = rate(state, torque)
        k2 = rate(state + h / 2 * k1, torque)
        k3 = rate(state + h / 2 * k2, torque)
        k4 = rate(state + h * k3, torque)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return float(np.linalg.norm(state[:3] - scene.goal))


def toppra_on_line(scene: Scene, best: Trajectory, intervals: int) -> tuple[float, float, bool]:
    """On the straight line, with so many intervals."""
    return _slowed(scene, straight(scene, intervals), straight(scene, intervals * _FINER))


def toppra_over_bodies(scene: Scene, best: Trajectory, pieces: int) -> tuple[float, float, bool]:
    """On the lowest rounded path over the bodies, with so many intervals for each of our plan's."""
    over = rounded_path_over(scene)
    ours = deltaopt.plan(scene.model_copy(update={"path": over, "keep_out": None})).trajectory
    return toppra_on_ours(scene, ours, pieces)


def toppra_on_ours(scene: Scene, best: Trajectory, pieces: int) -> tuple[float, float, bool]:
    """On our path, with so many intervals for each of ours."""
    return _slowed(scene, driven(best, pieces), driven(best, pieces * _FINER))


def _slowed(scene: Scene, path: Path, fine: Path) -> tuple[float, float, bool]:
    """Time a path, and slow the motion until it keeps the torques on a finer grid of the same."""
    toppra_speeds(scene, path)  # our dynamics are compiled
    speeds, seconds = timed(lambda: toppra_speeds(scene, path))
    if speeds is None:
        return np.nan, seconds, False
    squares, intervals = speeds**2, len(speeds) - 1
    along = np.repeat(np.diff(squares) / (2 * np.diff(path.s)), _FINER)
    share = np.tile(np.arange(_FINER) / _FINER, intervals)
    rising = np.repeat(np.diff(squares), _FINER) * share + np.repeat(squares[:-1], _FINER)
    gravity, a, b, _ = loads_along(scene, fine.derivatives)
    slowest = 1.0
    for square in (rising, rising + along * 2 * np.repeat(np.diff(path.s), _FINER) / _FINER):
        moving = a[:-1] * along[:, None] + b[:-1] * square[:, None]
        limit = np.array(scene.robot.torque_limits)
        left = np.where(moving > 0, limit - gravity[:-1], limit + gravity[:-1])
        slowest = max(slowest, float((np.abs(moving) / left).max()))
    together = speeds[1:] + speeds[:-1]
    if not together.all():  # it rests on the way, at a corner that is not rounded
        return np.nan, seconds, False
    duration = float(np.sum(2 * np.diff(path.s) / together))
    return duration * np.sqrt(slowest), seconds, True


def ruckig(scene: Scene, best: Trajectory, _: int) -> tuple[float, float, bool]:
    """Between the motor angles of start and goal."""
    motors = MotorLine(scene)
    acceleration = motors.largest_acceleration()
    duration, seconds = timed(lambda: motors.duration(acceleration))
    return duration, seconds, bool(duration > 0)


_OURS = (toppra_on_ours, (16, 64, 256))
FREE: dict[str, tuple[Peer, tuple[int, ...]]] = {
    "rockit": (rockit, (20, 40, 80)),
    "TOPP-RA, straight line": (toppra_on_line, (50, 200, 800)),
    "TOPP-RA, our path": _OURS,
    "Ruckig": (ruckig, (1,)),
}
PAST_BODIES: dict[str, tuple[Peer, tuple[int, ...]]] = {
    "TOPP-RA, rounded path": (toppra_over_bodies, (1, 4, 16)),
    "TOPP-RA, our path": _OURS,
}
"""Peers, and from coarse to fine: intervals, intervals, intervals for each of ours, nothing."""
