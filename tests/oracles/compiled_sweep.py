"""The compiled sweep alone, which plans call together with all that is done on a mesh."""

from __future__ import annotations

import ctypes

import numpy as np

from deltaopt.planning.path import sweep
from deltaopt.planning.path.path_rows import AffineRows
from deltaopt.planning.path.sweep import FASTEST, Speeds, Unattainable


def compiled_sweep(
    h: np.ndarray, rows: AffineRows, start: float, goal: float, *, convex: bool = True
) -> Speeds:
    """What ``swept`` finds by a linear program, which stands in without a compiler."""
    code, n = sweep.compiled(), len(h)
    if code is None:
        return sweep.swept(h, rows, start, goal, convex=convex)
    length, largest = float(h.sum()), float(np.abs(rows.alpha).max()) or 1.0
    b_unit = length / largest
    given = [h / length, rows.alpha / largest, rows.beta * b_unit, rows.low, rows.high]
    arrays = [np.ascontiguousarray(each, dtype=float) for each in given]
    b, u, memory = np.empty(n + 1), np.empty((n, 2)), np.empty((n + 1, 3))
    size, number = ctypes.c_int64, ctypes.c_double
    code.sweep.restype = size
    status = code.sweep(
        *map(size, (n, rows.alpha.shape[1], convex)),
        *(ctypes.c_void_p(each.ctypes.data) for each in arrays),
        *map(number, (start / b_unit, goal / b_unit, FASTEST)),
        *(ctypes.c_void_p(each.ctypes.data) for each in (b, u, memory)),
    )
    if status:
        raise Unattainable(status - 1 if status > 0 else None)
    return Speeds(b * b_unit, u / largest)
