"""Which motor is at which limit when: the structure of a time-optimal motion.

Between two switches every motor is held by a limit of its torque, by a limit of its speed,
or by none. Read from a converged motion on a mesh, the structure is a sequence of arcs with
estimated lengths; where exactly they end is for ``arcs`` to find.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

_TORQUE_AT_LIMIT, _SPEED_AT_LIMIT = 0.9, 0.99
"""Of a load, everywhere in an interval. Torque comes to its limit in a jump, and coarse
polynomials leave some of it unused; speed comes to its limit gradually."""
_LONGEST_SWITCH = 0.03
"""Of the duration: what is longer between two limits is no smeared switch but an arc."""
_SIMULTANEOUS = 2e-4
"""Of the duration: switches closer together than this are one."""


@dataclass(frozen=True)
class Structure:
    """``lengths`` of the arcs, (n,), fractions of the duration; ``torque`` and ``speed``:
    the limits that hold, (n, m), 1 the upper, -1 the lower, 0 none."""

    lengths: Array
    torque: Signs
    speed: Signs


def read_structure(mesh: Array, torque: Array, speed: Array | None) -> Structure:
    """From loads in the intervals of a mesh (N,), fractions of their limits, (N, points, m)."""
    motors = torque.shape[2]
    ends = np.concatenate([[0.0], np.cumsum(mesh)])
    ends[-1] = 1.0
    speeds = (
        np.zeros((len(mesh), motors), np.int8) if speed is None else _held(speed, _SPEED_AT_LIMIT)
    )
    torques = np.where(speeds != 0, 0, _held(torque, _TORQUE_AT_LIMIT)).astype(np.int8)
    runs = [_runs(ends, torques[:, k], speeds[:, k], torque[:, :, k]) for k in range(motors)]
    switches = _merged(np.concatenate([[r.end for r in motor] for motor in runs]))
    middles = (np.concatenate([[0.0], switches[:-1]]) + switches) / 2
    arcs = [[_at(motor, t) for motor in runs] for t in middles]
    return Structure(
        np.diff(switches, prepend=0.0),
        np.array([[run.torque for run in arc] for arc in arcs], np.int8),
        np.array([[run.speed for run in arc] for arc in arcs], np.int8),
    )


@dataclass
class _Run:
    """A stretch of time over which one motor is held by the same limit."""

    begin: float
    end: float
    torque: int
    speed: int
    impulse: float  # ∫ load dt, of a stretch without limit


def _held(load: Array, at_limit: float) -> Signs:
    """The limit that holds all over an interval, (N, 3)."""
    upper, lower = load.min(axis=1) > at_limit, load.max(axis=1) < -at_limit
    return np.asarray(upper, np.int8) - np.asarray(lower, np.int8)


def _runs(ends: Array, torque: Signs, speed: Signs, load: Array) -> list[_Run]:
    """Runs of one motor, smeared switches resolved into instants."""
    runs: list[_Run] = []
    for i, (t, s) in enumerate(zip(torque.tolist(), speed.tolist(), strict=True)):
        impulse = float(load[i].mean() * (ends[i + 1] - ends[i]))
        if runs and (runs[-1].torque, runs[-1].speed) == (t, s):
            runs[-1].end = float(ends[i + 1])
            runs[-1].impulse += impulse
        else:
            runs.append(_Run(float(ends[i]), float(ends[i + 1]), t, s, impulse))
    return _sharpened(runs)


def _sharpened(runs: list[_Run]) -> list[_Run]:
    """Without the short runs between two limits: their neighbours meet at an instant."""
    kept: list[_Run] = []
    for i, run in enumerate(runs):
        short = run.torque == run.speed == 0 and run.end - run.begin < _LONGEST_SWITCH
        if not short or len(runs) == 1:
            kept.append(run)
            continue
        before, after = runs[i - 1] if i else None, runs[i + 1] if i + 1 < len(runs) else None
        instant = _instant(run, before, after)
        if before:
            before.end = instant
        if after:
            after.begin = instant
    joined: list[_Run] = []
    for run in kept:
        if joined and (joined[-1].torque, joined[-1].speed) == (run.torque, run.speed):
            joined[-1].end = run.end
        else:
            joined.append(run)
    return joined


def _instant(run: _Run, before: _Run | None, after: _Run | None) -> float:
    """When the switch within a run happens: where the impulse of torque is the run's."""
    if before is None:
        return run.begin
    if after is None:
        return run.end
    if before.torque and after.torque and before.torque != after.torque:
        share = (run.impulse / (run.end - run.begin) - after.torque) / (
            before.torque - after.torque
        )
        return run.begin + (run.end - run.begin) * min(max(share, 0.0), 1.0)
    return (run.begin + run.end) / 2


def _merged(switches: Array) -> Array:
    """Sorted, simultaneous ones as one, the end of the motion as the last."""
    merged: list[float] = []
    for t in np.sort(switches).tolist():
        if not merged or t - merged[-1] > _SIMULTANEOUS:
            merged.append(t)
    merged[-1] = 1.0
    return np.array(merged)


def _at(runs: list[_Run], t: float) -> _Run:
    """The run that t lies in."""
    return next((run for run in runs if t < run.end), runs[-1])
