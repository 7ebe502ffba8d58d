"""The model a user meets, against reference states, its own inverses and facts by hand."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deltaopt.codegen import compile as compiling
from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Singular, Unreachable
from deltaopt.robot.guarded_functions import guarded_functions
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.robot.singular_points import NEAR

ROOT = Path(__file__).parents[2]
ORSINO = load_robot(ROOT / "problems/robots/orsino.yaml")
INDUSTRIAL = load_robot(ROOT / "problems/robots/industrial.yaml")
ALL_TERMS = load_robot(ROOT / "problems/robots/industrial_drive.yaml")


@dataclass
class Reference:
    """Rows of a reference file, and the robot they belong to."""

    rows: Any
    robot: Robot
    payload: float

    @property
    def motion(self):
        return self.rows["x"], self.rows["xd"], self.rows["xdd"]


def reference(name: str) -> Reference:
    rows = np.load(Path(__file__).parents[1] / "data" / f"{name}.npz")
    p = json.loads(str(rows["params"]))
    arm = {"length": 2 * p["a2"], "mass": p["m3"]}
    forearm: dict[str, Any] = {"length": 2 * p["a3"], "mass": p["m4"]}
    if "I33" in p:
        arm["inertia"] = p["I33"]
        forearm["inertia"] = (p["I41"], p["I42"], p["I43"])
    content = {
        "name": name,
        "base_radius": p["a1"],
        "platform_radius": p["a4"],
        "upper_arm": arm,
        "forearm": forearm,
        "platform": {"mass": p["m1"]},
        "drive": {"torque": 10.0},
        "gravity": p["g"],
    }
    return Reference(rows, Robot.model_validate(content), p["m2"])


@pytest.fixture(params=["states_paper", "states_general_inertia"])
def states(request) -> Reference:
    return reference(request.param)


def relative(found, expected):
    """Error of each row as a fraction of the row; of rows that are zero as it is."""
    scale = np.linalg.norm(expected, axis=1)
    return np.linalg.norm(found - expected, axis=1) / np.where(scale > 0, scale, 1)


def test_inverse_kinematics(states):
    """q, q̇ and q̈; angles may differ by whole turns."""
    model = DeltaModel(states.robot, states.payload)
    q, dq, ddq = model.motion(*states.motion)
    turns = (q - states.rows["q"])[:, 3:] / (2 * np.pi)
    bound = 1e-12 * (1 + states.rows["cond"])
    assert np.array_equal(q[:, :3], states.rows["x"])
    assert (np.abs(turns - np.round(turns)).max(axis=1) < bound).all()
    assert (relative(dq, states.rows["qd"]) < bound).all()
    assert (relative(ddq, states.rows["qdd"]) < bound).all()


@pytest.mark.parametrize("formulation", [Explicit(), Multiplier(), VirtualWork(), Kane()])
def test_inverse_dynamics(states, formulation):
    model = DeltaModel(states.robot, states.payload, formulation)
    tau = model.inverse_dynamics(*states.motion)
    assert (relative(tau, states.rows["tau"]) < 1e-12 * (1 + states.rows["cond"])).all()


def test_multipliers(states):
    model = DeltaModel(states.robot, states.payload)
    lam = model.multipliers(*states.motion)
    assert relative(lam, states.rows["lam"]).max() < 1e-10


def test_forward_undoes_inverse(states):
    """To 1e-9 of the acceleration."""
    x, v, a = states.motion
    for formulation in (Explicit(), Multiplier()):
        model = DeltaModel(states.robot, states.payload, formulation)
        back = model.forward_dynamics(x, v, model.inverse_dynamics(x, v, a))
        assert relative(back, a).max() < 1e-9


def test_by_hand():
    """At (0.40, 0, 0) the arms are horizontal: each motor holds a third of the weight there."""
    model, rest = DeltaModel(ORSINO, payload=1.0), np.zeros(3)
    assert model.inverse_kinematics([0.4, 0, 0])[3::3] == pytest.approx(0, abs=1e-15)
    held = model.inverse_dynamics([0.4, 0, 0], rest, rest)
    assert held == pytest.approx(9.81 * 0.53 / 3, rel=1e-14)
    assert model.inverse_kinematics([0.45, 0, 0])[3::3] == pytest.approx(-0.23223, abs=5e-6)
    held = model.inverse_dynamics([0.45, 0, 0], rest, rest)
    assert held == pytest.approx(1.87045266200582, rel=1e-13)


def test_shapes():
    model = DeltaModel(ORSINO)
    one, many = np.array([0.45, 0.0, 0.0]), np.full((7, 3), [0.45, 0.0, 0.0])
    assert model.inverse_kinematics(one).shape == (12,)
    assert model.inverse_kinematics(many).shape == (7, 12)
    assert model.inverse_dynamics(many, one * 0, one * 0).shape == (7, 3)
    assert model.multipliers(one, one * 0, one * 0).shape == (9,)
    assert model.inverse_kinematics(np.zeros((0, 3))).shape == (0, 12)
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        model.inverse_kinematics([0.45, 0.0])
    with pytest.raises(ValueError, match="one length"):
        model.inverse_dynamics(many, many[:3], many)


@pytest.mark.parametrize("x", [[0.7, 0, 0], [0.28, 0, 0], [0.45, 0.9, 0], [np.nan, 0, 0]])
def test_out_of_reach(x):
    model = DeltaModel(ORSINO)
    with pytest.raises(Unreachable, match=r"the platform cannot be at \[.*\] m: "):
        model.inverse_kinematics([[0.45, 0, 0], x])


def test_bars_that_do_not_meet():
    with pytest.raises(Unreachable, match="the bars do not meet"):
        DeltaModel(INDUSTRIAL.model_copy(update={"base_radius": 0.9})).forward_kinematics([0, 0, 0])


# Compiled functions against the general derivation, interpreted

OTHER_BARS = ALL_TERMS.model_copy(
    update={"forearm": ALL_TERMS.forearm.model_copy(update={"inertia": (0.02, 0.015, 0.03)})}
)
MODELS = {
    "orsino": DeltaModel(ORSINO, 1.0),
    "all terms": DeltaModel(ALL_TERMS, 0.5),
    "all terms, other bars": DeltaModel(OTHER_BARS, 0.5),
    "model L_I": DeltaModel(ORSINO, 1.0, Multiplier()),
    "virtual work": DeltaModel(ALL_TERMS, None, VirtualWork()),
}


def motions(model: DeltaModel, number: int):
    """x, v, a, (N, 3) each, in the middle of the workspace."""
    rng = np.random.default_rng(7)
    x = model.forward_kinematics(rng.uniform(-0.4, 0.4, (number, 3)))
    return x, rng.uniform(-2, 2, x.shape), rng.uniform(-50, 50, x.shape)


def close(found, expected):
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < 2e-12 * np.abs(expected).max()


@pytest.mark.parametrize("name", MODELS)
def test_public_calls(name):
    """Each call, for many points and for one, against CasADi's own functions of the twelve
    coordinates, derived by the formulation."""
    model = MODELS[name]
    x, v, a = motions(model, 70)

    def interpreted(function, *arguments):
        return evaluate_rows(function, *arguments, parameters=model.parameters)

    tau, lam = interpreted(model.functions.inverse_dynamics, x, v, a)
    q, *rates = interpreted(model.functions.motion, x, v, a)
    (acceleration,) = interpreted(model.functions.forward_dynamics, x, v, tau)
    found = model.motion(x, v, a)
    expected = (
        (model.inverse_kinematics, (x,), q),
        (model.forward_kinematics, (q[:, 3::3],), x),
        (model.inverse_dynamics, (x, v, a), tau),
        (model.multipliers, (x, v, a), lam),
        (model.forward_dynamics, (x, v, tau), acceleration),
        (model.joint_inverse_dynamics, (q, *rates), tau),
    )
    for coordinates, wanted in zip(found, (q, *rates), strict=True):
        close(coordinates, wanted)
    for call, arguments, wanted in expected:
        close(call(*arguments), wanted)
        close(call(*(argument[3] for argument in arguments)), wanted[3])


def test_without_a_compiler(monkeypatch):
    """The interpreter gives the same, errors included."""
    model = MODELS["all terms"]
    x, v, a = motions(model, 5)
    compiled = model.inverse_dynamics(x, v, a), model.forward_dynamics(x, v, a)
    monkeypatch.setattr(compiling, "compilers", list)
    guarded_functions.cache_clear()
    plain = DeltaModel(model.robot, model.payload)
    close(plain.inverse_dynamics(x, v, a), compiled[0])
    close(plain.forward_dynamics(x, v, a), compiled[1])
    x[3] += 2.0
    with pytest.raises(Unreachable) as caught:
        plain.inverse_dynamics(x, v, a)
    assert caught.value.points.tolist() == [3]
    guarded_functions.cache_clear()


def test_errors_name_all_points():
    model = MODELS["orsino"]
    x, v, a = motions(model, 300)
    for places in ([4], [0, 299], [17, 18, 250]):
        wrong = x.copy()
        wrong[places] = [0.7, 0.0, 0.0]
        wrong[places[-1]] = np.nan
        for call in (
            lambda at=wrong: model.inverse_kinematics(at),
            lambda at=wrong: model.motion(at, v, a),
            lambda at=wrong: model.inverse_dynamics(at, v, a),
            lambda at=wrong: model.multipliers(at, v, a),
            lambda at=wrong: model.forward_dynamics(at, v, a),
        ):
            with pytest.raises(Unreachable, match="the platform cannot be at") as caught:
                call()
            assert caught.value.points.tolist() == places
    angles = np.tile([1.5, 1.5, 0.0], (9, 1))
    angles[[2, 5]] = 0.0
    wide = DeltaModel(INDUSTRIAL.model_copy(update={"base_radius": 0.62}))
    assert np.isfinite(wide.forward_kinematics(angles[0])).all()
    with pytest.raises(Unreachable, match=r"motor angles \[0, 0, 0\] rad") as caught:
        wide.forward_kinematics(angles)
    assert caught.value.points.tolist() == [2, 5]


def stretched(model: DeltaModel, margin: float):
    """The platform on its axis with sin (q_{k,1} - q_{k,2}) this small."""
    p = model.numbers
    reach = np.sqrt((2 * p.a2) ** 2 + (2 * p.a3) ** 2 + 8 * p.a2 * p.a3 * np.sqrt(1 - margin**2))
    return [np.sqrt(reach**2 - (p.a1 - p.a4) ** 2), 0.0, 0.0]


def test_points_near_singularities_among_others():
    """Each point gets what it gets alone; singular ones are all named."""
    model = MODELS["orsino"]
    x, v, a = motions(model, 100)
    x[10], x[20], x[30] = (stretched(model, m) for m in (1.5 * NEAR, 0.5 * NEAR, 1e-3))
    v[30], a[30] = 0.0, 0.0
    for call in (model.inverse_dynamics, model.forward_dynamics, model.multipliers):
        together = call(x, v, a)
        for i in (10, 20, 30, 40):
            np.testing.assert_array_equal(call(x[i], v[i], a[i]), together[i])
    robust = DeltaModel(ORSINO, 1.0, Multiplier()).forward_dynamics(x[20:21], v[20:21], a[20:21])
    np.testing.assert_array_equal(model.forward_dynamics(x, v, a)[20:21], robust)
    holding = model.joint_inverse_dynamics(model.inverse_kinematics(x[30]), *np.zeros((2, 12)))
    np.testing.assert_array_equal(model.inverse_dynamics(x, v, a)[30], holding)
    x[50], x[60] = stretched(model, 1e-7), stretched(model, 1e-8)
    with pytest.raises(Singular, match="point 50") as caught:
        model.inverse_dynamics(x, v, a)
    assert caught.value.points.tolist() == [50, 60]


def test_places_are_of_the_tools_point_and_errors_say_so():
    tool = {"offset": (0.12, 0.01, -0.02)}
    model = DeltaModel(ORSINO.model_copy(update={"tool": tool}))
    theta = DeltaModel(ORSINO).inverse_kinematics((0.45, 0.02, 0.0))[3::3]
    point = (0.57, 0.03, -0.02)
    np.testing.assert_allclose(model.inverse_kinematics(point)[3::3], theta, atol=1e-12)
    np.testing.assert_allclose(model.forward_kinematics(theta), point, atol=1e-12)
    with pytest.raises(Unreachable, match=r"^the tool's point cannot be at \[3, 0, 0\] m"):
        model.inverse_kinematics((3.0, 0.0, 0.0))
