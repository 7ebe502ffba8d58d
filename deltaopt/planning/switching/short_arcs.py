"""Removal of short arcs that a mesh shows but that are not there.

Several limits may change at one switch, as when a motor comes to its velocity limit and another's
control leaves its own limit to hold it there. A mesh shows these changes an interval or two apart,
with an arc in between on which fewer limits are active than around it, or more than there are
motors. Such arcs are taken out, and the changes put together at one instant.
"""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.planning.switching.structure import SwitchingStructure, determined, number_active

_SAME = 1e-9
"""Difference of two times, as a fraction of the duration, that is rounding."""
_CLEAR = 0.1
"""Least jump of a control row that says when it happened. With a smaller one the instant is the
mean over noise, with a larger one the middle of the short arc is taken too often."""


def without_short_arcs(
    structure: SwitchingStructure,
    ends: Array,
    control: Array,
    widest: int,
    simultaneous: float,
) -> SwitchingStructure:
    """The structure without arcs of ``widest`` intervals at most on which fewer limits are active
    than around, or more than there are motors.

    ``ends``: of the intervals, (N + 1,), and ``simultaneous``: difference of switches that are one;
    both fractions of the duration. ``control``: mean control rows in the intervals, (N, m).
    """
    to = np.cumsum(structure.lengths)
    begin, kept = to - structure.lengths, _kept(structure, ends, widest)
    beginnings, limits = [0.0], [structure.limits[kept[0]]]
    for a, c in pairwise(kept):
        gap = (float(to[a]), float(begin[c]))
        now = list(structure.limits[a])
        for k, instant in _changes(structure, (a, c), _jump(structure, (a, c), gap, ends, control)):
            now[k] = structure.limits[c][k]
            if instant - beginnings[-1] > simultaneous:
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
    structure: SwitchingStructure,
    arcs: tuple[int, int],
    gap: tuple[float, float],
    ends: Array,
    control: Array,
) -> float:
    """When controls come to or leave their limits between two kept arcs, from their means in the
    intervals of the gap and those next to it; the middle of the gap if they do not say."""
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
