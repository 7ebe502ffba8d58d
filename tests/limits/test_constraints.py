"""What is derived from limits: orders, sides, normalisation, how slowing changes them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt import load_scene
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.limits.constraints import Constraints, SceneLimits
from deltaopt.limits.limit import Bounds
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import LIMITS, limits_of

CROSS = load_scene("problems/industrial_cross.yaml")
PICK = load_scene("problems/pick_and_place.yaml")
LIMITED = limits_of(CROSS)
MODEL = delta_model(CROSS.robot, CROSS.payload)
FUNCTIONS = delta_functions(MODEL.functions.terms, Explicit())


def rows_of_motion(constraints: Constraints) -> tuple[ca.Function, list[ca.SX]]:
    """(x, v, a, numbers, p) -> rows, by eq. (39)."""
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    numbers, p = constraints.numbers(), ca.SX.sym("p", len(MODEL.parameters))
    rows = constraints.rows(PlatformInstant(FUNCTIONS, x, v, a, p), numbers)
    inputs = [x, v, a, numbers, p]
    return ca.Function("rows", inputs, [rows]), inputs


def states(number: int = 20) -> list[np.ndarray]:
    rng = np.random.default_rng(4)
    x = np.array([0.85, 0.0, 0.0]) + rng.uniform(-0.08, 0.08, (number, 3))
    return [x, rng.uniform(-2, 2, (number, 3)), rng.uniform(-80, 80, (number, 3))]


def values(function: ca.Function, x, v, a, limits: SceneLimits = LIMITED) -> np.ndarray:
    numbers, p = np.tile(limits.numbers, (len(x), 1)), np.tile(MODEL.parameters, (len(x), 1))
    return function(x.T, v.T, a.T, numbers.T, p.T).full().T


OF_CROSS = [limit for limit in LIMITS if limit.items(CROSS)]


def test_the_scene_has_limits_of_every_order():
    assert {limit.order for limit in OF_CROSS} == {0, 1, 2}


@pytest.mark.parametrize("limit", OF_CROSS, ids=lambda limit: limit.name)
def test_order_is_the_highest_derivative_that_a_limit_depends_on(limit):
    """As CasADi sees it in the rows written out for a motion of the platform."""
    items = limit.items(CROSS)
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    numbers, p = ca.SX.sym("numbers", len(items[0])), ca.SX.sym("p", len(MODEL.parameters))
    rows = limit.rows(PlatformInstant(FUNCTIONS, x, v, a, p), numbers)
    depends = [order for order, part in enumerate((x, v, a)) if any(ca.which_depends(rows, part))]
    assert max(depends) == limit.order


def test_rows_are_those_of_the_general_derivation():
    """In the platform's coordinates without angles, and in all twelve coordinates."""
    constraints = LIMITED.constraints
    function, (x, v, a, numbers, p) = rows_of_motion(constraints)
    general = CoordinateInstant.general(FUNCTIONS, x, v, a, p)
    other = ca.Function("general", [x, v, a, numbers, p], [constraints.rows(general, numbers)])
    np.testing.assert_allclose(
        values(function, *states()), values(other, *states()), rtol=1e-10, atol=1e-12
    )


def test_a_slowed_motion_has_the_rows_that_its_exponents_say():
    """r(k) = r(rest) + (r - r(rest)) / kⁿ, here with a motion really slowed."""
    function, _ = rows_of_motion(LIMITED.constraints)
    x, v, a = states()
    rest = values(function, x, 0 * v, 0 * a)
    whole = values(function, x, v, a)
    for k in (1.3, 2.0, 7.0):
        expected = rest + (whole - rest) / k**LIMITED.constraints.slowing_exponents
        np.testing.assert_allclose(values(function, x, v / k, a / k**2), expected, atol=1e-11)


def test_bounds_are_at_one():
    """Rows are normalised: a quantity at its bound has the row 1 or -1."""
    own = ca.SX(ca.DM([3.0, 5.0]))
    for bounds, upper, lower in (
        (Bounds.symmetric(own), own, -own),
        (Bounds.at_most(own), own, None),
        (Bounds.at_least(own, 0.2), None, own),
    ):
        for side, row in ((upper, 1.0), (lower, -1.0)):
            if side is not None:
                found = np.array(ca.DM(bounds.normalised(side))).ravel()
                np.testing.assert_allclose(found, row, rtol=1e-15)


def test_one_scale_beyond_a_bound_is_one_more():
    bounds = Bounds.at_least(ca.SX(0.0), 0.2)
    assert float(ca.DM(bounds.normalised(ca.SX(-0.2)))) == -2.0


def test_only_torques_are_bounds_on_the_controls():
    control = LIMITED.constraints.is_control
    orders = LIMITED.constraints.orders
    assert control.sum() == 3
    assert (orders[control] == 2).all()


def test_a_scene_without_a_limit_has_no_rows_of_it():
    assert len(limits_of(PICK).constraints.limits) < len(LIMITED.constraints.limits)
    assert limits_of(PICK).upper("speed") is None


def test_scenes_that_differ_in_numbers_share_what_is_derived():
    other = CROSS.model_copy(update={"payload": 0.3})
    assert limits_of(other).constraints is LIMITED.constraints


def test_rows_have_names():
    labels = [LIMITED.constraints.label(i) for i in range(LIMITED.constraints.number)]
    assert len(set(labels)) == len(labels)
    assert "torque of motor 2" in labels
