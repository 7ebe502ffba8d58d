"""The structure of a motion, read from its solution on a mesh.

A mesh shows where torques and speeds are at their limits, and its prices which of these limits
matter. What begins and ends within a few intervals is smeared there: jumps of torque are put where
their impulse says, and what begins at one instant but is read too early or too late is put together
(``smears``).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.switching.short_arcs import without_smears
from deltaopt.planning.switching.structure import (
    FREE,
    Limit,
    Signs,
    Stretch,
    Structure,
    Truths,
    assembled,
    at,
    joined,
)

Array = NDArray[np.float64]

_SIMULTANEOUS = 2e-4
"""Of the duration: switches that are read closer to each other are one."""
_OPENING_AT_MARGIN = 1e-3
"""At most, everywhere in an interval."""
_WORTHLESS, _DEAR = 1e-5, 5e-3
"""What a limit of the state costs at least where it holds, of the duration; and per time, of
the mean while it seems to hold."""
_CONCENTRATED = 0.9
"""Part of the price that is in two intervals where a limit is touched and no more."""


@dataclass(frozen=True)
class Reading:
    """How a mesh is read.

    ``widest``: intervals; what is wider between two limits is no smeared switch but an arc.
    ``torque``, ``speed``: of a load that is at its limit, everywhere in an interval. Torque comes
    to its limit in a jump, and coarse polynomials leave some of it unused; speed comes gradually.
    ``price``: of a torque that is at its limit, at least, of the largest. ``apart``: whether a
    limit of the state that costs nothing for a while is left in between.
    """

    widest: int = 3
    torque: float = 0.9
    speed: float = 0.99
    price: float = 0.0
    apart: bool = True


USUAL = (Reading(), Reading(price=3e-4), Reading(apart=False), Reading(price=3e-4, apart=False))
"""How to read a mesh, one way after the other."""
SHARP = (
    Reading(torque=0.99, speed=0.9999),
    Reading(torque=0.99, speed=0.9999, widest=8),
    Reading(speed=0.9999, price=5e-5),
    Reading(speed=0.9999, price=5e-5, widest=8),
    Reading(torque=0.99, speed=0.9999, apart=False),
    Reading(speed=0.9999, price=5e-5, apart=False),
)
"""The same where next to nothing is given away."""
FINE = (
    Reading(torque=0.5, speed=0.9999, price=1e-4),
    Reading(torque=0.5, speed=0.9999, price=1e-5),
    Reading(torque=0.5, speed=0.9999, price=1e-4, widest=1),
    Reading(torque=0.5, speed=0.9999, price=1e-5, widest=8),
    Reading(torque=0.5, speed=0.9999, price=1e-3),
    *SHARP,
)
"""The same where nothing is left to be gained: prices say what is at a limit."""


@dataclass(frozen=True)
class Prices:
    """What limits cost in the intervals of a mesh, per time, fractions of the duration, positive at
    an upper limit: of ``torque``, (N, m), and of speeds and openings, ``states``, (N, m, 2), these
    per fraction of a limit and per unit of sin² of a fold."""

    torque: Array
    states: Array


def read_structure(
    mesh: Array,
    torque: Array,
    speed: Array | None,
    opening: Array | None = None,
    reading: Reading = USUAL[0],
    prices: Prices | None = None,
) -> Structure:
    """From loads in the intervals of a mesh (N,), fractions of their limits, (N, points, m),
    from how far chains are from the margin of their fold, and from what limits cost."""
    ends = np.concatenate([[0.0], np.cumsum(mesh)])
    ends[-1] = 1.0
    m = torque.shape[2]
    states = np.zeros((len(mesh), m, 2), np.int8)
    if speed is not None:
        states[..., 0] = _held(speed, reading.speed)
    if opening is not None:
        states[..., 1] = opening.max(axis=1) < _OPENING_AT_MARGIN
    touches: list[dict[float, Limit]] = [{} for _ in range(m)]
    torques = _held(torque, reading.torque)
    weight = np.abs(torque).min(axis=1)
    if prices is not None:
        weight = np.abs(prices.torque)
        torques = np.where(prices.torque * torques > reading.price * weight.max(), torques, 0)
        for k in range(m):
            (at_speed, speeds), (at_margin, openings) = (
                _paid_for(ends, states[:, k, kind], prices.states[:, k, kind], reading)
                for kind in (0, 1)
            )
            states[:, k] = np.stack([at_speed, at_margin], axis=1)
            touches[k] = {t: Limit(grazed=sign) for t, sign in speeds}
            for t, _ in openings:
                touches[k][t] = touches[k].get(t, FREE)._replace(touched=1)
    torques = _possible(torques, states, weight)
    complete = np.abs(torques).sum(axis=1) + np.abs(states).sum(axis=(1, 2)) == m
    mean, motors = torque.mean(axis=1), []
    for k in range(m):
        sharp = _sharpened(ends, torques[:, k], mean[:, k], complete, reading.widest)
        motors.append(_together(ends, sharp, states[:, k], touches[k]))
    structure = assembled(motors, _SIMULTANEOUS)
    return without_smears(structure, ends, mean, reading.widest, _SIMULTANEOUS)


def _held(load: Array, at_limit: float) -> Signs:
    """The limit that holds all over an interval, (N, m)."""
    upper, lower = load.min(axis=1) > at_limit, load.max(axis=1) < -at_limit
    return np.asarray(upper, np.int8) - np.asarray(lower, np.int8)


def _paid_for(
    ends: Array, seems: Signs, price: Array, reading: Reading
) -> tuple[Signs, list[tuple[float, int]]]:
    """Where a limit of the state that seems to hold costs something, (N,), and when one is touched
    and no more, and which."""
    held, touches, cost = np.zeros_like(seems), [], np.abs(price) * np.diff(ends)
    for i, j, sign in _runs(seems):
        if not sign or cost[i:j].sum() < _WORTHLESS:
            continue
        dear = np.abs(price[i:j]) > _DEAR * cost[i:j].sum() / (ends[j] - ends[i])
        if not reading.apart:
            found = np.flatnonzero(dear)
            dear[found[0] : found[-1] + 1] = True
        for begin, end, is_dear in _runs(dear.astype(np.int8)):
            own = cost[i + begin : i + end]
            if not is_dear or own.sum() < _WORTHLESS:
                continue
            if (own[1:] + own[:-1]).max(initial=own[0]) > _CONCENTRATED * own.sum():
                middles = (ends[:-1] + ends[1:])[i + begin : i + end] / 2
                touches.append((float(own @ middles / own.sum()), sign))
            else:
                held[i + begin : i + end] = sign
    return held, touches


def _runs(signs: Signs) -> list[tuple[int, int, int]]:
    """(first, end, value) of equal neighbours."""
    edges = [0, *(np.flatnonzero(np.diff(signs)) + 1).tolist(), len(signs)]
    return [(i, j, int(signs[i])) for i, j in pairwise(edges)]


def _possible(torques: Signs, states: Signs, weight: Array) -> Signs:
    """Torques at their limits (N, m), at most as many as motors less the speeds and openings
    that are held: those of the lowest weights give way."""
    torques, m = torques.copy(), torques.shape[1]
    room = m - np.abs(states).sum(axis=(1, 2))
    for i in np.flatnonzero(np.abs(torques).sum(axis=1) > room).tolist():
        first = sorted(np.flatnonzero(torques[i]), key=lambda k: weight[i, k])
        torques[i, first[: len(first) - max(int(room[i]), 0)]] = 0
    return torques


def _sharpened(
    ends: Array, held: Signs, torque: Array, complete: Truths, widest: int
) -> list[Stretch]:
    """What holds one motor's torque, without the short stretches between limits, if nothing else
    holds there what is missing (``complete``): their neighbours meet at an instant, or torque jumps
    to the other limit and back."""
    runs, kept = _runs(held), []
    for r, (i, j, sign) in enumerate(runs):
        if sign or j - i > widest or complete[i:j].any() or len(runs) == 1:
            kept.append(Stretch(float(ends[i]), float(ends[j]), Limit(sign)))
            continue
        before = runs[r - 1][2] if r else 0
        after = runs[r + 1][2] if r + 1 < len(runs) else 0
        mean = float(torque[i:j] @ np.diff(ends[i : j + 1]) / (ends[j] - ends[i]))
        kept += _sharp(float(ends[i]), float(ends[j]), mean, before, after)
    return joined(kept)


def _sharp(begin: float, end: float, mean: float, before: int, after: int) -> list[Stretch]:
    """Limits instead of a stretch without: where the impulse of torque says. ``before``, ``after``:
    limits of the neighbours, 0 where there is none."""
    first, last, length = before or after, after or before, end - begin
    if first != last:
        share = min(max((mean - last) / (first - last), 0.0), 1.0)
        instants, limits = [begin, begin + length * share, end], [first, last]
    else:
        half = length * min(max((1 - mean * first) / 4, 0.0), 0.5)
        middle = begin if not before else end if not after else (begin + end) / 2
        if not before or not after:
            half *= 2
        there, back = max(middle - half, begin), min(middle + half, end)
        instants, limits = [begin, there, back, end], [first, -first, last]
    return [
        Stretch(*times, Limit(sign)) for times, sign in zip(pairwise(instants), limits, strict=True)
    ]


def _together(
    ends: Array, torque: list[Stretch], states: Signs, touches: dict[float, Limit]
) -> list[Stretch]:
    """What holds one motor when: its torque, its speed or its opening, ``states``, (N, 2)."""
    changes = np.flatnonzero(np.diff(states, axis=0).any(axis=1)) + 1
    instants = {s.end for s in torque} | set(ends[changes].tolist()) | set(touches)
    both, begin = [], 0.0
    for end in sorted(instants):
        middle = (begin + end) / 2
        interval = min(int(np.searchsorted(ends, middle)), len(states)) - 1
        speed, opening = states[interval].tolist()
        limit = touches.get(begin, FREE)._replace(speed=speed, opening=opening)
        both.append(Stretch(begin, end, limit._replace(torque=at(torque, middle).torque)))
        begin = end
    return both
