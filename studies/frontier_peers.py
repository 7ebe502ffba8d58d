"""Other programs on the scenes of the frontier: what gap they reach, in what time.

rockit answers the same question by multiple shooting and Ipopt on our model, from the timed
straight line; its torques are integrated anew and must arrive. TOPP-RA and Ruckig answer easier
ones, and get what an expert would give them: TOPP-RA a path and our dynamics along it in machine
code, on the straight line or on the path that we planned (whose planning is not counted), its
motion slowed until it keeps the torques between points of its grid too; Ruckig the largest constant
acceleration of the motors that keeps them (the search for it is not counted).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, MissingPackage
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.controller_c import c_functions
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
from studies.text_table import table
from studies.timed import timed

ARRIVES = 1e-6
"""m: rockit's torques must bring the platform so near to the goal, by 20 steps of Runge and Kutta's
method in each of its intervals."""
_STEPS = 20
_FINER = 10
"""Places in each interval of TOPP-RA's grid at which torques are looked at."""


@dataclass(frozen=True)
class PeerAttempt:
    """A peer's motion at a ``setting``: processor ``seconds`` of its solver, ``gap`` to the
    reference, NaN if it found none; ``good``: it keeps the torques and arrives."""

    scene: str
    peer: str
    setting: int
    seconds: float
    gap: float
    good: bool


@dataclass(frozen=True)
class PeerPoint:
    """A peer at a setting: medians over the scenes, and how many of its motions are good."""

    peer: str
    setting: int
    seconds: float
    gap: float
    good: int
    scenes: int


Peer = Callable[[Scene, Trajectory, int], tuple[float, float, bool]]
"""(scene, our best plan, setting) -> duration (s), seconds, and whether it is good."""


def peer_attempts(
    progress: Callable[[str], None],
    name: str,
    scene: Scene,
    best: Trajectory,
    most: int | None = None,
) -> Iterator[PeerAttempt]:
    """Attempt a scene by all peers that are installed; ``best``: the reference; ``most``: settings
    of each, from the coarsest; None: all."""
    for peer, (attempt, settings) in PEERS.items():
        for setting in settings[:most]:
            progress(f"{name}: {peer}, {setting}")
            try:
                duration, seconds, good = attempt(scene, best, setting)
            except MissingPackage:
                break
            except DeltaOptError:
                duration, seconds, good = np.nan, np.nan, False
            yield PeerAttempt(name, peer, setting, seconds, duration / best.duration - 1, good)


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


def peer_points(attempts: list[PeerAttempt]) -> list[PeerPoint]:
    """Return the medians over the scenes."""
    found = []
    for key in dict.fromkeys((a.peer, a.setting) for a in attempts):
        own = [a for a in attempts if (a.peer, a.setting) == key]
        seconds, gap = (
            float(np.nanmedian(x)) if np.isfinite(x).any() else np.nan
            for x in (np.array([a.seconds for a in own]), np.array([a.gap for a in own]))
        )
        found.append(PeerPoint(*key, seconds, gap, sum(a.good for a in own), len(own)))
    return found


def peers_table(found: list[PeerPoint]) -> str:
    """Return every peer at every setting."""
    rows = [("program", "setting", "ms", "gap", "good motions")]
    rows += [
        (
            p.peer,
            str(p.setting),
            f"{1e3 * p.seconds:.1f}",
            f"{p.gap:.1e}",
            f"{p.good} of {p.scenes}",
        )
        for p in found
    ]
    return table(rows)


def toppra_on_line(scene: Scene, best: Trajectory, intervals: int) -> tuple[float, float, bool]:
    """On the straight line, with so many intervals."""
    return _slowed(scene, straight(scene, intervals), straight(scene, intervals * _FINER))


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
    gravity, a, b = loads_along(scene, fine)
    slowest = 1.0
    for square in (rising, rising + along * 2 * np.repeat(np.diff(path.s), _FINER) / _FINER):
        moving = a[:-1] * along[:, None] + b[:-1] * square[:, None]
        limit = np.array(scene.robot.torque_limits)
        left = np.where(moving > 0, limit - gravity[:-1], limit + gravity[:-1])
        slowest = max(slowest, float((np.abs(moving) / left).max()))
    duration = float(np.sum(2 * np.diff(path.s) / (speeds[1:] + speeds[:-1])))
    return duration * np.sqrt(slowest), seconds, True


def ruckig(scene: Scene, best: Trajectory, _: int) -> tuple[float, float, bool]:
    """Between the motor angles of start and goal."""
    motors = MotorLine(scene)
    acceleration = motors.largest_acceleration()
    duration, seconds = timed(lambda: motors.duration(acceleration))
    return duration, seconds, bool(duration > 0)


ROCKIT, LINE, OURS, RUCKIG = (
    "rockit",
    "TOPP-RA, straight line",
    "TOPP-RA, deltaopt's path",
    "Ruckig, between motor angles",
)
PEERS: dict[str, tuple[Peer, tuple[int, ...]]] = {
    ROCKIT: (rockit, (20, 40, 80)),
    LINE: (toppra_on_line, (50, 200, 800)),
    OURS: (toppra_on_ours, (16, 64, 256)),
    RUCKIG: (ruckig, (1,)),
}
"""Peers, and from coarse to fine: intervals, intervals, intervals for each of ours, nothing."""
