"""Dense linear systems of about a hundred unknowns, solved on one core.

NumPy's solver spreads such systems over all cores. That takes longer than on one core, and hundreds
of times as long while other processes use the cores.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from deltaopt.codegen.compile import library
from deltaopt.curves.piecewise import Array

C_TEXT = (files("deltaopt.codegen") / "dense_solver.c").read_text()


def solve(matrix: Array, right: Array) -> Array | None:
    """Solve ``matrix`` (n, n) times x = ``right`` (n,) for x, (n,), by Gaussian elimination.

    Returns None if the matrix is singular. Without a compiler NumPy's solver is used.
    """
    code = _code()
    if code is None:
        try:
            return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        except np.linalg.LinAlgError:
            return None
    n = len(right)
    width = (n + 4) // 4 * 4
    rows = np.zeros((n, width))
    rows[:, :n], rows[:, n] = matrix, right
    size = ctypes.c_int64
    done = code.gauss(size(n), size(width), ctypes.c_void_p(rows.ctypes.data))
    return rows[:, n].copy() if done else None


@lru_cache(maxsize=1)
def _code() -> Any:
    built = library(C_TEXT)
    return None if built is None else ctypes.CDLL(str(built))
