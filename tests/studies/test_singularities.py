"""Where methods fail: singular states, redundant constraints, what the model refuses."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.models import FORWARD, INVERSE
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.compare.dynamics.samples import rounded
from deltaopt.dynamics.constraint_matrix import NullSpace, Partition, RankRevealing
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.linear import singular_directions
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Singular, Singularity
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES, delta
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot
from studies.models.families import Family, Maker, delta_families
from studies.models.singularities import big_system
from studies.problems import PROBLEMS
from tests.dynamics.bricard import bricard, bricard_start
from tests.spherical_pendulum import spherical_pendulum

PENDULUM = spherical_pendulum(1.0, 1.0, 9.81, lambda t: 0.1 * ca.sin(6 * t))


def of_pendulum(name: str, margin: Callable[[ca.SX], ca.SX], guess: list[float]) -> Family:
    """States in which a function of the pendulum's angle θ is the distance."""
    return Family(
        name,
        PENDULUM,
        np.empty(0),
        lambda q, e: ca.vertcat(margin(q[3]) - e, q[4] - 0.3),
        np.array(guess),
    )


# Towards where eq. (11) divides by zero, and where the angle φ loses its meaning.
LEVEL = of_pendulum("level", ca.cos, [0.3, 0.95, 0.0, 1.57, 0.3])
HANGING = of_pendulum("hanging", ca.sin, [0.0, 0.0, 1.0, 0.01, 0.3])
FAMILIES = {f.name: f for f in [*delta_families(), LEVEL, HANGING]}
EXACT = ManyDigits(50)
P = np.array(PAPER.values())
ROBOT = PROBLEMS / "robots/orsino.yaml"


@pytest.fixture(scope="module")
def model() -> DeltaModel:
    return DeltaModel(load_robot(ROBOT), payload=1.0)


def joints(family: Family, distance: float) -> tuple[list[np.ndarray], np.ndarray]:
    """q, q̇, q̈, rounded, and the torques in fifty digits from Q* + Q + Jᵀ λ = 0."""
    maker = Maker(family, EXACT)
    motion = maker.motion(maker.q(distance), np.random.default_rng(4))
    state = [rounded(x) for x in (motion.q, motion.dq, motion.ddq)]
    system = big_system(INVERSE, family.mechanism)
    A, b = EXACT.evaluate(system, [0.0], *state, family.parameters)
    return state, rounded(EXACT.solve(A, b)[:3])


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("distance", [1e-3, 0.0])
def test_states_obey_the_constraints_to_many_digits(name: str, distance: float) -> None:
    family = FAMILIES[name]
    maker = Maker(family, EXACT)
    motion = maker.motion(maker.q(distance), np.random.default_rng(1))
    m = family.mechanism
    rate = m.J @ m.ddq + m.J_bias
    f = ca.Function(
        "f",
        [m.time, m.q, m.dq, m.ddq, m.parameters],
        [ca.vertcat(m.holonomic, m.constraint_rate, rate)],
    )
    (left,) = EXACT.evaluate(f, [0.0], motion.q, motion.dq, motion.ddq, family.parameters)
    assert max(abs(x) for x in left) < 1e-45
    assert 0.1 < max(abs(x) for x in motion.dq) < 5


def error(formulation: object, family: Family, distance: float) -> float:
    state, truth = joints(family, distance)
    inverse = formulation.inverse_dynamics(family.mechanism)  # type: ignore[attr-defined]
    tau = inverse(0.0, *state, family.parameters)[0].full().ravel()
    return float(np.abs(tau - truth).max() / np.abs(truth).max())


def test_closed_form_loses_digits_in_proportion_and_null_space_none() -> None:
    """Towards stretched bars: 1/ε for eq. (55); 1e-9 is what is asked of the null space."""
    family = FAMILIES["stretched"]
    distances = np.array([1e-3, 1e-5, 1e-7, 1e-9])
    errors = [error(Explicit(), family, e) for e in distances]
    assert np.polyfit(np.log10(distances), np.log10(errors), 1)[0] == pytest.approx(-1, abs=0.3)
    assert error(Explicit(), family, 0.0) > 1e-3
    for C in (NullSpace(), MOTOR_ANGLES):
        assert error(Explicit(C), family, 0.0) < 1e-13
    assert error(Multiplier(), family, 0.0) < 1e-13


@pytest.mark.parametrize("distance", [1e-7, 0.0])
@pytest.mark.parametrize("name", ["stretched", "sideways"])
def test_motor_angles_keep_torques_at_serial_singularities(name: str, distance: float) -> None:
    assert error(VirtualWork(MOTOR_ANGLES), FAMILIES[name], distance) < 1e-13


# What the model refuses, and what it still answers


def test_holding_torques_at_the_stretched_boundary(model: DeltaModel) -> None:
    """All chains stretched on the axis: a third of the weight's work each, by hand.

    Virtual work of a chain with both bars along one line from (a1 - a4) outward: moving the
    motor angle alone turns arm and bars so that the platform stays: only arm and bars work.
    """
    a1, a2, a3, a4, g = PAPER.a1, PAPER.a2, PAPER.a3, PAPER.a4, 9.81
    q1 = -np.arccos(-(a1 - a4) / (2 * a2 + 2 * a3))
    q = np.array([-(2 * a2 + 2 * a3) * np.sin(q1), 0, 0, *3 * [q1, q1, 0.0]])
    down = -np.cos(q1)  # of the elbow per unit of arm length and angle
    work = g * (PAPER.m3 * a2 * down + PAPER.m4 * (2 * a2 * down + a3 * down * -a2 / a3))
    still = np.zeros(12)
    np.testing.assert_allclose(model.joint_inverse_dynamics(q, still, still), -work, rtol=1e-12)


@pytest.mark.parametrize("name", ["stretched", "sideways"])
def test_joint_inverse_dynamics_in_many_points(model: DeltaModel, name: str) -> None:
    pairs = [joints(FAMILIES[name], e) for e in (1e-1, 1e-8, 0.0)]
    q, dq, ddq = (np.array([state[i] for state, _ in pairs]) for i in range(3))
    truth = np.array([tau for _, tau in pairs])
    np.testing.assert_allclose(model.joint_inverse_dynamics(q, dq, ddq), truth, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "kind", "chain", "words"),
    [
        ("stretched", Singularity.IN_LINE, 1, "arm and bars of chain 1 are in line"),
        ("sideways", Singularity.SIDEWAYS, 1, "bars of chain 1 lie sideways"),
    ],
)
def test_serial_singularities_are_named(
    model: DeltaModel, name: str, kind: Singularity, chain: int, words: str
) -> None:
    near = rounded(Maker(FAMILIES[name], EXACT).q(1e-7))[:3]
    v, zero = np.array([0.1, 0.0, 0.2]), np.zeros(3)
    calls = (
        lambda: model.inverse_dynamics(near, v, zero),
        lambda: model.motion(near, v, zero),
        lambda: model.forward_dynamics(near, v, zero),
        lambda: model.multipliers(near, v, zero),
    )
    for call in calls:
        with pytest.raises(Singular, match=words) as caught:
            call()
        assert (caught.value.kind, caught.value.chain) == (kind, chain)
        assert 0 < abs(caught.value.margin) < 1e-6
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_at_rest_near_a_serial_singularity_there_is_an_answer(model: DeltaModel) -> None:
    zero = np.zeros(3)
    for name in ("stretched", "sideways"):
        near = rounded(Maker(FAMILIES[name], EXACT).q(1e-6))
        held = model.inverse_dynamics(np.vstack([near[:3], [0.45, 0, 0]]), zero, zero)
        truth = model.joint_inverse_dynamics(near, np.zeros(12), np.zeros(12))
        np.testing.assert_allclose(held[0], truth, rtol=1e-8)
        np.testing.assert_allclose(held[1], 1.87045266200582, rtol=1e-12)
        np.testing.assert_array_equal(model.inverse_dynamics(near[:3], zero, zero), held[0])


def test_the_first_singular_point_that_moves_is_named(model: DeltaModel) -> None:
    near = rounded(Maker(FAMILIES["stretched"], EXACT).q(1e-7))[:3]
    v = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0, 0]])
    for x in (np.array([near, [0.45, 0, 0], near]), near):
        with pytest.raises(Singular) as caught:
            model.inverse_dynamics(x, v, np.zeros(3))
        assert str(caught.value).startswith("point 2" if x.ndim == 2 else "point 1")
    assert model.inverse_dynamics(near, 0 * v, np.zeros(3)).shape == (3, 3)


def test_the_parallel_singularity_is_named_for_torques_only(model: DeltaModel) -> None:
    at, zero = rounded(Maker(FAMILIES["coplanar"], EXACT).q(0.0)), np.zeros(3)
    for call in (
        lambda: model.inverse_dynamics(at[:3], zero, zero),
        lambda: model.joint_inverse_dynamics(at, np.zeros(12), np.zeros(12)),
    ):
        with pytest.raises(Singular, match="parallel singularity") as caught:
            call()
        assert caught.value.kind is Singularity.PARALLEL
    a = model.forward_dynamics(at[:3], zero, zero)
    again = DeltaModel(model.robot, 1.0, Multiplier()).forward_dynamics(at[:3], zero, zero)
    np.testing.assert_allclose(a, again, rtol=1e-9)


def test_accelerations_near_a_serial_singularity(model: DeltaModel) -> None:
    """At ε = 1e-4 eq. (55) has three digits; the model gives what L_I does in fifty."""
    family = FAMILIES["stretched"]
    x = rounded(Maker(family, EXACT).q(1e-4))[:3]
    v, tau = np.zeros(3), np.array([1.0, -0.5, 0.3])
    (q,) = EXACT.evaluate(model.functions.inverse_kinematics, x, P)
    system = big_system(FORWARD, family.mechanism)
    A, b = EXACT.evaluate(system, [0.0], q, np.zeros(12), tau, P)
    truth = rounded(EXACT.solve(A, b)[:3])
    np.testing.assert_allclose(model.forward_dynamics(x, v, tau), truth, rtol=1e-7)


# Redundant constraints


def test_singular_directions_of_a_matrix_of_known_rank() -> None:
    rng = np.random.default_rng(2)
    A = rng.normal(size=(5, 2)) @ rng.normal(size=(2, 4))
    inverse, free = (x.full() for x in singular_directions(5, 4, 2, 1e-8)(A))
    np.testing.assert_allclose(inverse, np.linalg.pinv(A), atol=1e-13)
    np.testing.assert_allclose(A @ free, 0, atol=1e-13)
    np.testing.assert_allclose(free.T @ free, np.eye(2), atol=1e-14)
    assert np.isnan(singular_directions(5, 4, 2, 1e-8)(A * np.nan)[0].full()).all()


def test_rank_revealing_agrees_with_the_null_space_where_both_work() -> None:
    m, q = delta(PAPER), rounded(Maker(FAMILIES["stretched"], EXACT).q(0.1))
    C, P_ = (x.full() for x in RankRevealing(3).function(m)(0, q, P))
    N, pseudo = (x.full() for x in NullSpace().function(m)(0, q, P))
    np.testing.assert_allclose(C @ C.T, N @ N.T, atol=1e-13)
    np.testing.assert_allclose(P_, pseudo, atol=1e-12 * np.abs(pseudo).max())


def test_bricard_has_one_redundant_constraint_and_one_freedom() -> None:
    m, (q, _) = bricard(), bricard_start()
    J = ca.Function("J", [m.q], [ca.densify(m.J)])(q).full()
    assert J.shape == (24, 24)
    assert np.linalg.matrix_rank(J) == 23
    assert np.abs(ca.Function("f", [m.q], [m.holonomic])(q).full()).max() == 0


@pytest.mark.parametrize("matrix", [NullSpace(), Partition(())])
def test_redundant_constraints_are_refused_by_matrices_that_need_full_rank(
    matrix: NullSpace | Partition,
) -> None:
    with pytest.raises(ValueError, match=r"24 constraints for 24 coordinates.*RankRevealing"):
        matrix.function(bricard())


def test_formulations_for_redundant_constraints_keep_energy_and_constraints() -> None:
    """On the way that both accelerations begin: f stays zero, and work is that of gravity alone."""
    m, (q, _) = bricard(), bricard_start()
    free = np.linalg.svd(ca.Function("J", [m.q], [ca.densify(m.J)])(q).full())[2][-1]
    accelerations, _ = Explicit(RankRevealing(1)).forward_dynamics(m)(0.0, q, 2 * free, [], [])
    found = np.array(accelerations.full()).ravel()
    inputs, *system = Multiplier().forward_system(m)
    A, b = (x.full() for x in ca.Function("system", inputs, system)(0.0, q, 2 * free, [], []))
    by_multipliers = np.linalg.lstsq(A, b.ravel(), rcond=1e-8)[0]
    np.testing.assert_allclose(found, by_multipliers[: len(found)], atol=1e-9)
    state = [m.q, m.dq, m.ddq]
    rate = ca.Function("rate", state, [m.J @ m.ddq + m.J_bias])(q, 2 * free, found).full()
    assert np.abs(rate).max() < 1e-9
    power = sum(
        body.mass
        * ca.dot(
            ca.jtimes(body.position, m.q, m.dq),
            ca.jtimes(ca.jtimes(body.position, m.q, m.dq), m.q, m.dq)
            + ca.jtimes(body.position, m.q, m.ddq)
            - m.gravity,
        )
        for body in m.bodies
    )
    assert abs(float(ca.Function("power", state, [power])(q, 2 * free, found))) < 1e-9


def test_task_space_torques_lose_digits_with_the_square_of_the_distance(model: DeltaModel) -> None:
    """What the limits in model.py rest on: a platform in motion towards stretched bars."""
    v, a = np.array([0.3, 0.2, -0.1]), np.array([1.0, -2.0, 0.5])
    system = big_system(INVERSE, delta(PAPER))
    errors = []
    for distance in (1e-3, 1e-4, 1e-5, 2e-6):
        x = rounded(Maker(FAMILIES["stretched"], EXACT).q(distance))[:3]
        A, b = EXACT.evaluate(system, [0.0], *EXACT.evaluate(model.functions.motion, x, v, a, P), P)
        truth = rounded(EXACT.solve(A, b)[:3])
        errors.append(np.abs(model.inverse_dynamics(x, v, a) / truth - 1).max())
    assert errors[0] < 1e-8
    assert errors[-1] < 1e-2
    slope = np.polyfit(np.log10([1e-3, 1e-4, 1e-5, 2e-6]), np.log10(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.5)
