"""Programs of points: their derivatives against CasADi's own, and how they fail."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt.errors import NotConverged
from deltaopt.planning.nlp.points import Layout, PointFunction, Points
from deltaopt.planning.nlp.program import IpoptProgram

VARIABLES, NUMBER = 5, 4
COST = np.array([1.0, -2.0, 0.5, 0.0, 1.0])


def point_function() -> PointFunction:
    """r(y, p) of two rows in three y, curved in all of them."""
    y, p = ca.SX.sym("y", 3), ca.SX.sym("p", 2)
    r = ca.vertcat(p[0] * y[0] * y[1] + ca.sin(y[2]), ca.exp(y[0] * p[1]) - y[1] * y[2] ** 2)
    return PointFunction("curve", ca.Function("curve", [y, p], [r]))


def layouts(seed: int) -> tuple[Layout, Layout]:
    """Random sums of variables: two linear rows, and y at every point. Columns repeat."""
    rng = np.random.default_rng(seed)
    return (
        Layout(rng.integers(VARIABLES, size=(2, 3)), rng.normal(size=(2, 3))),
        Layout(rng.integers(VARIABLES, size=(3 * NUMBER, 4)), rng.normal(size=(3 * NUMBER, 4))),
    )


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_those_of_casadi(seed):
    function, (linear, layout) = point_function(), layouts(seed)
    free = np.full(2, np.inf)
    program = IpoptProgram(COST, linear, [Points(function, layout, -free, free)])
    z, p, lam_f = ca.MX.sym("z", VARIABLES), ca.MX.sym("p", 2), ca.MX.sym("lam_f")
    y = ca.reshape(layout.matrix(VARIABLES) @ z, 3, NUMBER)
    rows = [function.function(y[:, i], p) for i in range(NUMBER)]
    g = ca.vertcat(linear.matrix(VARIABLES) @ z, *rows)
    lam_g = ca.MX.sym("lam_g", g.numel())
    lagrangian = lam_f * ca.dot(ca.DM(COST), z) + ca.dot(lam_g, g)
    H = ca.triu(ca.hessian(lagrangian, z)[0])
    expected = ca.Function("expected", [z, p, lam_f, lam_g], [g, ca.jacobian(g, z), H])
    rng = np.random.default_rng(100 + seed)
    at, values = rng.normal(size=VARIABLES), rng.normal(size=2)
    multipliers = rng.normal(size=g.numel())
    g_at, J_at, H_at = expected(at, values, 0.7, multipliers)
    g_ours, J_ours = program._solver.get_function("nlp_jac_g")(at, values)
    H_ours = program._solver.get_function("nlp_hess_l")(at, values, 0.7, multipliers)
    for ours, theirs in ((g_ours, g_at), (J_ours, J_at), (H_ours, H_at)):
        np.testing.assert_allclose(ours.full(), theirs.full(), atol=1e-13)


def circles(radius2: float) -> IpoptProgram:
    """The least z_0 + z_1 with z_i² + z_{i+1}² ≤ 1 for each of three neighbours.

    The last point's sum must be ``radius2`` at least.
    """
    y, p = ca.SX.sym("y", 2), ca.SX.sym("p")
    function = PointFunction("circle", ca.Function("circle", [y, p], [ca.sumsqr(y) / p]))
    neighbours = Layout(np.array([[0], [1], [1], [2], [2], [3]]), np.ones((6, 1)))
    last = Layout(np.array([[2], [3]]), np.ones((2, 1)))
    return IpoptProgram(
        np.array([1.0, 1.0, 0.0, 0.0]),
        Layout(np.zeros((0, 1), dtype=np.intp), np.zeros((0, 1))),
        [
            Points(function, neighbours, np.array([0.0]), np.array([1.0])),
            Points(function, last, np.array([radius2]), np.array([np.inf])),
        ],
    )


def test_solution_and_signs_of_multipliers():
    """At z = -(1, 1)/√2 the first circle holds; its price is dT/d(limit) = √2/2."""
    program, free = circles(0.0), np.full(4, 10.0)
    lower = np.array([-10.0, -10.0, 0.25, -10.0])
    solution = program.solve(np.array([-0.1, -0.2, 0.3, 0.1]), lower, free, np.array([1.0]))
    np.testing.assert_allclose(solution.z[:2], -np.sqrt(0.5), atol=1e-6)
    np.testing.assert_allclose(solution.row_multipliers[0], np.sqrt(0.5), atol=1e-6)
    assert (solution.row_multipliers[1:] < 1e-6).all()
    assert solution.status == "Solve_Succeeded"
    wider = program.solve(solution.z, lower, free, np.array([1.0 + 1e-3]))
    fall = (solution.z[:2] - wider.z[:2]).sum()
    assert fall / 1e-3 == pytest.approx(solution.row_multipliers[0], rel=1e-3)


def test_not_converged_tells_what_is_wrong():
    """The last two variables cannot be on a circle of less than 1 and of more than 2."""
    program, free = circles(2.0), np.full(4, 10.0)
    with pytest.raises(NotConverged) as failure:
        program.solve(np.full(4, 0.1), -free, free, np.array([1.0]))
    assert failure.value.status == "Infeasible_Problem_Detected"
    iterate = np.asarray(failure.value.iterate)
    assert iterate.shape == (4,)
    message = str(failure.value)
    assert "Infeasible_Problem_Detected" in message
    worst = max(iterate[2] ** 2 + iterate[3] ** 2 - 1, 2 - iterate[2] ** 2 - iterate[3] ** 2)
    place = "3 of 3" if iterate[2] ** 2 + iterate[3] ** 2 > 1.5 else "1 of 1"
    assert f"worst constraint: circle 1 at point {place}, violated by {worst:.1e}" in message


def test_complaint_about_a_linear_row():
    """z_0 = z_1 between bounds that lie apart."""
    function = point_function()
    layout = Layout(np.array([[0], [1], [0]]), np.ones((3, 1)))
    free = np.full(2, np.inf)
    linear = Layout(np.array([[0, 1]]), np.array([[1.0, -1.0]]))
    program = IpoptProgram(np.array([1.0, 0.0]), linear, [Points(function, layout, -free, free)])
    lower, upper = np.array([0.0, 2.0]), np.array([1.0, 3.0])
    with pytest.raises(NotConverged, match="worst constraint: continuity, violated by 1"):
        program.solve(np.array([0.5, 2.5]), lower, upper, np.ones(2))
