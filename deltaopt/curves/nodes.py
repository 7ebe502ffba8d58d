"""Points of an interval by which functions are integrated, or through which polynomials lead."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import Array


def gauss(number: int) -> tuple[Array, Array]:
    """Gauss's points as fractions of an interval, increasing, and their weights in a mean over it,
    (number,) each: exact for polynomials of degree 2 number - 1."""
    nodes, weights = np.polynomial.legendre.leggauss(number)
    return (nodes + 1) / 2, weights / 2


def lagrange(nodes: Array) -> list[Polynomial]:
    """Lagrange's polynomials: each is 1 at one of the nodes, (n,), and 0 at the others."""
    products = (Polynomial.fromroots(np.delete(nodes, j)) for j in range(len(nodes)))
    return [product / product(node) for product, node in zip(products, nodes, strict=True)]
