"""The spherical pendulum on a moving base against its equations in θ and φ, made by hand.

With z down, a thin bar of moment m l²/3 about its end, and gravity g - ζ̈ felt on the base:

    (l/3) (θ̈ - sin θ cos θ φ̇²) = -(g - ζ̈) sin θ / 2 + τ_θ/(m l)
    (l/3) (sin²θ φ̈ + 2 sin θ cos θ θ̇ φ̇) = τ_ψ cos θ/(m l)

The tip is massless and half the weight hangs on it in the redundant coordinates, so
λ = m/2 (a* - g), with a* of the bar's centre.
"""

import casadi as ca
import numpy as np
import pytest
from numpy import cos, sin

from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from tests import paper_delta
from tests.spherical_pendulum import spherical_pendulum

L, MASS, G = 0.7, 1.3, 9.81
HEIGHT, RATE = 0.1, 7.0


def zeta(t):
    return HEIGHT * ca.sin(RATE * t)


def zeta_rates(t):
    return HEIGHT * np.array([sin(RATE * t), RATE * cos(RATE * t), -(RATE**2) * sin(RATE * t)])


def angle_accelerations(t, theta, phi, dtheta, dphi, torque=(0.0, 0.0)):
    """θ̈, φ̈ of the equations above."""
    push = 3 / (MASS * L**2)
    felt = G - zeta_rates(t)[2]
    ddtheta = sin(theta) * cos(theta) * dphi**2 - 1.5 * felt / L * sin(theta) + push * torque[1]
    moment = push * torque[0] * cos(theta) - 2 * sin(theta) * cos(theta) * dtheta * dphi
    return np.array([ddtheta, moment / sin(theta) ** 2])


def tip(t, angles, rates, accelerations):
    """Position, velocity and acceleration of P, eq. (9), differentiated by hand."""
    (theta, phi), (a, b), (da, db) = angles, rates, accelerations
    s, c, sp, cp = sin(theta), cos(theta), sin(phi), cos(phi)
    base = np.outer(zeta_rates(t), [0, 0, 1])
    r = L * np.array([s * sp, s * cp, c])
    v = L * np.array([c * sp * a + s * cp * b, c * cp * a - s * sp * b, -s * a])
    acc = L * np.array(
        [
            c * sp * da + s * cp * db + 2 * c * cp * a * b - s * sp * (a**2 + b**2),
            c * cp * da - s * sp * db - 2 * c * sp * a * b - s * cp * (a**2 + b**2),
            -s * da - c * a**2,
        ]
    )
    return base + np.array([r, v, acc])


def angular_speeds(m):
    """Velocity of the tip beside the base, and ω about the bar and across it."""
    dzeta = ca.jacobian(zeta(m.time), m.time)
    return ca.vertcat(m.dq[:2], m.dq[2] - dzeta, m.dq[3], ca.cos(m.q[3]) * m.dq[4])


MATRICES = [ClosedForm(), Partition((3, 4)), Partition((0, 1)), NullSpace()]
FORMULATIONS = [
    Multiplier(),
    *(kind(C) for kind in (VirtualWork, Explicit, Kane) for C in MATRICES),
    Kane(ClosedForm(), angular_speeds),
]


@pytest.fixture(scope="module")
def pendulum():
    return spherical_pendulum(L, MASS, G, zeta)


@pytest.fixture(scope="module")
def motions():
    """t, q, q̇, q̈, τ, λ at random, away from the poles and the horizontal."""
    rng, rows = np.random.default_rng(11), []
    for _ in range(200):
        t, angles, rates = rng.uniform(0, 5), rng.uniform(0.3, 1.2, size=2), rng.normal(size=2) * 3
        torque = rng.normal(size=2) * 4
        accelerations = angle_accelerations(t, *angles, *rates, torque)
        r, v, a = tip(t, angles, rates, accelerations)
        base_acceleration = np.array([0, 0, zeta_rates(t)[2]])
        lam = MASS / 2 * ((a + base_acceleration) / 2 - np.array([0, 0, G]))
        state = [np.r_[r, angles], np.r_[v, rates], np.r_[a, accelerations]]
        rows.append(np.r_[t, *state, torque, lam])
    return np.split(np.array(rows).T, [1, 6, 11, 16, 18])


def error(actual, expected):
    """Relative, the worst of the columns."""
    off = np.linalg.norm(np.array(actual) - expected, axis=0)
    return (off / np.linalg.norm(expected, axis=0)).max()


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=paper_delta.name)
def test_dynamics_are_those_of_the_two_angles(pendulum, motions, formulation):
    t, q, dq, ddq, tau, lam = motions
    none = np.empty((0, t.shape[1]))
    n = t.shape[1]
    found_tau, found_lam = formulation.inverse_dynamics(pendulum).map(n)(t, q, dq, ddq, none)
    assert error(found_tau, tau) < 1e-12
    assert error(found_lam, lam) < 1e-12
    found_ddq, found_lam = formulation.forward_dynamics(pendulum).map(n)(t, q, dq, tau, none)
    assert error(found_ddq, ddq) < 1e-12
    assert error(found_lam, lam) < 1e-12


def test_constraints(pendulum, motions):
    """Eq. (9), and its rates, vanish on tips written down by hand."""
    m, (t, q, dq, ddq, *_) = pendulum, motions
    f = ca.Function(
        "f",
        [m.time, m.q, m.dq, m.ddq],
        [m.holonomic, m.J @ m.dq + m.mu, m.J @ m.ddq + m.J_bias],
    ).map(t.shape[1])
    for residual, size in zip(f(t, q, dq, ddq), (1, 10, 100), strict=True):
        assert np.abs(np.array(residual)).max() < 1e-14 * size


def test_constraint_matrix(pendulum, motions):
    """Eq. (11) as printed."""
    _, q, *_ = motions
    f = ClosedForm().function(pendulum)
    for theta, phi in q[3:, :20].T:
        printed = [
            [L * np.tan(theta) * cos(phi), L * cos(theta) * sin(phi)],
            [-L * np.tan(theta) * sin(phi), L * cos(theta) * cos(phi)],
            [0, -L * sin(theta)],
            [0, 1],
            [1 / cos(theta), 0],
        ]
        C, _ = f(0, [0, 0, 0, theta, phi], [])
        np.testing.assert_allclose(C, printed, rtol=1e-15, atol=1e-15)


def test_speed_psi_is_no_coordinate(pendulum):
    """∂C/∂q of the φ row in ψ: dψ = cos θ dφ is not exact, as ∂(cos θ)/∂θ ≠ 0."""
    C, _ = pendulum.closed_form
    m = pendulum
    speeds = ca.vertcat(ca.cos(m.q[3]) * m.dq[4], m.dq[3])  # ψ̇, θ̇
    rebuilt = ca.Function("r", [m.q, m.dq], [C @ speeds])
    q, dq = np.array([0, 0, 0, 0.8, 0.5]), np.array([0, 0, 0, 0.3, -0.7])
    consistent = tip(0, q[3:], dq[3:], (0, 0))[1] - [0, 0, zeta_rates(0)[1]]
    np.testing.assert_allclose(rebuilt(q, dq), np.c_[[*consistent, *dq[3:]]], atol=1e-15)


def test_motion_of_five_seconds(pendulum):
    """L_E in five coordinates, integrated by cvodes, against the two angles by Runge-Kutta."""
    t, x = 0.0, np.array([1.0, 0.2, 0.0, 3.0])  # θ, φ, θ̇, φ̇
    r, v, _ = tip(t, x[:2], x[2:], (0, 0))
    start = np.r_[r, x[:2], v, x[2:]]

    def slope(t, x):
        return np.r_[x[2:], angle_accelerations(t, *x)]

    step = 5e-4
    for _ in range(10_000):
        k1 = slope(t, x)
        k2 = slope(t + step / 2, x + step / 2 * k1)
        k3 = slope(t + step / 2, x + step / 2 * k2)
        k4 = slope(t + step, x + step * k3)
        t, x = t + step, x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    r, v, _ = tip(5.0, x[:2], x[2:], (0, 0))

    m = pendulum
    ddq, _ = Explicit().forward_dynamics(m)(m.time, m.q, m.dq, ca.SX.zeros(2), [])
    ode = {"t": m.time, "x": ca.vertcat(m.q, m.dq), "ode": ca.vertcat(m.dq, ddq)}
    tolerances = {"reltol": 1e-13, "abstol": 1e-13, "max_num_steps": 100_000}
    end = ca.integrator("motion", "cvodes", ode, 0, 5, tolerances)(x0=start)["xf"]
    np.testing.assert_allclose(end[:5], np.c_[[*r, *x[:2]]], atol=1e-9)
    np.testing.assert_allclose(end[5:], np.c_[[*v, *x[2:]]], atol=1e-8)
