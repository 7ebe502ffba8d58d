"""Detection of the switching structure of a motion from its solution on a mesh.

A mesh shows where controls and states are at their limits, and its multipliers which of these
limits matter. What begins and ends within a few intervals is blurred there: jumps of controls are
put where their mean over the blurred intervals says, and switches that are one but are detected an
interval or two apart are put together (``without_short_arcs``).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.switching.structure import (
    INACTIVE,
    SIMULTANEOUS,
    ActiveLimits,
    MotorArc,
    Signs,
    SwitchingStructure,
    active_at,
    assembled,
    joined,
    without_short_arcs,
)

_POSITION = 0.999
"""Row of a position limit from which on it counts as active, everywhere in an interval. Positions
come to a limit with zero velocity, so that they are near it long before they are at it."""
_NEGLIGIBLE = 1e-5
"""Least multiplier of an active state limit, summed over its arc, as a fraction of the duration:
the tolerance below which an arc or contact point could be missed without being noticed."""
_SMALL = 5e-3
"""Least multiplier of an active state limit per time, relative to the mean over the time in which
it seems active. A larger value splits arcs in the middle, a smaller one makes them too long."""
_CONCENTRATED = 0.9
"""Part of the summed multiplier that lies in two neighbouring intervals at a contact point: shorter
arcs are taken for contact points, and contact points that a mesh blurs more for arcs."""


@dataclass(frozen=True)
class DetectionSettings:
    """Thresholds of detection.

    ``widest``: number of intervals; a longer time between two limits of a control is an arc, a
    shorter one a blurred switch. ``control``, ``velocity``: rows from which on a limit counts as
    active, everywhere in an interval; controls come to a limit in a jump, and coarse polynomials
    leave some of it unused, velocities come gradually. ``multiplier``: least multiplier of an
    active limit of a control, relative to the largest.
    """

    widest: int = 3
    control: float = 0.9
    velocity: float = 0.99
    multiplier: float = 0.0


STANDARD = (DetectionSettings(), DetectionSettings(multiplier=3e-4))
"""For a coarse mesh, to be tried one after the other."""
SHARP = (
    DetectionSettings(control=0.99, velocity=0.9999),
    DetectionSettings(control=0.99, velocity=0.9999, widest=8),
    DetectionSettings(velocity=0.9999, multiplier=5e-5),
    DetectionSettings(velocity=0.9999, multiplier=5e-5, widest=8),
)
"""For a fine mesh, where active limits are met almost exactly."""
BY_MULTIPLIERS = (
    DetectionSettings(control=0.5, velocity=0.9999, multiplier=1e-4),
    DetectionSettings(control=0.5, velocity=0.9999, multiplier=1e-5),
    DetectionSettings(control=0.5, velocity=0.9999, multiplier=1e-4, widest=1),
    DetectionSettings(control=0.5, velocity=0.9999, multiplier=1e-5, widest=8),
    DetectionSettings(control=0.5, velocity=0.9999, multiplier=1e-3),
    *SHARP,
)
"""For the finest mesh, whose multipliers say which limits are active."""


def detect_structure(
    mesh: Array,
    rows: ByOrder,
    settings: DetectionSettings = STANDARD[0],
    multipliers: ByOrder | None = None,
) -> SwitchingStructure:
    """The switching structure of a motion on a mesh of interval lengths (N,), as fractions of the
    duration.

    ``rows``: normalised rows inside the intervals, (N, points, m) each. ``multipliers``: of the
    intervals, per time, in fractions of the duration, (N, m) each; without them every limit that a
    motion is at counts as active.
    """
    ends = np.concatenate([[0.0], np.cumsum(mesh)])
    ends[-1] = 1.0
    control, states, contacts = _active(ends, rows, settings, multipliers)
    m = control.shape[1]
    complete = np.abs(control).sum(axis=1) + np.abs(states).sum(axis=(1, 2)) == m
    mean, motors = rows.control.mean(axis=1), []
    for k in range(m):
        arcs = _without_blur(ends, control[:, k], mean[:, k], complete, settings.widest)
        motors.append(_with_states(ends, arcs, states[:, k], contacts[k]))
    structure = assembled(motors, SIMULTANEOUS)
    return without_short_arcs(structure, ends, mean, settings.widest)


def _active(
    ends: Array, rows: ByOrder, settings: DetectionSettings, multipliers: ByOrder | None
) -> tuple[Signs, Signs, list[dict[float, ActiveLimits]]]:
    """Signs of active controls, (N, m), and of active state limits by order, (N, m, 2), and contact
    points of each motor by their instants."""
    N, _, m = rows.control.shape
    control = _at_limit(rows.control, settings.control)
    states = np.zeros((N, m, 2), np.int8)
    for order, at_limit in enumerate((_POSITION, settings.velocity)):
        if (of_state := rows.states[order]) is not None:
            states[..., order] = _at_limit(of_state, at_limit)
    contacts: list[dict[float, ActiveLimits]] = [{} for _ in range(m)]
    if multipliers is None:
        return control, states, contacts
    weight = np.abs(multipliers.control)
    enough = multipliers.control * control > settings.multiplier * weight.max()
    for order, of_state in enumerate(multipliers.states):
        for k in range(m):
            own = np.zeros(N) if of_state is None else of_state[:, k]
            states[:, k, order], found = _with_multipliers(ends, states[:, k, order], own)
            for t, sign in found:
                contacts[k][t] = contacts[k].get(t, INACTIVE).with_contact(order, sign)
    return np.where(enough, control, 0), states, contacts


def _at_limit(row: Array, at_limit: float) -> Signs:
    """Sign of the limit at which a row (N, points, m) is everywhere in an interval, (N, m)."""
    upper, lower = row.min(axis=1) > at_limit, row.max(axis=1) < -at_limit
    return np.asarray(upper, np.int8) - np.asarray(lower, np.int8)


def _with_multipliers(
    ends: Array, seems: Signs, multiplier: Array
) -> tuple[Signs, list[tuple[float, int]]]:
    """Where a state limit that seems active has a multiplier, (N,), and its contact points, each
    (instant, sign). Where its multiplier is negligible for a while in between it is inactive."""
    active, contacts = np.zeros_like(seems), []
    total = np.abs(multiplier) * np.diff(ends)
    for i, j, sign in _runs(seems):
        if not sign or total[i:j].sum() < _NEGLIGIBLE:
            continue
        large = np.abs(multiplier[i:j]) > _SMALL * total[i:j].sum() / (ends[j] - ends[i])
        for begin, end, is_large in _runs(large.astype(np.int8)):
            own = total[i + begin : i + end]
            if not is_large or own.sum() < _NEGLIGIBLE:
                continue
            if (own[1:] + own[:-1]).max(initial=own[0]) > _CONCENTRATED * own.sum():
                middles = (ends[:-1] + ends[1:])[i + begin : i + end] / 2
                contacts.append((float(own @ middles / own.sum()), sign))
            else:
                active[i + begin : i + end] = sign
    return active, contacts


def _runs(signs: Signs) -> list[tuple[int, int, int]]:
    """Runs of equal neighbours, each (first, end, value)."""
    edges = [0, *(np.flatnonzero(np.diff(signs)) + 1).tolist(), len(signs)]
    return [(i, j, int(signs[i])) for i, j in pairwise(edges)]


def _without_blur(
    ends: Array, active: Signs, control: Array, complete: Truths, widest: int
) -> list[MotorArc]:
    """Arcs of one motor's control without the short times between limits, unless enough other
    limits are active there (``complete``): the neighbouring arcs meet at an instant, or the control
    jumps to its other limit and back."""
    runs, kept = _runs(active), []
    for r, (i, j, sign) in enumerate(runs):
        if sign or j - i > widest or complete[i:j].any() or len(runs) == 1:
            kept.append(MotorArc(float(ends[i]), float(ends[j]), ActiveLimits(sign)))
            continue
        before = runs[r - 1][2] if r else 0
        after = runs[r + 1][2] if r + 1 < len(runs) else 0
        mean = float(control[i:j] @ np.diff(ends[i : j + 1]) / (ends[j] - ends[i]))
        kept += _jumps(float(ends[i]), float(ends[j]), mean, before, after)
    return joined(kept)


def _jumps(begin: float, end: float, mean: float, before: int, after: int) -> list[MotorArc]:
    """Arcs at limits only, whose control has the same mean as was found from ``begin`` to ``end``.
    ``before``, ``after``: limits of the neighbours, 0 where there is none."""
    first, last, length = before or after, after or before, end - begin
    if first != last:
        share = min(max((mean - last) / (first - last), 0.0), 1.0)
        instants, signs = [begin, begin + length * share, end], [first, last]
    else:
        half = length * min(max((1 - mean * first) / 4, 0.0), 0.5)
        middle = begin if not before else end if not after else (begin + end) / 2
        if not before or not after:
            half *= 2
        there, back = max(middle - half, begin), min(middle + half, end)
        instants, signs = [begin, there, back, end], [first, -first, last]
    return [
        MotorArc(*times, ActiveLimits(sign))
        for times, sign in zip(pairwise(instants), signs, strict=True)
    ]


def _with_states(
    ends: Array, control: list[MotorArc], states: Signs, contacts: dict[float, ActiveLimits]
) -> list[MotorArc]:
    """Arcs of one motor: those of its control, its active state limits (N, 2) and its contact
    points together."""
    changes = np.flatnonzero(np.diff(states, axis=0).any(axis=1)) + 1
    instants = {arc.end for arc in control} | set(ends[changes].tolist()) | set(contacts)
    arcs, begin = [], 0.0
    for end in sorted(instants):
        middle = (begin + end) / 2
        interval = min(int(np.searchsorted(ends, middle)), len(states)) - 1
        limits = contacts.get(begin, INACTIVE)._replace(
            control=active_at(control, middle).control, states=tuple(states[interval].tolist())
        )
        arcs.append(MotorArc(begin, end, limits))
        begin = end
    return arcs
