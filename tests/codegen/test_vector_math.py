"""Vectorised functions against many digits; what they do at zeros, infinities and beyond."""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest

from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.vectorised import RowFunction

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

ULPS = 2.0
"""What ``four_points.c`` promises, in units of the last place."""
FUNCTIONS = {
    "sin": (ca.sin, mpmath.sin, 30.0),
    "cos": (ca.cos, mpmath.cos, 30.0),
    "far sin": (ca.sin, mpmath.sin, 9e4),
    "large cos": (ca.cos, mpmath.cos, 1e8),
    "asin": (ca.asin, mpmath.asin, 1.0),
    "tanh": (ca.tanh, mpmath.tanh, 25.0),
}


def machine_code(function, arguments: int = 1) -> RowFunction:
    x, p = ca.SX.sym("x", arguments), ca.SX.sym("p", 0)
    rows = RowFunction(ca.Function("f", [x, p], [function(*ca.vertsplit(x))]))
    assert rows._code is not None
    return rows


def values(rows: RowFunction, *columns) -> np.ndarray:
    (found,) = rows(np.stack(columns, axis=1), parameters=np.zeros(0))
    return found[:, 0]


def worst(found, exact) -> float:
    """Largest error in units of the last place."""
    with mpmath.workdps(40):
        return max(
            float(abs(mpmath.mpf(f) - e)) / np.spacing(abs(float(e)))
            for f, e in zip(map(float, found), exact, strict=True)
        )


@pytest.mark.parametrize("name", FUNCTIONS)
def test_many_digits(name):
    function, exact, size = FUNCTIONS[name]
    rng = np.random.default_rng(3)
    x = rng.uniform(-size, size, 1500)
    x[::3] *= 10.0 ** rng.uniform(-9, 0, 500)
    with mpmath.workdps(40):
        expected = [exact(mpmath.mpf(a)) for a in map(float, x)]
    assert worst(values(machine_code(function), x), expected) < ULPS


def test_arc_tangent_in_many_digits():
    rng = np.random.default_rng(4)
    y, x = rng.normal(size=(2, 1500)) * 10.0 ** rng.uniform(-6, 6, (2, 1500))
    with mpmath.workdps(40):
        pairs = zip(map(float, y), map(float, x), strict=True)
        expected = [mpmath.atan2(mpmath.mpf(b), mpmath.mpf(a)) for b, a in pairs]
    assert worst(values(machine_code(ca.atan2, 2), y, x), expected) < ULPS


def test_special_values():
    special = np.array([0.0, -0.0, 1.0, -1.0, 2.0, np.nan, np.inf, -np.inf])
    with np.errstate(invalid="ignore"):
        for function, exact in (
            (ca.sin, np.sin),
            (ca.cos, np.cos),
            (ca.asin, np.arcsin),
            (ca.tanh, np.tanh),
        ):
            found = values(machine_code(function), special)
            np.testing.assert_allclose(found, exact(special), rtol=4e-16)
    y, x = (grid.ravel() for grid in np.meshgrid(special[:6], special[:6]))
    found, expected = values(machine_code(ca.atan2, 2), y, x), np.arctan2(y, x)
    np.testing.assert_allclose(found, expected, rtol=4e-16)
    known = np.isfinite(expected)
    np.testing.assert_array_equal(np.signbit(found[known]), np.signbit(expected[known]))


def test_lanes_choose_for_themselves():
    """One lane with a large argument, or a condition that differs between lanes."""
    x = np.array([0.5, 1e9, -3.0, np.nan])
    np.testing.assert_allclose(values(machine_code(ca.sin), x), np.sin(x), rtol=4e-16)
    chosen = machine_code(lambda a: ca.if_else(a < 1, 10 * a, -a))
    np.testing.assert_array_equal(values(chosen, np.arange(4.0)), [0.0, -1.0, -2.0, -3.0])
