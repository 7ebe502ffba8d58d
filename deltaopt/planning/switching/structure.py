"""Which limits hold which motors when: the structure of a time-optimal motion.

It is a sequence of arcs with estimated lengths; where exactly they end is for others to find.
On every arc as many limits hold as there are motors, or fewer, each of a torque, a speed, or the
margin of a fold. A motor may be at its limits of speed and of torque at once: then its speed is
held by another motor's torque, for motors of a closed chain act on each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Signs = NDArray[np.int8]
Truths = NDArray[np.bool]

VANISHED = 1e-5
"""Of the duration: shorter arcs are not there."""


class Limit(NamedTuple):
    """What holds a motor: the torque's or the speed's upper limit 1 or lower -1, the margin
    of the fold 1; 0 what does not. ``touched``, 1, of an opening, ``grazed``, 1 or -1, of a speed:
    they come to their limit at the instant where this begins, and leave it at once."""

    torque: int = 0
    speed: int = 0
    opening: int = 0
    touched: int = 0
    grazed: int = 0

    @property
    def later(self) -> Limit:
        """After the instant where it begins."""
        return self._replace(touched=0, grazed=0)

    def goes_on(self, before: Limit) -> bool:
        """Whether nothing changes where this follows on another."""
        return self in (before, before.later)


FREE = Limit()
Arc = tuple[Limit, ...]
"""What holds every motor."""


@dataclass(frozen=True)
class Structure:
    """``lengths`` of the arcs, (n,), fractions of the duration; ``limits``: of every arc, of
    every motor."""

    lengths: Array
    limits: tuple[Arc, ...]

    @cached_property
    def torque(self) -> Signs:
        """The limits of torque that hold, (n, 3): 1 the upper, -1 the lower, 0 none."""
        return np.array([[limit.torque for limit in arc] for arc in self.limits], np.int8)

    @cached_property
    def speed(self) -> Signs:
        """The same of speed."""
        return np.array([[limit.speed for limit in arc] for arc in self.limits], np.int8)

    @cached_property
    def reversible(self) -> Truths:
        """Arcs that others begin than end, (n,): if they are of negative length their ends are in
        the wrong order, no more."""
        changing = [
            {k for k, (before, after) in enumerate(zip(*pair, strict=True)) if before != after}
            for pair in pairwise(self.limits)
        ]
        between = [first.isdisjoint(last) for first, last in pairwise(changing)]
        return np.array([False, *between, False][: len(self.limits)])

    @cached_property
    def opening(self) -> Signs:
        """1 where a chain is at the margin of its fold, (n, 3)."""
        return np.array([[limit.opening for limit in arc] for arc in self.limits], np.int8)


@dataclass(frozen=True)
class Stretch:
    """A time, fractions of the duration, over which a motor is held by a limit."""

    begin: float
    end: float
    limit: Limit

    def beginning(self, instant: float) -> Stretch:
        """The rest of it, from later on."""
        return replace(self, begin=instant, limit=self.limit.later)


def changed(structure: Structure, patches: Iterable[tuple[int, Stretch]]) -> Structure:
    """With (motor, stretch) put over what is there, arcs in the order of their switches.

    An arc of negative length has its switches in the wrong order: they are exchanged.
    """
    motors = _by_motor(structure)
    for k, patch in patches:
        earlier = [s for s in motors[k] if s.begin < patch.begin - VANISHED]
        later = [s for s in motors[k] if s.end > patch.end + VANISHED]
        if all(abs(s.begin - patch.begin) > VANISHED for s in motors[k]):
            patch = replace(patch, limit=patch.limit.later)
        before = [replace(s, end=min(s.end, patch.begin)) for s in earlier]
        after = [s if s.begin >= patch.end else s.beginning(patch.end) for s in later]
        motors[k] = joined([*before, patch, *after])
    return bearable(assembled(motors, VANISHED))


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
            if stretches and limit.goes_on(stretches[-1].limit):
                stretches[-1] = replace(stretches[-1], end=end)
            else:
                stretches.append(Stretch(begin, end, limit))
        motors.append(joined(stretches))
    return motors


def joined(stretches: list[Stretch]) -> list[Stretch]:
    """In order, one after the other; what is too short gives way to what follows, but for a fold
    that came to its margin there: it touches it."""
    found: list[Stretch] = []
    touched = grazed = 0
    for s in stretches:
        begin = found[-1].end if found else 0.0
        if s.end - max(s.begin, begin) <= VANISHED:
            at_margin = s.limit.opening and not (found and found[-1].limit.opening)
            touched, grazed = touched or s.limit.touched or at_margin, grazed or s.limit.grazed
            continue
        limit = s.limit
        if touched and not limit.opening:
            limit = limit._replace(touched=1)
        if grazed and not limit.speed:
            limit = limit._replace(grazed=grazed)
        s, touched, grazed = replace(s, limit=limit), 0, 0
        if found and s.limit.goes_on(found[-1].limit):
            found[-1] = replace(found[-1], end=s.end)
        else:
            found.append(replace(s, begin=begin))
    found[-1] = replace(found[-1], end=1.0)
    return found


def assembled(motors: list[list[Stretch]], simultaneous: float) -> Structure:
    """Arcs from what holds each motor when."""
    switches = _merged([s.end for motor in motors for s in motor], simultaneous)
    middles = (np.concatenate([[0.0], switches[:-1]]) + switches) / 2
    limits = [tuple(at(motor, t) for motor in motors) for t in middles.tolist()]
    return Structure(np.diff(switches, prepend=0.0), tuple(limits))


def held_on(arc: Arc) -> int:
    """How much an arc holds: torques, speeds and openings."""
    return sum(bool(limit.torque) + bool(limit.speed) + limit.opening for limit in arc)


def bearable(structure: Structure) -> Structure:
    """With no more held on any arc than there are motors: torques give way, of motors that hold
    speeds or openings first, then speeds. Arcs that are alike then are one."""
    lengths: list[float] = []
    arcs: list[Arc] = []
    for length, arc in zip(structure.lengths.tolist(), structure.limits, strict=True):
        fewer = _fewer(arc)
        if arcs and all(now.goes_on(was) for was, now in zip(arcs[-1], fewer, strict=True)):
            lengths[-1] += length
        else:
            lengths.append(length)
            arcs.append(fewer)
    return Structure(np.array(lengths), tuple(arcs))


def _fewer(arc: Arc) -> Arc:
    limits = list(arc)
    for k in sorted(range(len(arc)), key=lambda k: not (arc[k].speed or arc[k].opening)):
        if held_on(tuple(limits)) > len(arc):
            limits[k] = limits[k]._replace(torque=0)
    for k in range(len(arc)):
        if held_on(tuple(limits)) > len(arc):
            limits[k] = limits[k]._replace(speed=0)
    return tuple(limits)


def _merged(switches: list[float], simultaneous: float) -> Array:
    """Sorted, simultaneous ones as one, the end of the motion as the last."""
    merged: list[float] = []
    for t in sorted(switches):
        if t > simultaneous and (not merged or t - merged[-1] > simultaneous):
            merged.append(t)
    merged[-1] = 1.0
    return np.array(merged)


def at(stretches: list[Stretch], t: float) -> Limit:
    """What holds the motor at t."""
    return next((s for s in stretches if t < s.end), stretches[-1]).limit
