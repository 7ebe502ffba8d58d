"""A term of the arms that the package does not know, a spring: whoever meets it uses it, or refuses
it in a sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import deltaopt.mechanisms.delta.functions as functions
import deltaopt.robot.model as robot_model
from deltaopt import DeltaModel, Robot, Scene, ipopt, load_robot, plan, verify
from deltaopt.compare.model_terms import effects_of_terms
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import SX, UNBOUNDED, Most
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Inexpressible
from deltaopt.mechanisms.delta.arm_loads import ArmLoad
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.output.controller_c import c_functions
from deltaopt.output.mjcf import mjcf
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.nlp.softening import Softening
from deltaopt.problem.of_scene import problem_of
from deltaopt.report.modelled import modelled, not_modelled
from deltaopt.scene.known_limits import limits_of

ORSINO = load_robot("problems/robots/orsino.yaml")
STIFFNESS, REST = 2.0, 1.5
"""N·m/rad, and the angle at which it does nothing, rad: below all angles of the scene it helps down
and hinders up."""


@dataclass(frozen=True)
class Spring(ArmLoad):
    """It does not say how much it can give."""

    stiffness: SX | float
    words: ClassVar[str] = "spring at each arm"
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {"stiffness": (2, 1, -2)}

    def torque(self, angle, speed):
        return self.stiffness * (angle - REST)


@dataclass(frozen=True)
class StatedSpring(Spring):
    def most(self):
        return Most(3.0 * self.stiffness, 3.0 * self.stiffness)


@dataclass(frozen=True)
class Drag(ArmLoad):
    """Of the square of the speed: with the sign of it, no polynomial."""

    drag: SX | float
    words: ClassVar[str] = "drag of each arm"
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {"drag": (2, 1, 0)}

    def torque(self, angle, speed):
        return self.drag * speed * ca.fabs(speed)


@dataclass(frozen=True)
class Latch(ArmLoad):
    """A second friction with a layer of its own."""

    latch: SX | float
    words: ClassVar[str] = "latch of each arm"
    dimensions: ClassVar[dict[str, tuple[int, int, int]]] = {"latch": (2, 1, -2)}

    def torque(self, angle, speed):
        return self.latch * ca.tanh(speed / 0.02)

    def layer(self):
        return 0.02, self.latch


@pytest.fixture
def plant(monkeypatch):
    """Gives robots of the name "planted" a term."""
    usual = robot_model.delta_parameters

    def planted(*loads: ArmLoad) -> None:
        def parameters(robot: Robot, payload: float | None):
            found = usual(robot, payload)
            own = loads if robot.name == "planted" else ()
            return replace(found, loads=(*found.loads, *own))

        monkeypatch.setattr(robot_model, "delta_parameters", parameters)

    def forget() -> None:
        for each in (robot_model.model_of, lower_bound, limits_of, problem_of):
            each.cache_clear()

    forget()
    yield planted
    forget()


def robot(**others: Any) -> Robot:
    return ORSINO.model_copy(update={"name": "planted", **others})


def scene(**others: Any) -> Scene:
    usual = {"start": (0.45, -0.05, 0.0), "goal": (0.45, 0.10, 0.0), "payload": 1.0}
    return Scene(**{"robot": robot(), **usual, **others})


GENERAL = {"length": 0.5, "mass": 0.25, "inertia": (0.0052, 2e-4, 0.0053)}
STATES = np.random.default_rng(2).normal(size=(3, 6, 3)) * [[[0.03]], [[1.0]], [[30.0]]]
STATES[0] += [0.45, 0.0, 0.0]


@pytest.mark.parametrize("bars", [None, GENERAL], ids=["slender bars", "general bars"])
def test_torques_are_those_without_it_and_its_own(plant, bars):
    """In the angle-free equations, the general ones, all formulations, and in C for controllers."""
    plant(Spring(STIFFNESS))
    other = {} if bars is None else {"forearm": bars}
    sprung = DeltaModel(robot(**other), 1.0)
    plain = DeltaModel(ORSINO.model_copy(update=other), 1.0)
    angles = plain.inverse_kinematics(STATES[0])[:, 3::3]
    expected = plain.inverse_dynamics(*STATES) + STIFFNESS * (angles - REST)
    assert_allclose(sprung.inverse_dynamics(*STATES), expected, rtol=1e-11)
    for formulation in (Multiplier(), VirtualWork(), Kane()):
        found = DeltaModel(robot(**other), 1.0, formulation).inverse_dynamics(*STATES)
        assert_allclose(found, expected, rtol=1e-10)
    in_c = next(each for each in c_functions(robot(**other)) if each.name() == "inverse_dynamics")
    for x, v, a, tau in zip(*STATES, expected, strict=True):
        assert_allclose(np.array(in_c(x, v, a, 1.0)).ravel(), tau, rtol=1e-10)


def test_no_lower_bound_where_it_does_not_say_what_it_can_give(plant):
    plant(Spring(STIFFNESS))
    assert lower_bound(scene()) == 0.0
    assert lower_bound(scene(robot=ORSINO)) > 0.0


def test_the_lower_bound_reckons_with_what_it_can_give(plant):
    """Heavy rotors and nothing else: T = 2 √(Δθ I / (τ + most)) at least, by motors and springs
    that push and brake all the way."""
    plant(StatedSpring(STIFFNESS))
    heavy = robot(
        upper_arm={"length": 0.2, "mass": 0.0},
        forearm={"length": 0.5, "mass": 0.0},
        platform={"mass": 1e-9},
        gravity=0.0,
        drive={"torque": 10.0, "inertia": 5.0},
    )
    down = Scene(robot=heavy, start=(0.40, 0.0, 0.0), goal=(0.45, 0.0, 0.0))
    ends = DeltaModel(heavy).inverse_kinematics([down.start, down.goal])[:, 3]
    exact = 2 * sqrt(abs(ends[1] - ends[0]) * 5.0 / (10.0 + 3.0 * STIFFNESS))
    assert_allclose(lower_bound(down), exact, rtol=1e-6)


@pytest.mark.parametrize("part", ["potential", "body", "effort"])
def test_no_lower_bound_with_a_part_that_is_not_known(plant, monkeypatch, part):
    """What is added to the mechanism itself, without a term."""
    usual = functions.delta

    def extended(parameters):
        m = usual(parameters)
        changes = {
            "potential": {"potential": 3.0 * ca.cos(m.q[3])},
            "body": {"bodies": (*m.bodies, replace(m.bodies[0], name="camera"))},
            "effort": {"efforts": tuple(replace(each, most=UNBOUNDED) for each in m.efforts)},
        }
        return replace(m, **changes[part])

    monkeypatch.setattr(functions, "delta", extended)
    functions.delta_functions.cache_clear()
    try:
        assert lower_bound(scene()) == 0.0
    finally:
        functions.delta_functions.cache_clear()


def test_planned_verified_and_not_below_its_lower_bound(plant):
    """A spring that helps both motors and brakes: faster than the bound without it allows."""
    plant(StatedSpring(STIFFNESS))
    found = plan(scene(), solver=ipopt, tolerance=1e-2)
    assert verify(found.scene, found.trajectory).failures() == []
    assert 0.0 < found.lower_bound < found.duration
    at = found.trajectory.inside_intervals(np.linspace(0, 1, 20))
    plain = DeltaModel(ORSINO, 1.0)
    angles = plain.inverse_kinematics(at.x)[:, 3::3]
    tau = plain.inverse_dynamics(at.x, at.v, at.a) + STIFFNESS * (angles - REST)
    assert 0.98 < np.abs(tau).max() / 10.0 < 1 + 1e-9


def test_slowing_reckons_with_it(plant):
    """Torques at rest are the spring's too, and with drag they are no polynomial of the speed."""
    for load in (Spring(STIFFNESS), Drag(0.05)):
        plant(load)
        robot_model.model_of.cache_clear()
        problem_of.cache_clear()
        motion = baseline(scene(robot=ORSINO)).slowed(0.7)
        motion = replace(motion, model=robot_model.delta_model(robot(), 1.0))
        factor = safe_factor(problem_of(scene()), motion)
        assert 1 < factor < 2
        highest = np.abs(motion.slowed(factor).inside_intervals(np.linspace(0, 1, 2000)).tau).max()
        assert highest == pytest.approx(10.0, rel=1e-5)


def test_a_sharp_layer_is_met(plant):
    """By the compiled method, which bends less steeply there, and softer on coarse meshes."""
    plant(Latch(1.0))
    model = DeltaModel(robot(), 1.0)
    equations = point_equations(model.functions, limits_of(scene()).constraints)
    assert equations.saturating.numel() == equations.strengths.numel() == 3
    motion = baseline(scene(robot=ORSINO))
    softening = Softening.of(problem_of(scene()), motion, 1e-3)
    assert softening is not None
    coarse, fine = (softening.widths(motion, np.full(n, 1 / n)).max() for n in (8, 80))
    assert coarse > 5 * fine > 0.02
    assert Softening.of(problem_of(scene(robot=ORSINO)), motion, 1e-3) is None


def test_told_or_refused(plant):
    plant(Spring(STIFFNESS))
    assert Spring.words in modelled(scene())
    assert Spring.words not in not_modelled(scene())
    assert "viscous friction" in not_modelled(scene())
    with pytest.raises(Inexpressible, match="has no spring at each arm of an arm"):
        mjcf(robot())
    with pytest.raises(Inexpressible, match="the spring at each arm of the robot's arms cannot"):
        effects_of_terms(scene(), lambda share, name: None)


def test_the_equations_are_those_of_the_terms(plant):
    """A model with a term shares none with one that has a term of another class and the same
    parameters."""
    plant(Spring(STIFFNESS))
    one = DeltaModel(robot(), 1.0).functions
    plant(StatedSpring(STIFFNESS))
    assert one.terms.names == DeltaModel(robot(), 1.0).functions.terms.names
    assert one is not DeltaModel(robot(), 1.0).functions
    assert one is functions.delta_functions(one.terms, Explicit())
