"""Scalar functions in fifty digits."""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest

from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.mechanism import delta

x, y = SX.sym("x"), SX.sym("y")
OPERATIONS = {
    "arithmetic": (x + y) * (x - y) / y - x,
    "powers": x**y + x**3 + x**2 + 2 * x + 1 / x + ca.sqrt(x),
    "exponentials": ca.exp(x) + ca.log(y) + ca.expm1(x) + ca.log1p(y),
    "circular": ca.sin(x) * ca.cos(y) + ca.tan(x) + ca.atan2(x, y) + ca.atan(x),
    "inverse circular": ca.asin(x) + ca.acos(x),
    "hyperbolic": ca.sinh(x) + ca.cosh(y) + ca.tanh(x) + ca.asinh(x) + ca.acosh(y) + ca.atanh(x),
    "rounding": ca.floor(y) + ca.ceil(x) + ca.fabs(-x) + ca.sign(-y),
    "choices": ca.if_else(x < y, 3, 4) * ca.if_else(y < x, 5, 6),
    "others": ca.erf(x) + ca.hypot(x, y),
}


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_agrees_with_double_precision(name: str) -> None:
    function = ca.Function("f", [x, y], [OPERATIONS[name]])
    (value,) = ManyDigits().evaluate(function, [0.375], [1.625])
    assert float(value[0]) == pytest.approx(float(function(0.375, 1.625)), rel=1e-15)


def test_has_the_digits_asked_for() -> None:
    function = ca.Function("f", [x], [ca.sin(x) ** 2 + ca.cos(x) ** 2 - 1, ca.exp(x)])
    for digits in (30, 60):
        many = ManyDigits(digits)
        zero, e = many.evaluate(function, [1])
        assert abs(zero[0]) < 10.0 ** (2 - digits)
        with mpmath.workdps(digits):
            assert abs(e[0] - mpmath.e) < mpmath.mpf(10) ** (1 - digits)


def test_the_inverse_dynamics_of_the_delta_agree_to_rounding() -> None:
    function = Explicit().inverse_dynamics(delta(PAPER)).expand()
    rng = np.random.default_rng(3)
    p = np.asarray(ca.DM(PAPER.vector())).ravel()
    arguments = [[0.0], *(rng.uniform(-1, 1, 12) for _ in range(3)), p]
    tau, _ = ManyDigits().evaluate(function, *arguments)
    double = np.asarray(function(*arguments)[0]).ravel()
    np.testing.assert_allclose([float(v) for v in tau], double, rtol=1e-10)


def test_solves_and_refuses() -> None:
    many = ManyDigits()
    third = many.solve(many.matrix([[3.0]]), many.matrix([1.0]))
    assert abs(3 * third[0] - 1) < many.context.mpf(10) ** -49
    m = ca.MX.sym("m")
    with pytest.raises(TypeError, match="expand"):
        many.evaluate(ca.Function("matrix", [m], [2 * m]), [1])
