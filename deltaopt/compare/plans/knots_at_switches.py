"""Meshes with knots where the solution on the mesh before switches.

An interval in which a torque jumps gives time away in proportion to the square of its length;
splitting it costs many short intervals, in which the torques are then hardly determined. With a
knot at the switch nothing is given away there, and intervals need only be as short as the
smooth arcs between switches ask for.
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.mesh.error_estimate import ErrorEstimate
from deltaopt.planning.switching.detection import detect_structure

_FINEST = 4.0
"""Into how many one interval becomes at most."""


def at_switches(mesh: Array, rows: ByOrder, lost: ErrorEstimate, aim: float) -> Array:
    """Return the mesh, (N,) fractions of the duration, for the solve after this one: a knot at
    every switch, arcs between them divided so that what is given away falls to about ``aim``.

    ``rows``: of controls and velocities inside the intervals, normalised, (N, points, m) each.
    """
    switches = np.cumsum(detect_structure(mesh, rows).lengths)
    switches[-1] = 1.0
    ends = np.append(0.0, np.cumsum(mesh))
    ends[-1] = 1.0
    pieces = _pieces(mesh, ends, switches, lost, aim)
    passed = np.append(0.0, np.cumsum(pieces))
    knots = [0.0]
    for end in switches:
        first, last = np.interp([knots[-1], end], ends, passed)
        number = max(1, int(np.ceil(last - first - 1e-6)))
        inside = np.interp(np.linspace(first, last, number + 1)[1:-1], passed, ends)
        knots += [*inside.tolist(), float(end)]
    return np.diff(knots)


def _pieces(mesh: Array, ends: Array, switches: Array, lost: ErrorEstimate, aim: float) -> Array:
    """Into how many pieces, whole or not, each interval is to be divided, (N,).

    What is lost falls with the square of the length. Where a switch lies inside an interval
    the loss is the switch's: the intervals beside it tell how fine it has to be.
    """
    share = lost.unused / (aim / len(mesh)) + lost.exceeded / aim
    pieces = np.clip(np.sqrt(share), 1.0, _FINEST)
    inside = (switches > ends[:-1, None] + 1e-9) & (switches < ends[1:, None] - 1e-9)
    smooth = ~inside.any(axis=1)
    if not smooth.any():
        return np.asarray(pieces)
    at, places = np.arange(len(mesh)), np.flatnonzero(smooth)
    after = np.minimum(np.searchsorted(places, at), len(places) - 1)
    before = np.maximum(np.searchsorted(places, at, side="right") - 1, 0)
    density = pieces / mesh
    beside = np.maximum(density[places[before]], density[places[after]])
    return np.asarray(np.where(smooth, pieces, beside * mesh))
