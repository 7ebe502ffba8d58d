"""Functions without angles: the same values, and no sine or cosine left."""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.codegen.simplify import simplified
from deltaopt.codegen.vectorised import evaluate_rows


def operations(function: ca.Function) -> list[int]:
    return [function.instruction_id(k) for k in range(function.n_instructions())]


def test_sines_of_found_angles_become_quotients():
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    first, second, third = ca.atan2(x[0], x[1]), ca.atan2(p, x[2]), ca.asin(x[2] / 9)
    angles = ca.vertcat(first, second, third, first - second, first - (second - third))
    function = ca.Function("f", [x, p], [ca.cos(angles), p * ca.sin(angles) ** 2])
    short = simplified(function)
    left = {ca.OP_SIN, ca.OP_COS, ca.OP_ATAN2, ca.OP_ASIN} & set(operations(short))
    assert not left
    rows = np.random.default_rng(1).normal(size=(50, 3))
    for found, expected in zip(
        evaluate_rows(short, rows, parameters=np.array([1.3])),
        evaluate_rows(function, rows, parameters=np.array([1.3])),
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, atol=4e-16 * 9)


def test_other_angles_stay():
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    angle = ca.atan2(x[0], x[1])
    function = ca.Function("f", [x, p], [ca.vertcat(angle, ca.sin(x[0] + angle), ca.cos(p))])
    short = simplified(function)
    assert sorted(o for o in operations(short) if o in (ca.OP_SIN, ca.OP_COS, ca.OP_ATAN2)) == (
        sorted([ca.OP_SIN, ca.OP_COS, ca.OP_ATAN2])
    )
    point = np.array([0.3, -0.4])
    np.testing.assert_array_equal(
        evaluate_rows(short, point, parameters=np.ones(1)),
        evaluate_rows(function, point, parameters=np.ones(1)),
    )


def test_results_keep_their_structure():
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    function = ca.Function("f", [x, p], [ca.vertcat(x[0], 0, ca.SX(1, 1), 2)])
    short = simplified(function)
    assert short.sparsity_out(0) == function.sparsity_out(0)
    np.testing.assert_array_equal(short([5, 6], 0).full(), [[5], [0], [0], [2]])
