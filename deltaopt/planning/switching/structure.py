"""The switching structure of a time-optimal motion: which limits are active on which motor when.

A structure is a sequence of arcs with estimated lengths; Newton's method finds where exactly they
end. By Pontryagin's principle as many limits are active on an arc as there are motors, or fewer,
each of a control, a velocity or a position. Motors of a closed chain act on each other: a motor may
be at a limit of its velocity and of its control at once, and another's control holds the velocity.

Several limits may change at one switch, as when a motor comes to its velocity limit and another's
control leaves its own limit to hold it there. A mesh shows these changes an interval or two apart,
with an arc in between on which fewer limits are active than around it, or more than there are
motors. Such arcs are taken out, and the changes put together at one instant.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import Array, Truths

Signs = NDArray[np.int8]
SignsByOrder = tuple[int, int]
"""Of limits of order 0 and 1."""

VANISHED = 1e-5
"""Length, as a fraction of the duration, below which an arc is left out. A larger value loses arcs
that are really there, a smaller one keeps arcs that make the system singular."""
SIMULTANEOUS = 2e-4
"""Fraction of the duration: switches detected closer to each other become one. A larger value loses
short arcs, a smaller one leaves arcs that are only noise of the mesh."""
_SAME = 1e-9
"""Difference of two times, as a fraction of the duration, that is rounding."""
_CLEAR = 0.1
"""Least jump of a control row that says when it happened. With a smaller one the instant is the
mean over noise, with a larger one the middle of the short arc is taken too often."""


class ActiveLimits(NamedTuple):
    """The active limits of one motor: 1 at the upper limit, -1 at the lower, 0 where inactive.

    ``states``: those of the state, by their order, 0 of the position and 1 of the velocity.
    ``contacts``: those that are reached at the instant where this begins, and left at once
    (contact points), likewise.
    """

    control: int = 0
    states: SignsByOrder = (0, 0)
    contacts: SignsByOrder = (0, 0)

    def with_state(self, order: int, sign: int) -> ActiveLimits:
        """These limits with another sign of the state limit of order 0 or 1."""
        return self._replace(states=_changed(self.states, order, sign))

    def with_contact(self, order: int, sign: int) -> ActiveLimits:
        """These limits with another sign of the contact of order 0 or 1."""
        return self._replace(contacts=_changed(self.contacts, order, sign))

    @property
    def number(self) -> int:
        """How many limits are active, contact points not counted."""
        return sum(map(bool, (self.control, *self.states)))

    @property
    def without_contacts(self) -> ActiveLimits:
        """What is active after the instant where an arc begins: no contacts."""
        return self._replace(contacts=(0, 0))

    def continues(self, before: ActiveLimits) -> bool:
        """Whether nothing changes where this follows on ``before``."""
        return self in (before, before.without_contacts)


def _changed(signs: SignsByOrder, order: int, sign: int) -> SignsByOrder:
    position, velocity = signs
    return (position, sign) if order else (sign, velocity)


INACTIVE = ActiveLimits()
Arc = tuple[ActiveLimits, ...]
"""The active limits of every motor on an arc."""


@dataclass(frozen=True)
class SwitchingStructure:
    """A sequence of arcs: their ``lengths`` as fractions of the duration, (arcs,), and the
    ``limits`` that are active on each arc, on each motor."""

    lengths: Array
    limits: tuple[Arc, ...]

    @cached_property
    def control(self) -> Signs:
        """Signs of the active limits of controls, (arcs, m)."""
        return np.array([[motor.control for motor in arc] for arc in self.limits], np.int8)

    def state(self, order: int) -> Signs:
        """Signs of the active state limits of order 0 (position) or 1 (velocity), (arcs, m)."""
        return np.array([[motor.states[order] for motor in arc] for arc in self.limits], np.int8)

    @cached_property
    def reversible(self) -> Truths:
        """Arcs whose two ends are switches of different motors, (arcs,). If the length of such an
        arc becomes negative its switches are in the wrong order, and nothing else is wrong."""
        changing = [
            {k for k, (before, after) in enumerate(zip(*pair, strict=True)) if before != after}
            for pair in pairwise(self.limits)
        ]
        between = [first.isdisjoint(last) for first, last in pairwise(changing)]
        return np.array([False, *between, False][: len(self.limits)])


@dataclass(frozen=True)
class MotorArc:
    """A time over which the same limits are active on one motor, from ``begin`` to ``end`` as
    fractions of the duration."""

    begin: float
    end: float
    limits: ActiveLimits

    def remainder(self, instant: float) -> MotorArc:
        """The part of it from a later instant on, which begins without a contact point."""
        return replace(self, begin=instant, limits=self.limits.without_contacts)


def changed(
    structure: SwitchingStructure, changes: Iterable[tuple[int, MotorArc]]
) -> SwitchingStructure:
    """The structure with changes, each (motor, arc of that motor), laid over it in turn.

    Arcs are put in the order of their switches: an arc of negative length has its switches
    exchanged, one of no length is left out.
    """
    motors = _by_motor(structure)
    for k, change in changes:
        earlier = [arc for arc in motors[k] if arc.begin < change.begin - VANISHED]
        later = [arc for arc in motors[k] if arc.end > change.end + VANISHED]
        if all(abs(arc.begin - change.begin) > VANISHED for arc in motors[k]):
            change = replace(change, limits=change.limits.without_contacts)
        before = [replace(arc, end=min(arc.end, change.begin)) for arc in earlier]
        after = [arc if arc.begin >= change.end else arc.remainder(change.end) for arc in later]
        motors[k] = joined([*before, change, *after])
    return determined(assembled(motors, VANISHED))


def _by_motor(structure: SwitchingStructure) -> list[list[MotorArc]]:
    """The arcs of each motor, without those that end before they begin."""
    ends = np.cumsum(structure.lengths).tolist()
    ends[-1] = 1.0
    motors = []
    for k in range(len(structure.limits[0])):
        arcs: list[MotorArc] = []
        for a, end in enumerate(ends):
            limits = structure.limits[a][k]
            begin = arcs[-1].end if arcs else 0.0
            if arcs and limits.continues(arcs[-1].limits):
                arcs[-1] = replace(arcs[-1], end=end)
            else:
                arcs.append(MotorArc(begin, end, limits))
        motors.append(joined(arcs))
    return motors


def joined(arcs: list[MotorArc]) -> list[MotorArc]:
    """The arcs of one motor in order, one after the other, without those that are too short.

    Contact points of arcs that are left out are passed on to what follows. If a position limit
    became active on such an arc, a contact point remains of it.
    """
    found: list[MotorArc] = []
    contacts = [0, 0]
    for arc in arcs:
        begin = found[-1].end if found else 0.0
        limits = arc.limits
        if arc.end - max(arc.begin, begin) <= VANISHED:
            was_active = found and found[-1].limits.states[0]
            reached = (0 if was_active else limits.states[0], 0)
            every = zip(contacts, limits.contacts, reached, strict=True)
            contacts = [known or own or new for known, own, new in every]
            continue
        for order, sign in enumerate(contacts):
            if sign and not limits.states[order]:
                limits = limits.with_contact(order, sign)
        contacts = [0, 0]
        if found and limits.continues(found[-1].limits):
            found[-1] = replace(found[-1], end=arc.end)
        else:
            found.append(MotorArc(begin, arc.end, limits))
    found[-1] = replace(found[-1], end=1.0)
    return found


def assembled(motors: list[list[MotorArc]], simultaneous: float) -> SwitchingStructure:
    """The structure that consists of the arcs of each motor. Switches that are no further apart
    than ``simultaneous``, a fraction of the duration, become one."""
    switches = _merged([arc.end for motor in motors for arc in motor], simultaneous)
    middles = (np.concatenate([[0.0], switches[:-1]]) + switches) / 2
    limits = [tuple(active_at(motor, t) for motor in motors) for t in middles.tolist()]
    return SwitchingStructure(np.diff(switches, prepend=0.0), tuple(limits))


def _merged(switches: list[float], simultaneous: float) -> Array:
    """Sorted, simultaneous ones as one, the end of the motion as the last."""
    merged: list[float] = []
    for t in sorted(switches):
        if t > simultaneous and (not merged or t - merged[-1] > simultaneous):
            merged.append(t)
    merged[-1] = 1.0
    return np.array(merged)


def active_at(arcs: list[MotorArc], t: float) -> ActiveLimits:
    """The active limits of one motor at a time t, a fraction of the duration."""
    return next((arc for arc in arcs if t < arc.end), arcs[-1]).limits


def number_active(arc: Arc) -> int:
    """How many limits are active on an arc, of all motors and orders."""
    return sum(motor.number for motor in arc)


def determined(structure: SwitchingStructure) -> SwitchingStructure:
    """The structure with no more active limits on any arc than there are motors, so that no arc is
    overdetermined. Controls are given up first, those of motors at a limit of their state before
    others, then velocities. Neighbouring arcs that are alike then become one."""
    lengths: list[float] = []
    arcs: list[Arc] = []
    for length, arc in zip(structure.lengths.tolist(), structure.limits, strict=True):
        fewer = _determined(arc)
        if arcs and all(now.continues(was) for was, now in zip(arcs[-1], fewer, strict=True)):
            lengths[-1] += length
        else:
            lengths.append(length)
            arcs.append(fewer)
    return SwitchingStructure(np.array(lengths), tuple(arcs))


def _determined(arc: Arc) -> Arc:
    limits = list(arc)
    for k in sorted(range(len(arc)), key=lambda k: not any(arc[k].states)):
        if number_active(tuple(limits)) > len(arc):
            limits[k] = limits[k]._replace(control=0)
    for k in range(len(arc)):
        if number_active(tuple(limits)) > len(arc):
            limits[k] = limits[k].with_state(1, 0)
    return tuple(limits)


def without_short_arcs(
    structure: SwitchingStructure, ends: Array, control: Array, widest: int
) -> SwitchingStructure:
    """The structure without arcs of ``widest`` intervals at most on which fewer limits are active
    than around, or more than there are motors.

    ``ends``: of the intervals, (N + 1,), fractions of the duration. ``control``: mean control rows
    in the intervals, (N, m).
    """
    kept = _kept(structure, ends, widest)
    beginnings, limits = [0.0], [structure.limits[kept[0]]]
    for a, c in pairwise(kept):
        now = list(structure.limits[a])
        for k, instant in _changes(structure, (a, c), _jump(structure, (a, c), ends, control)):
            now[k] = structure.limits[c][k]
            if instant - beginnings[-1] > SIMULTANEOUS:
                beginnings.append(instant)
                limits.append(tuple(now))
            else:
                limits[-1] = tuple(now)
    return determined(SwitchingStructure(np.diff([*beginnings, 1.0]), tuple(limits)))


def _kept(structure: SwitchingStructure, ends: Array, widest: int) -> list[int]:
    """The arcs that stay, the others taken out the shortest first."""
    m, to = len(structure.limits[0]), np.cumsum(structure.lengths)
    begin, active = to - structure.lengths, [number_active(arc) for arc in structure.limits]
    kept = list(range(len(to)))
    while True:
        alike = [list(run) for _, run in groupby(kept, lambda a: active[a])]
        short = []
        for run, before, after in zip(alike, [[], *alike[:-1]], [*alike[1:], []], strict=True):
            around = [active[side[0]] for side in (before, after) if side]
            fewer = bool(around) and active[run[0]] < min(around)
            inside = (ends > begin[run[0]] + _SAME) & (ends < to[run[-1]] - _SAME)
            if (fewer or active[run[0]] > m) and inside.sum() < widest:
                short.append((to[run[-1]] - begin[run[0]], run))
        if not short or len(alike) == 1:
            return kept
        _, shortest = min(short)
        kept = [a for a in kept if a not in shortest]


def _changes(
    structure: SwitchingStructure, arcs: tuple[int, int], jump: float
) -> list[tuple[int, float]]:
    """Motors whose limits change from one kept arc to the next, and when, in the order of time. A
    control that goes from one limit to the other keeps its own instant, which detection knows from
    its mean; all else changes at the instant ``jump``."""
    a, c = arcs
    instants = {}
    for k, (before, after) in enumerate(zip(structure.limits[a], structure.limits[c], strict=True)):
        if before == after:
            continue
        instants[k] = jump
        if before.control * after.control < 0 and before[1:] == after[1:]:
            arc = next(i for i in range(a, c + 1) if structure.limits[i][k] == after)
            instants[k] = float((np.cumsum(structure.lengths) - structure.lengths)[arc])
    return sorted(instants.items(), key=lambda item: item[1])


def _jump(
    structure: SwitchingStructure, arcs: tuple[int, int], ends: Array, control: Array
) -> float:
    """When controls come to or leave their limits between two kept arcs, from their means in the
    intervals of the gap and those next to it; the middle of the gap if they do not say."""
    to, (a, c) = np.cumsum(structure.lengths), arcs
    gap = float(to[a]), float((to - structure.lengths)[c])
    first, last = (int(np.searchsorted(ends, t - _SAME)) for t in gap)
    length = gap[1] - gap[0]
    if first == last:
        return sum(gap) / 2
    mean = np.diff(ends[first : last + 1]) @ control[first:last] / (ends[last] - ends[first])
    instants, weights = [], []
    before, after = (structure.limits[a] for a in arcs)
    for k, (was, becomes) in enumerate(zip(before, after, strict=True)):
        if bool(was.control) == bool(becomes.control):
            continue
        low = was.control or control[max(first - 1, 0), k]
        high = becomes.control or control[min(last, len(control) - 1), k]
        if abs(high - low) > _CLEAR:
            share = min(max((high - mean[k]) / (high - low), 0.0), 1.0)
            instants.append(gap[0] + length * share)
            weights.append(abs(high - low))
    return float(np.average(instants, weights=weights)) if instants else sum(gap) / 2
