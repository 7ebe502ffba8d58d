"""Transcription: motions as piecewise polynomials of the variables on a mesh.

In every interval the acceleration is a polynomial through its values at Lobatto's nodes, both ends
included. It may jump at the knots, as bang-bang torques do. Position and velocity follow by
integration, so that there are no defect constraints inside an interval.

With X = x, V = T v and A = T² a, T the duration, the motion is linear in the variables. In an
interval whose length is the fraction η of T:

    X(c) = X_i + η c V_i + η² Σ_j  l̿_j(c) A_ij
    V(c) = V_i + η Σ_j l̄_j(c) A_ij
    A(c) = Σ_j l_j(c) A_ij                            c from 0 to 1, l_j Lagrange's polynomials
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.typing import ArrayLike

from deltaopt.curves.nodes import lagrange
from deltaopt.curves.piecewise import Array


@dataclass(frozen=True)
class PiecewiseAcceleration:
    """Accelerations that are polynomials of a ``degree`` in every interval.

    ``between``: points, fractions of the interval, where limits are imposed beside the nodes. More
    of them make a motion exceed its limits less between points, but every one has its own rows.

    Examples:
        >>> deltaopt.PiecewiseAcceleration(degree=2).degree
        2
    """

    degree: int = 1
    between: tuple[float, ...] = (1 / 3, 2 / 3)

    @property
    def name(self) -> str:
        return f"acceleration of degree {self.degree}"

    @cached_property
    def quadrature(self) -> Array:
        """Lobatto's weights at the nodes, summing to 1."""
        return np.array([p.integ()(1.0) for p in self._lagrange])

    @cached_property
    def nodes(self) -> Array:
        """Lobatto's nodes, degree + 1, from 0 to 1."""
        inner = np.sort(Legendre.basis(self.degree).deriv().roots().real)
        return np.concatenate([[0.0], (inner + 1) / 2, [1.0]])

    @cached_property
    def points(self) -> Array:
        """Fractions of an interval where limits are imposed: the nodes and those between."""
        return np.unique(np.concatenate([self.nodes, self.between]))

    @cached_property
    def velocity_points(self) -> Array:
        """Fractions of an interval where limits of velocity are imposed: degree + 1 of them.

        The velocity has as many coefficients of its own in an interval, for it continues that of
        the interval before. More rows would be linearly dependent when all are active (LICQ).
        """
        return np.arange(1, self.degree + 2) / (self.degree + 1)

    @cached_property
    def _lagrange(self) -> list[Polynomial]:
        return lagrange(self.nodes)

    def weights(self, c: ArrayLike, eta: ArrayLike) -> tuple[Array, Array, Array]:
        """Weights of (X_i, V_i, A_i0 … A_id) in X, V and A at fractions c of intervals η.

        c and eta are broadcast together to a shape S; each result is S + (degree + 3,).
        """
        c, eta = np.broadcast_arrays(np.asarray(c, dtype=float), np.asarray(eta, dtype=float))
        one, zero = np.ones_like(c), np.zeros_like(c)
        acceleration = [p(c) for p in self._lagrange]
        velocity = [eta * p.integ()(c) for p in self._lagrange]
        position = [eta**2 * p.integ(2)(c) for p in self._lagrange]
        return (
            np.stack([one, eta * c, *position], axis=-1),
            np.stack([zero, one, *velocity], axis=-1),
            np.stack([zero, zero, *acceleration], axis=-1),
        )

    def coefficients(self, X: Array, V: Array, A: Array, eta: Array) -> Array:
        """Coefficients of the position in powers of the time since an interval began, units of T.

        X, V: at the beginnings of the intervals, (N, m). A: at the nodes, (N, degree + 1, m). eta:
        lengths of the intervals, (N,). Returns (N, degree + 3, m).
        """
        powers: Array = np.stack([p.coef for p in self._lagrange])  # (node, power)
        i = np.arange(self.degree + 1)
        integrated = powers.T @ A / ((i + 1) * (i + 2))[:, None]
        integrated /= np.vander(eta, self.degree + 1, increasing=True)[:, :, None]
        return np.concatenate([X[:, None], V[:, None], integrated], axis=1)


LINEAR = PiecewiseAcceleration()
QUADRATIC = PiecewiseAcceleration(2, (0.25, 0.75))
CUBIC = PiecewiseAcceleration(3, (0.1, 0.5, 0.9))
TRANSCRIPTIONS = {"linear": LINEAR, "quadratic": QUADRATIC, "cubic": CUBIC}
"""The transcriptions by name, with limits at four, five and seven points of an interval."""
