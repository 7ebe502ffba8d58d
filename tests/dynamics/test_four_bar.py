"""The planar four-bar in three angles against its one equation in the crank's angle.

By hand, at 40 digits: with the other two angles as functions of the crank's θ, from two
circles, T = m(θ) θ̇²/2 and m(θ) θ̈ + m'(θ) θ̇²/2 + V'(θ) = τ.
"""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from deltaopt.dynamics.constraint_matrix import NullSpace, Partition
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Body, Effort, Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from tests import paper_delta

SX = ca.SX
GROUND, LENGTHS, MASSES, G = 0.5, (0.2, 0.45, 0.4), (0.3, 0.7, 0.6), 9.81
STIFFNESS = 2.5  # of a torsion spring at the rocker, N·m/rad
INERTIAS = tuple(m * length**2 / 12 for m, length in zip(MASSES, LENGTHS, strict=True))


def four_bar():
    """Crank, coupler, rocker with angles q from the line of the ground; a motor at the crank."""
    q, dq, tau = SX.sym("q", 3), SX.sym("dq", 3), SX.sym("tau")
    bars = [length * direction(q[i]) for i, length in enumerate(LENGTHS)]
    ground = SX([GROUND, 0, 0])
    centres = [bars[0] / 2, bars[0] + bars[1] / 2, ground + bars[2] / 2]
    bodies = tuple(
        Body(f"bar {i}", MASSES[i], centres[i], SX([0, 0, INERTIAS[i]]), ca.vertcat(0, 0, dq[i]))
        for i in range(3)
    )
    return Mechanism(
        name="four-bar",
        q=q,
        dq=dq,
        bodies=bodies,
        efforts=(Effort(tau, dq[0]),),
        controls=tau,
        holonomic=(bars[0] + bars[1] - ground - bars[2])[:2],
        gravity=SX([0, -G, 0]),
        potential=STIFFNESS * q[2] ** 2 / 2,
    )


def direction(angle):
    return ca.vertcat(ca.cos(angle), ca.sin(angle), 0)


def angles(theta):
    """Of crank, coupler and rocker, with the joint between these two on the upper side."""
    a, b, c = LENGTHS
    elbow = a * mp.expj(theta)
    across = GROUND - elbow
    reach = abs(across)
    open_by = mp.acos((b**2 + reach**2 - mp.mpf(c) ** 2) / (2 * b * reach))
    coupler = mp.arg(across) + open_by
    return [theta, coupler, mp.arg(elbow + b * mp.expj(coupler) - GROUND)]


def centres(theta):
    a, b, c = (
        length * mp.expj(angle) for length, angle in zip(LENGTHS, angles(theta), strict=True)
    )
    return [a / 2, a + b / 2, GROUND + c / 2]


def effective_inertia(theta):
    """m(θ), twice the kinetic energy at θ̇ = 1."""
    total = mp.mpf(0)
    for i in range(3):
        speed = mp.diff(lambda s, i=i: centres(s)[i], theta)
        turn = mp.diff(lambda s, i=i: angles(s)[i], theta)
        total += MASSES[i] * abs(speed) ** 2 + INERTIAS[i] * turn**2
    return total


def potential_energy(theta):
    height = sum(m * r.imag for m, r in zip(MASSES, centres(theta), strict=True))
    return G * height + STIFFNESS * angles(theta)[2] ** 2 / 2


def motion(theta, rate, acceleration):
    """q, q̇, q̈ and the torque of the one equation."""
    with mp.workdps(40):
        columns = [mp.taylor(lambda s, i=i: angles(s)[i], theta, 2) for i in range(3)]
        q, slope, half = (np.array([float(c[k]) for c in columns]) for k in range(3))
        torque = effective_inertia(theta) * acceleration + mp.diff(potential_energy, theta)
        torque += mp.diff(effective_inertia, theta) * rate**2 / 2
    return q, slope * rate, 2 * half * rate**2 + slope * acceleration, float(torque)


@pytest.fixture(scope="module")
def motions():
    rng = np.random.default_rng(2)
    return [motion(*x) for x in rng.uniform([0, -9, -50], [6.28, 9, 50], size=(8, 3))]


MATRICES = [Partition((0,)), Partition((2,)), NullSpace()]
FORMULATIONS = [
    Multiplier(),
    *(kind(C) for kind in (VirtualWork, Explicit, Kane) for C in MATRICES),
]


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=paper_delta.name)
def test_dynamics_are_those_of_the_crank_alone(motions, formulation):
    m = four_bar()
    inverse, forward = formulation.inverse_dynamics(m), formulation.forward_dynamics(m)
    for q, dq, ddq, torque in motions:
        tau, _ = inverse(0, q, dq, ddq, [])
        found, _ = forward(0, q, dq, torque, [])
        np.testing.assert_allclose(float(tau), torque, rtol=1e-12)
        np.testing.assert_allclose(
            np.array(found).ravel(), ddq, rtol=0, atol=1e-12 * abs(ddq).max()
        )
