"""Certificates: how well a motion meets Pontryagin's necessary condition of optimality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array

MET = 1e-3
"""Residual up to which Pontryagin's condition counts as met. A motion with a larger one is drawn
without switching functions and gets no certificate."""


@dataclass(frozen=True)
class Certificate:
    """How well a motion meets Pontryagin's condition: two numbers without unit, 0 at best.

    ``hamiltonian_spread``: max |H - mean H| over both ends of all intervals, as a fraction of
    |mean H|, for H is constant along an optimal motion. ``sign_violation``: the largest multiplier
    that has the wrong sign for its active limit, or that is not zero where no limit is active, as a
    fraction of the largest multiplier. On a mesh both are as ``planning.mesh.mesh_costates`` says,
    with resolved switches as ``planning.switching.residuals``.
    """

    hamiltonian_spread: float
    sign_violation: float

    @property
    def residual(self) -> float:
        """The larger of the two numbers."""
        return max(self.hamiltonian_spread, self.sign_violation)


def spread(H: Array) -> float:
    """The spread of the Hamiltonian: max |H - mean H| over |mean H|."""
    return float(np.abs(H - H.mean()).max() / abs(H.mean()))
