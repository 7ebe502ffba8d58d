"""Points of an interval by which functions are integrated, or through which polynomials lead."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import Array


@lru_cache(maxsize=32)
def gauss(number: int) -> tuple[Array, Array]:
    """Gauss's points as fractions of an interval, increasing, and their weights in a mean over it,
    (number,) each: exact for polynomials of degree 2 number - 1."""
    nodes, weights = np.polynomial.legendre.leggauss(number)
    return (nodes + 1) / 2, weights / 2


def lagrange(nodes: Array) -> list[Polynomial]:
    """Lagrange's polynomials: each is 1 at one of the nodes, (n,), and 0 at the others."""
    products = (Polynomial.fromroots(np.delete(nodes, j)) for j in range(len(nodes)))
    return [product / product(node) for product, node in zip(products, nodes, strict=True)]


class Collocation:
    """Of differential equations on an interval: Butcher's ``a``, (s, s), and ``weights``, (s,);
    ``fractions``: the beginning, the nodes, the end, (s + 2,)."""

    def __init__(self, stages: int) -> None:
        """At Gauss's points: of order 2 s."""
        nodes, _ = gauss(stages)
        integrals = [each.integ() for each in lagrange(nodes)]
        self.a = np.stack([integral(nodes) for integral in integrals], axis=1)
        self.weights = np.array([integral(1.0) for integral in integrals])
        self.fractions = np.concatenate([[0.0], nodes, [1.0]])


collocation = lru_cache(maxsize=8)(Collocation)
"""By so many stages, found once in a process."""
