"""Which limit holds which motor when: the structure of a time-optimal motion.

Between two switches every motor is held by a limit of its torque or of its speed, by the
margin of its chain's fold, or by none. Read from a converged motion on a mesh, the structure
is a sequence of arcs with estimated lengths; where exactly they end is for others to find.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Signs = NDArray[np.int8]

_OPENING_AT_MARGIN = 1e-3
"""At most, everywhere in an interval."""
_SIMULTANEOUS = 2e-4
"""Of the duration: switches that are read closer to each other are one."""
VANISHED = 1e-5
"""Of the duration: shorter arcs are not there."""


class Limit(NamedTuple):
    """What holds a motor: the torque's or the speed's upper limit 1 or lower -1, the margin
    of the fold 1; all 0 if nothing does. ``touched``: 1 if the fold comes to its margin at
    the instant where this begins, and leaves it at once."""

    torque: int = 0
    speed: int = 0
    opening: int = 0
    touched: int = 0


FREE = Limit()


@dataclass(frozen=True)
class Structure:
    """``lengths`` of the arcs, (n,), fractions of the duration; ``limits``: of every arc, of
    every motor."""

    lengths: Array
    limits: tuple[tuple[Limit, ...], ...]

    @cached_property
    def torque(self) -> Signs:
        """The limits of torque that hold, (n, 3): 1 the upper, -1 the lower, 0 none."""
        return np.array([[limit.torque for limit in arc] for arc in self.limits], np.int8)

    @cached_property
    def speed(self) -> Signs:
        """The same of speed."""
        return np.array([[limit.speed for limit in arc] for arc in self.limits], np.int8)

    @cached_property
    def opening(self) -> Signs:
        """1 where a chain is at the margin of its fold, (n, 3)."""
        return np.array([[limit.opening for limit in arc] for arc in self.limits], np.int8)


@dataclass(frozen=True)
class Stretch:
    """A time, fractions of the duration, over which a motor is held by a limit.

    ``impulse``: ∫ load dt, of a motor without limit.
    """

    begin: float
    end: float
    limit: Limit
    intervals: int = 0
    impulse: float = 0.0

    @property
    def length(self) -> float:
        return self.end - self.begin


@dataclass(frozen=True)
class Reading:
    """How a mesh is read. ``widest``: intervals; what is wider between two limits is no smeared
    switch but an arc. ``torque``, ``speed``: of a load that is at its limit, everywhere in an
    interval. Torque comes to its limit in a jump, and coarse polynomials leave some of it unused;
    speed comes gradually.
    """

    widest: int = 3
    torque: float = 0.9
    speed: float = 0.99


USUAL = (Reading(),)
SHARP = (Reading(torque=0.99, speed=0.9999), Reading(widest=8, torque=0.99, speed=0.9999))
"""How to read meshes on which next to nothing is given away, one way after the other."""


def read_structure(
    mesh: Array,
    torque: Array,
    speed: Array | None,
    opening: Array | None = None,
    reading: Reading = USUAL[0],
) -> Structure:
    """From loads in the intervals of a mesh (N,), fractions of their limits, (N, points, m),
    and from how far chains are from the margin of their fold."""
    ends = np.concatenate([[0.0], np.cumsum(mesh)])
    ends[-1] = 1.0
    m = torque.shape[2]
    nothing = np.zeros((len(mesh), m), np.int8)
    speeds = nothing if speed is None else _held(speed, reading.speed)
    openings = nothing if opening is None else opening.max(axis=1) < _OPENING_AT_MARGIN
    torques = np.where((speeds != 0) | (openings != 0), 0, _held(torque, reading.torque))
    held = np.stack([torques, speeds, openings], axis=2).astype(int)  # (N, m, 3)
    motors = [
        _sharpened(_stretches(ends, held[:, k].tolist(), torque[:, :, k]), reading.widest)
        for k in range(m)
    ]
    return _assembled(motors, _SIMULTANEOUS)


def changed(structure: Structure, patches: Iterable[tuple[int, Stretch]]) -> Structure:
    """With (motor, stretch) put over what is there, arcs in the order of their switches.

    An arc of negative length has its switches in the wrong order: they are exchanged.
    """
    motors = _by_motor(structure)
    for k, patch in patches:
        before = [Stretch(s.begin, min(s.end, patch.begin), s.limit) for s in motors[k]]
        after = [Stretch(max(s.begin, patch.end), s.end, s.limit) for s in motors[k]]
        motors[k] = _joined([*before, patch, *after])
    return _assembled(motors, VANISHED)


def _by_motor(structure: Structure) -> list[list[Stretch]]:
    """What holds each motor when, without stretches that end before they begin."""
    ends = np.cumsum(structure.lengths).tolist()
    ends[-1] = 1.0
    motors = []
    for k in range(len(structure.limits[0])):
        stretches: list[Stretch] = []
        for a, end in enumerate(ends):
            limit = structure.limits[a][k]
            begin = stretches[-1].end if stretches else 0.0
            if stretches and stretches[-1].limit == limit:
                begin = stretches.pop().begin
            stretches.append(Stretch(begin, end, limit))
        motors.append(_joined(stretches))
    return motors


def _joined(stretches: list[Stretch]) -> list[Stretch]:
    """In order, one after the other; what is too short gives way to what follows."""
    joined: list[Stretch] = []
    touched = False
    for s in stretches:
        begin = joined[-1].end if joined else 0.0
        if s.end - max(s.begin, begin) <= VANISHED:
            touched = touched or bool(s.limit.opening)
            continue
        if touched:
            s, touched = Stretch(s.begin, s.end, s.limit._replace(touched=1)), False
        if joined and joined[-1].limit == s.limit:
            begin = joined.pop().begin
        joined.append(Stretch(begin, s.end, s.limit))
    joined[-1] = Stretch(joined[-1].begin, 1.0, joined[-1].limit)
    return joined


def _held(load: Array, at_limit: float) -> Signs:
    """The limit that holds all over an interval, (N, 3)."""
    upper, lower = load.min(axis=1) > at_limit, load.max(axis=1) < -at_limit
    return np.asarray(upper, np.int8) - np.asarray(lower, np.int8)


def _stretches(ends: Array, held: list[list[int]], load: Array) -> list[Stretch]:
    """Of one motor, as the intervals show them."""
    found: list[Stretch] = []
    for i, limit in enumerate(held):
        begin, end = float(ends[i]), float(ends[i + 1])
        number, impulse = 1, float(load[i].mean() * (end - begin))
        if found and found[-1].limit == Limit(*limit):
            last = found.pop()
            begin, number, impulse = last.begin, last.intervals + 1, last.impulse + impulse
        found.append(Stretch(begin, end, Limit(*limit), number, impulse))
    return found


def _sharpened(stretches: list[Stretch], widest: int) -> list[Stretch]:
    """Without the short stretches between limits: their neighbours meet at an instant, or
    torque jumps to the other limit and back."""
    kept: list[Stretch] = []
    for i, s in enumerate(stretches):
        if s.limit != FREE or s.intervals > widest or len(stretches) == 1:
            kept.append(s)
            continue
        before = stretches[i - 1].limit if i else None
        after = stretches[i + 1].limit if i + 1 < len(stretches) else None
        kept += _sharp(s, before, after)
    return _joined(kept)


def _sharp(s: Stretch, before: Limit | None, after: Limit | None) -> list[Stretch]:
    """Limits instead of a stretch without: where the impulse of torque says."""
    first, last = before or after or FREE, after or before or FREE
    if not first.torque or not last.torque:
        middle = (s.begin + s.end) / 2
        return [Stretch(s.begin, middle, first), Stretch(middle, s.end, last)]
    mean = s.impulse / s.length
    if first.torque != last.torque:
        share = min(max((mean - last.torque) / (first.torque - last.torque), 0.0), 1.0)
        instant = s.begin + s.length * share
        return [Stretch(s.begin, instant, first), Stretch(instant, s.end, last)]
    other = Limit(torque=-first.torque)
    half = s.length * min(max((1 - mean * first.torque) / 4, 0.0), 0.5)
    middle = s.begin if before is None else s.end if after is None else (s.begin + s.end) / 2
    if before is None or after is None:
        half *= 2
    begin, end = max(middle - half, s.begin), min(middle + half, s.end)
    return [Stretch(s.begin, begin, first), Stretch(begin, end, other), Stretch(end, s.end, last)]


def _assembled(motors: list[list[Stretch]], simultaneous: float) -> Structure:
    """Arcs from what holds each motor when."""
    switches = _merged([s.end for motor in motors for s in motor], simultaneous)
    middles = (np.concatenate([[0.0], switches[:-1]]) + switches) / 2
    limits = [[_at(motor, t) for motor in motors] for t in middles.tolist()]
    return Structure(np.diff(switches, prepend=0.0), tuple(tuple(arc) for arc in limits))


def _merged(switches: list[float], simultaneous: float) -> Array:
    """Sorted, simultaneous ones as one, the end of the motion as the last."""
    merged: list[float] = []
    for t in sorted(switches):
        if t > simultaneous and (not merged or t - merged[-1] > simultaneous):
            merged.append(t)
    merged[-1] = 1.0
    return np.array(merged)


def _at(stretches: list[Stretch], t: float) -> Limit:
    """What holds the motor at t."""
    return next((s for s in stretches if t < s.end), stretches[-1]).limit
