"""How well a motion meets Pontryagin's necessary condition of optimality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MET = 1e-3
"""Residual up to which Pontryagin's condition counts as met: a motion further off is not drawn with
switching functions, and carries no certificate."""


@dataclass(frozen=True)
class Certificate:
    """How well Pontryagin's condition is met; both without dimension, 0 at best. On a mesh it is
    as ``adjoint`` says.

    ``hamiltonian_spread``: max |H - mean H| over both ends of all intervals, as a fraction of
    |mean H| or of the largest rate of a running cost, if that is more.
    ``sign_violation``: largest price of a wrong sign at a held torque, or of any at a torque that
    no limit holds, over the largest price; or what ``state_prices`` finds wrong, if that is more.
    """

    hamiltonian_spread: float
    sign_violation: float

    @property
    def residual(self) -> float:
        """The larger of both."""
        return max(self.hamiltonian_spread, self.sign_violation)


def spread(H: Array, rate: float = 0.0) -> float:
    """max |H - mean H| over |mean H|, or over the largest rate of a running cost, if more."""
    return float(np.abs(H - H.mean()).max()) / max(float(abs(H.mean())), rate)
