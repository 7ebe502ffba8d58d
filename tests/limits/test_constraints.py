"""What is derived from limits: orders, sides, normalisation, how slowing changes them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt import load_scene
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import Bounds
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import LIMITS, limits_of

CROSS = load_scene("problems/industrial_cross.yaml")
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


SMOOTH = CROSS.model_copy(update={"limits": {"torque_rate": 5000.0, "jerk": 3000.0}})
OF_SMOOTH = [limit for limit in LIMITS if limit.items(SMOOTH)]


@pytest.mark.parametrize("limit", OF_SMOOTH, ids=lambda limit: limit.name)
def test_order_is_the_highest_derivative_that_a_limit_depends_on(limit):
    """As CasADi sees it in the rows written out for a motion of the platform."""
    items = limit.items(SMOOTH)
    x, v, a, j = (ca.SX.sym(name, 3) for name in "xvaj")
    numbers, p = ca.SX.sym("numbers", len(items[0])), ca.SX.sym("p", len(MODEL.parameters))
    rows = limit.rows(PlatformInstant(FUNCTIONS, x, v, a, p, jerk=j), numbers)
    depends = [
        order for order, part in enumerate((x, v, a, j)) if any(ca.which_depends(rows, part))
    ]
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


EVERY_LIMIT = [
    load_scene(f"problems/{name}.yaml")
    for name in (
        "industrial_cross",
        "industrial_drive",
        "limits/drive_joints_workspace",
        "limits/platform_speed",
        "limits/smooth",
        "limits/specific_force",
        "limits/parallel_singularity",
        "limits/tilt_singularity",
        "payload/range",
        "keep_out/wall_25_305_25",
        "approach/25_305_25",
        "paths/tube",
    )
]
EVERY_LIMIT.append(CROSS.model_copy(update={"limits": {"acceleration": 50.0}}))


def test_every_limit_is_in_one_of_these_scenes():
    there = {limit for scene in EVERY_LIMIT for limit in limits_of(scene).constraints.limits}
    hulls_and_links = [each for each in LIMITS if each.own_measure and each not in there]
    assert there >= set(LIMITS) - {*hulls_and_links}


@pytest.mark.parametrize("scene", EVERY_LIMIT, ids=lambda scene: scene.robot.name)
def test_a_slowed_motion_has_the_rows_that_its_limits_declare(scene):
    """Rows of motions really slowed, as polynomials of the speed: where a limit declares powers,
    what grows with another one is nothing."""
    given = limits_of(scene)
    model = delta_model(scene.robot, scene.payload)
    symbols = [ca.SX.sym(name, 3) for name in "xvaj"]
    numbers, p = given.constraints.numbers(), ca.SX.sym("p", len(model.parameters))
    instant = PlatformInstant(model.functions, *symbols[:3], p, jerk=symbols[3])
    rows = given.constraints.rows(instant, numbers)
    f = ca.Function("rows", [*symbols, numbers, p], [rows])
    x, v, a = states()
    x, j = x - x[0] + np.array(scene.placed_points[0]), 40 * a[::-1]
    speeds, degree = np.linspace(0.1, 1.0, 9), 2 * given.constraints.order
    values = np.array(
        [
            [
                f(*at, given.numbers, model.parameters).full().ravel()
                for at in zip(x, s * v, s**2 * a, s**3 * j, strict=True)
            ]
            for s in speeds
        ]
    )
    reached = np.isfinite(values).all(axis=(0, 2))
    assert reached.sum() >= 5
    flat = values[:, reached].reshape(len(speeds), -1)
    powers = np.vander(speeds, degree + 1, increasing=True)
    parts = np.linalg.lstsq(powers, flat)[0].reshape(degree + 1, -1, values.shape[2])
    mechanism = model.functions.mechanism
    efforts = ca.vertcat(*(effort.value for effort in mechanism.efforts))
    has_friction = ca.depends_on(efforts, mechanism.dq)
    for limit, own in zip(given.constraints.limits, given.constraints.slices, strict=True):
        if has_friction and limit.order >= 2:
            continue
        declared = () if limit.order == 0 else limit.powers
        assert declared is not None
        grows = np.abs(parts[1:, :, own]).max(axis=(1, 2)) > 1e-8 * np.abs(parts[:, :, own]).max()
        assert {n for n in range(1, degree + 1) if grows[n - 1]} <= set(declared), limit.name


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
