"""Smeared switches: short arcs of a structure that was read which are not there.

Where an arc ends several things may change at one instant, as when a motor comes to its speed
limit and another's torque leaves its own to hold it there. A mesh shows them an interval or two
apart, and an arc between them that holds less than those around, or more than there are motors.
"""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.switching.structure import Arc, Structure, bearable, held_on

Array = NDArray[np.float64]

_SAME = 1e-9
"""Of the duration."""
_CLEAR = 0.1
"""Of its limit: a torque that jumps by less does not say when."""


def without_smears(
    structure: Structure, ends: Array, torque: Array, widest: int, simultaneous: float
) -> Structure:
    """Without the short arcs, of ``widest`` intervals at most, that hold less than those around, or
    more than there are motors.

    ``ends``: of the intervals, (N + 1,); ``torque``: its mean in these, fractions of the limit, (N,
    m); ``simultaneous``: times that make no difference.
    """
    m, to = len(structure.limits[0]), np.cumsum(structure.lengths)
    begin, kept = to - structure.lengths, _kept(structure, ends, widest)
    beginnings, limits = [0.0], [structure.limits[kept[0]]]
    for a, c in pairwise(kept):
        before, after = structure.limits[a], structure.limits[c]
        jump = _jump(before, after, (float(to[a]), float(begin[c])), ends, torque)
        instants = {k: jump for k in range(m) if before[k] != after[k]}
        for k in instants:
            if before[k].torque * after[k].torque < 0 and before[k][1:] == after[k][1:]:
                arc = next(i for i in range(a, c + 1) if structure.limits[i][k] == after[k])
                instants[k] = float(begin[arc])  # its impulse says so
        now = list(before)
        for k, instant in sorted(instants.items(), key=lambda item: item[1]):
            now[k] = after[k]
            if instant - beginnings[-1] > simultaneous:
                beginnings.append(instant)
                limits.append(tuple(now))
            else:
                limits[-1] = tuple(now)
    return bearable(Structure(np.diff([*beginnings, 1.0]), tuple(limits)))


def _kept(structure: Structure, ends: Array, widest: int) -> list[int]:
    """The arcs that are there, the others taken away the shortest first."""
    m, to = len(structure.limits[0]), np.cumsum(structure.lengths)
    begin, held = to - structure.lengths, [held_on(arc) for arc in structure.limits]
    kept = list(range(len(to)))
    while True:
        alike = [list(run) for _, run in groupby(kept, lambda a: held[a])]
        smears = []
        for run, before, after in zip(alike, [[], *alike[:-1]], [*alike[1:], []], strict=True):
            around = [held[side[0]] for side in (before, after) if side]
            less = bool(around) and held[run[0]] < min(around)
            inside = (ends > begin[run[0]] + _SAME) & (ends < to[run[-1]] - _SAME)
            if (less or held[run[0]] > m) and inside.sum() < widest:
                smears.append((to[run[-1]] - begin[run[0]], run))
        if not smears or len(alike) == 1:
            return kept
        _, smear = min(smears)
        kept = [a for a in kept if a not in smear]


def _jump(before: Arc, after: Arc, smear: tuple[float, float], ends: Array, torque: Array) -> float:
    """When torques come to or leave their limits, from their means in the intervals of a smear
    and those next to it; its middle if they do not say."""
    first, last = (int(np.searchsorted(ends, t - _SAME)) for t in smear)
    length = smear[1] - smear[0]
    if first == last:
        return sum(smear) / 2
    mean = np.diff(ends[first : last + 1]) @ torque[first:last] / (ends[last] - ends[first])
    instants, weights = [], []
    for k, (was, becomes) in enumerate(zip(before, after, strict=True)):
        if bool(was.torque) == bool(becomes.torque):
            continue
        low = was.torque or torque[max(first - 1, 0), k]
        high = becomes.torque or torque[min(last, len(torque) - 1), k]
        if abs(high - low) > _CLEAR:
            share = min(max((high - mean[k]) / (high - low), 0.0), 1.0)
            instants.append(smear[0] + length * share)
            weights.append(abs(high - low))
    return float(np.average(instants, weights=weights)) if instants else sum(smear) / 2
