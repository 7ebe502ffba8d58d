"""When a curve passes given spheres, one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.curves.roots import real_roots

_AS_NEAR = 1e-10
"""m; of two places whose distances to a sphere differ by less, the first counts."""


def passages(
    position: PiecewisePolynomial, spheres: Iterable[tuple[tuple[float, float, float], float]]
) -> Iterator[tuple[float, float]]:
    """By how much a curve in space misses each sphere at its nearest, m, and when, s.

    ``spheres``: centres, m, and radii, m, 0 for points; each is looked for after the one
    before it. On every interval the squared distance is a polynomial; it is least at an end or at a
    root of its derivative, and a sphere is entered at a root of what it is beyond the squared
    radius.
    """
    interval, since = 0, 0.0
    coefficients, lengths = position.coefficients, np.diff(position.knots)
    for centre, radius in spheres:
        best = (np.inf, 0, 0.0)
        for k in range(interval, len(lengths)):
            away = coefficients[k].copy()
            away[0] -= centre
            squares = [Polynomial(each) ** 2 for each in away.T]
            square = squares[0] + squares[1] + squares[2]
            begin, end = (since if k == interval else 0.0), float(lengths[k])
            curves = [square.deriv(), *([square - radius**2] if radius else [])]
            roots = [s for each in curves for s in real_roots(each, begin, end, end).tolist()]
            for s in sorted([begin, end, *roots]):
                missed = max(float(np.sqrt(max(square(s), 0.0))) - radius, 0.0)
                if missed < best[0] - _AS_NEAR:
                    best = missed, k, float(s)
        missed, interval, since = best
        yield missed, float(position.knots[interval]) + since
