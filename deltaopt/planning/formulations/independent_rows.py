"""Which rows of a matrix are linear combinations of others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dependent_rows(A: Array, tolerance: float = 1e-9) -> list[int]:
    """Indices of the rows that are linear combinations of rows before them.

    Found by modified Gram-Schmidt on rows of length 1, done twice for accuracy: the remainder of a
    dependent row is rounding, below ``tolerance``. A row of zeros counts as dependent.
    """
    basis = np.zeros((min(A.shape), A.shape[1]))
    found: list[int] = []
    size = 0
    for i, row in enumerate(A):
        length = float(np.linalg.norm(row))
        rest = row / length if length > 0 else row
        for _ in range(2):
            rest = rest - basis[:size].T @ (basis[:size] @ rest)
        left = float(np.linalg.norm(rest))
        if left <= tolerance:
            found.append(i)
        else:
            basis[size] = rest / left
            size += 1
    return found
