"""A limit on the platform's acceleration, added with its own file and one registration alone."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import SceneError
from deltaopt.limits.platform_motion import PLATFORM_ACCELERATION
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.robot.model import delta_model

PICK = deltaopt.load_scene("problems/pick_and_place.yaml")
DISTANCE = float(np.linalg.norm(np.subtract(PICK.goal, PICK.start)))
SOLVED_BY = [
    (deltaopt.flat, deltaopt.interior_point),
    (deltaopt.forward, None),
    (deltaopt.multiplier, None),
]
"""In the platform's coordinates, by torques forwards, and in twelve coordinates."""


def limited(acceleration: float) -> deltaopt.Scene:
    limits = deltaopt.Limits(torque=10.0, acceleration=acceleration)
    return PICK.model_copy(update={"limits": limits})


def duration(scene: deltaopt.Scene, formulation, solver, tolerance: float) -> float:
    plan = deltaopt.plan(scene, formulation=formulation, solver=solver, tolerance=tolerance)
    assert deltaopt.verify(scene, plan.trajectory).ok
    assert plan.gap < tolerance
    return plan.duration


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_limit_alone_gives_the_textbook_duration(tolerance):
    """T = 2 √(d / a): full acceleration to the middle of a straight line, full braking after it."""
    a = 20.0  # far below what the motors could do, and so theirs never matters
    found = duration(limited(a), deltaopt.flat, None, tolerance)
    assert found == pytest.approx(2 * np.sqrt(DISTANCE / a), rel=tolerance)


def test_formulations_agree_where_motors_matter_too():
    best = duration(limited(40.0), deltaopt.flat, None, 1e-6)
    assert best > 1.001 * 2 * np.sqrt(DISTANCE / 40.0)
    assert best > 1.001 * deltaopt.plan(PICK).duration
    for formulation, solver in SOLVED_BY:
        assert duration(limited(40.0), formulation, solver, 1e-3) == pytest.approx(best, rel=1e-3)


def test_measure_is_the_norm_in_both_kinds_of_coordinates():
    model = delta_model(PICK.robot, PICK.payload)
    x, v, a = (ca.SX.sym(letter, 3) for letter in "xva")
    p = model.functions.terms.symbols().vector()
    functions = delta_functions(model.functions.terms, Explicit())
    rng, limit, most = np.random.default_rng(3), PLATFORM_ACCELERATION, ca.SX(50.0)
    for instant in (
        PlatformInstant(functions, x, v, a, p),
        CoordinateInstant.general(functions, x, v, a, p),
    ):
        outputs = [limit.measure(instant, most), limit.rows(instant, most)]
        f = ca.Function("limit", [x, v, a, p], outputs)
        for _ in range(5):
            place, rate, second = np.array(PICK.start), rng.normal(size=3), 40 * rng.normal(size=3)
            measure, row = (float(out) for out in f(place, rate, second, model.parameters))
            expected = np.sqrt(second @ second)
            assert measure == pytest.approx(expected, rel=1e-9)
            assert row == pytest.approx((expected / 50.0) ** 2, rel=1e-9)


def test_excess_is_told():
    """A motion planned without the limit, judged with it."""
    trajectory = deltaopt.plan(PICK).trajectory
    inside = trajectory.inside_intervals(np.linspace(0, 1, 400))
    largest = np.linalg.norm(inside.a, axis=1).max()
    verified = deltaopt.verify(limited(20.0), trajectory)
    assert not verified.ok
    told = verified.excesses["acceleration_excess"].value
    assert told == pytest.approx(largest / 20.0 - 1, rel=1e-3)


@pytest.mark.parametrize("value", [0.0, -3.0, "fast", [1.0, 2.0]])
def test_a_bad_value_is_one_sentence(tmp_path, value):
    scene = {
        "robot": str(Path("problems/robots/orsino.yaml").absolute()),
        "start": PICK.start,
        "goal": PICK.goal,
        "limits": {"acceleration": value},
    }
    file = tmp_path / "scene.yaml"  # JSON is YAML
    file.write_text(json.dumps(scene))
    with pytest.raises(SceneError) as error:
        deltaopt.load_scene(file)
    assert error.value.key == "limits.acceleration"
    assert error.value.expected == "an acceleration in m/s², greater than 0"
