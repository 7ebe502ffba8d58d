"""Where polynomials of one variable are zero, and how large they get."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.bernstein import highest, parts_of
from deltaopt.curves.piecewise import Array

_REAL = 1e-6
"""Imaginary part of a root, in lengths of its interval, that may be rounding of a double root."""
_ROUNDING = 1e-13
"""Of the largest control point of a polynomial: to which its largest value is known."""


def real_roots(curve: Polynomial, begin: float, end: float, length: float | None = None) -> Array:
    """The real roots of a polynomial between two places, increasing, without the places themselves.

    ``length``: whose millionth an imaginary part may be that is taken for rounding, the distance of
    the places unless it is given.
    """
    roots = curve.roots()
    real = roots.real[np.abs(roots.imag) < _REAL * (end - begin if length is None else length)]
    return np.sort(real[(begin < real) & (real < end)])


def sure_largest(curve: Polynomial, begin: float, end: float) -> float:
    """The largest value of a polynomial between two places, at all of them, to rounding."""
    coefficients = np.asarray(curve.coef, np.float64)[None, :, None]
    points = parts_of(coefficients, np.array([begin]), np.array([end - begin]))
    return highest(points[..., 0], _ROUNDING * float(np.abs(points).max()))
