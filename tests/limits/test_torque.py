"""Torques with the least payload of a range: by the model with that payload, and planned."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt import DeltaModel, Scene, SceneError, load_robot, load_scene, plan, verify
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.limits.joints import TORQUE_LIMIT, TorqueCurve, WithLeastPayload
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.robot.model import delta_model
from deltaopt.verify.measures import MeasuredMotion

RANGE = load_scene("problems/payload/range.yaml")
RL5 = load_robot("problems/robots/rl5.yaml")
GEARED = RL5.model_copy(update={"drive": RL5.drive.model_copy(update={"inertia": 5.0})})
"""With drives so heavy that gravity helps a large payload down, and a small one less."""
DOWN = Scene(
    robot=GEARED, payload=(0.0, 4.0), start=(0.8, 0, 0), goal=(1.0, 0, 0), limits={"torque": 40.0}
)
INTERMEDIATE = np.linspace(0, 1, 9)


@pytest.fixture(scope="module")
def down():
    return plan(DOWN)


def largest_share(robot, motion, payload, limit):
    """Of the torque limit, by inverse dynamics with a payload, on a dense sampling."""
    at = motion.inside_intervals(np.linspace(0, 1, 60))
    tau = DeltaModel(robot, payload or None).inverse_dynamics(at.x, at.v, at.a)
    return float(np.abs(tau).max()) / limit


@pytest.mark.parametrize("limit", [TORQUE_LIMIT, TorqueCurve()], ids=lambda limit: limit.name)
@pytest.mark.parametrize("robot", ["hornet_565", "industrial_drive"])
def test_measure_is_that_of_the_model_with_the_least_payload(limit, robot):
    """By the platform's equations and by those of twelve coordinates."""
    given = load_robot(f"problems/robots/{robot}.yaml")
    least, largest = 0.4, 2.5
    ends = {"start": (0.8, 0.0, 0.0), "goal": (0.8, 0.1, 0.0)}
    scene = Scene(robot=given, payload=(least, largest), **ends)
    heavy, light = delta_model(given, largest), delta_model(given, least)
    functions, rng = delta_functions(heavy.functions.terms, Explicit()), np.random.default_rng(3)
    x, v, a = (ca.SX.sym(letter, 3) for letter in "xva")
    p, wrapped = heavy.functions.terms.symbols().vector(), WithLeastPayload(limit)
    for numbers, own in zip(wrapped.items(scene), limit.items(scene), strict=True):
        for instant in (
            PlatformInstant(functions, x, v, a, p),
            CoordinateInstant.general(functions, x, v, a, p),
        ):
            measure = wrapped.measure(instant, ca.SX(ca.DM(list(numbers))))
            f = ca.Function("measure", [x, v, a, p], [measure])
            for _ in range(5):
                motion = (
                    np.array([0.8, 0.0, 0.0]) + rng.uniform(-0.1, 0.1, 3),
                    2 * rng.normal(size=3),
                    40 * rng.normal(size=3),
                )
                expected = light.inverse_dynamics(*motion)
                if isinstance(limit, TorqueCurve):
                    expected = expected + own[0] * light.motion(*motion)[1][3::3]
                found = f(*motion, heavy.parameters).full().ravel()
                np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_the_heaviest_alone_would_not_do(down):
    """The plan for 4 kg asks for more than the limit where there is no payload; the plan for the
    range keeps it with every mass, is the longer one, and not by more than it needs."""
    heavy = plan(DOWN.model_copy(update={"payload": 4.0}))
    assert largest_share(GEARED, heavy.trajectory, 0.0, 40.0) > 1.05
    shares = [largest_share(GEARED, down.trajectory, m, 40.0) for m in 4.0 * INTERMEDIATE]
    assert max(shares) <= 1 + 1e-9
    assert shares[0] > 0.999
    assert shares[-1] > 0.999
    assert down.duration > heavy.duration
    scaled = verify(DOWN, heavy.trajectory)
    assert not scaled.ok
    assert down.duration < scaled.safe_duration


def test_verification_measures_the_least_payload_by_a_model_of_its_own(down, monkeypatch):
    """Also where torques that are derived from those of the largest payload tell nothing."""
    fast, measured = down.trajectory.slowed(0.95), MeasuredMotion.excesses

    def blind(motion):
        own = measured(motion)
        if motion.scene.least_payload is None:
            return own
        return {name: replace(each, value=-1.0) for name, each in own.items()}

    monkeypatch.setattr(MeasuredMotion, "excesses", blind)
    told = verify(DOWN, fast).torque_with_the_least_payload_excess
    assert told == pytest.approx(largest_share(GEARED, fast, 0.0, 40.0) - 1, rel=1e-2)


def test_torques_are_affine_in_the_mass(down):
    """So that both ends of the range say what is between."""
    at = down.trajectory(np.linspace(0, down.duration, 50))
    light, middle, heavy = (
        DeltaModel(GEARED, m).inverse_dynamics(at.x, at.v, at.a) for m in (None, 1.0, 4.0)
    )
    np.testing.assert_allclose(middle, 0.75 * light + 0.25 * heavy, atol=1e-9)
    np.testing.assert_allclose(at.tau, heavy, atol=1e-9)  # reported are those of the largest


def test_ipopt_finds_the_same(down):
    theirs = plan(DOWN, solver=deltaopt.ipopt)
    assert theirs.duration == pytest.approx(down.duration, rel=max(down.gap, theirs.gap))


def test_a_range_of_one_mass_is_that_mass():
    one = RANGE.model_copy(update={"payload": (3.0, 3.0)})
    same = RANGE.model_copy(update={"payload": 3.0})
    assert one == same
    assert one.least_payload is None
    assert plan(one).duration == plan(same).duration


def test_shipped_and_verified_at_both_ends(tmp_path):
    assert (RANGE.least_payload, RANGE.payload) == (0.0, 3.0)
    found = plan(RANGE)
    checked = verify(RANGE, found.trajectory)
    assert checked.failures() == []
    alone = verify(RANGE.with_least_payload, found.trajectory)
    assert RANGE.with_least_payload.payload is None
    excess = checked.torque_with_the_least_payload_excess
    assert excess == pytest.approx(alone.torque_excess, abs=1e-9)
    found.save(tmp_path, chart=False)
    assert deltaopt.load_plan(tmp_path).scene == RANGE


@pytest.mark.parametrize("payload", [[3, 0], [-1, 2], [0, 0], ["1 m", 2], [1, 2, 3], [1]])
def test_refused(payload):
    with pytest.raises(SceneError) as error:
        RANGE.model_copy(update={"payload": payload})
    assert error.value.key == "payload"
    assert "in kg" in str(error.value)


def test_the_field_of_the_least_payload_is_no_key(tmp_path):
    (tmp_path / "scene.yaml").write_text("payload: 2\nleast_payload: 1\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"line 2.*expected payload: \[least, largest\]"):
        load_scene(tmp_path / "scene.yaml")


def test_another_formulation_keeps_the_range_too():
    """In twelve coordinates."""
    found, flat = (
        plan(RANGE, formulation=formulation, tolerance=tolerance)
        for formulation, tolerance in ((deltaopt.multiplier, 1e-3), (deltaopt.flat, 1e-4))
    )
    assert verify(RANGE, found.trajectory).failures() == []
    assert found.duration == pytest.approx(flat.duration, rel=found.gap + flat.gap)
