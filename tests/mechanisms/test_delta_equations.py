"""What is derived for the Delta against what the paper prints, eq. (50)-(83)."""

import casadi as ca
import mpmath
import numpy as np
import pytest

from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.mechanisms.delta.mechanism import delta
from tests import paper_delta as paper


@pytest.fixture(scope="module", params=["delta_paper", "delta_general_inertia"])
def case(request):
    """Parameters, mechanism, and 20 states off the constraints: q, q̇, q̈, τ random."""
    p = paper.reference(request.param).p
    rng = np.random.default_rng(1)
    return p, delta(p), [rng.normal(size=(4, 12)) * [[1], [5], [50], [9]] for _ in range(20)]


def evaluate(m, p, expression, q, dq, ddq, tau):
    """The number an expression of the mechanism has at a state."""
    symbols = [m.q, m.dq, m.ddq, m.controls, m.parameters]
    f = ca.Function("f", symbols, [expression])
    return np.array(f(q, dq, ddq, tau[:3], paper.values(p))).squeeze()


def close(actual, expected):
    return np.abs(actual - expected).max() <= 1e-14 * (1 + np.abs(expected).max())


def test_constraints_and_their_jacobian(case):
    p, m, states = case
    for x in states:
        assert close(evaluate(m, p, m.holonomic, *x), paper.constraints(p, x[0]))
        assert close(evaluate(m, p, m.J, *x), paper.jacobian(p, x[0]))


def test_constraint_matrix(case):
    p, m, states = case
    f = ClosedForm().function(m)
    for q, *_ in states:
        C, P = f(0, q, paper.values(p))
        expected = paper.constraint_matrix(p, q)
        np.testing.assert_allclose(C, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
        np.testing.assert_allclose(paper.jacobian(p, q) @ P, np.eye(9), atol=1e-11)


def test_velocities_of_centres_of_mass(case):
    p, m, states = case
    for x in states:
        derived = [evaluate(m, p, m.velocity(body), *x) for body in m.bodies]
        assert close(np.array(derived), np.array(paper.velocities(p, x[0], x[1])))


def test_energies(case):
    p, m, states = case
    for x in states:
        assert close(evaluate(m, p, m.T, *x), paper.kinetic_energy(p, x[0], x[1]))
        assert close(evaluate(m, p, m.V, *x), paper.potential_energy(p, x[0]))


def test_inertia_matrix_gyroscopic_and_active_forces(case):
    p, m, states = case
    for x in states:
        q, dq, _, tau = x
        assert close(evaluate(m, p, m.M, *x), paper.inertia_matrix(p, q))
        assert close(evaluate(m, p, m.Q_gyr, *x), paper.gyroscopic_force(p, q, dq))
        assert close(evaluate(m, p, m.Q, *x), paper.active_force(p, q, tau))


def test_inertia_and_weight_are_those_of_particles(case):
    """Eq. (31) and (33) against eq. (12): each body as particles of the same inertia.

    No angular velocity, no energy: only where the particles are, differentiated numerically
    at 30 digits along the motion q + q̇ t + q̈ t²/2.
    """
    p, m, states = case
    q, dq, ddq, _ = states[0]
    with mpmath.workdps(30):
        force = np.zeros(12)
        for mass, where in particles(p):
            a = acceleration(where, q, dq, ddq)
            for i in range(12):
                slope = mpmath.diff(lambda s, i=i, r=where: r(shift(q, i, s)), 0)
                force[i] += float(mass * sum(slope * ((p.g, 0, 0) - a)))
    derived = evaluate(m, p, m.Q_star + m.Q, q, dq, ddq, np.zeros(12))
    np.testing.assert_allclose(derived, force, rtol=1e-12, atol=1e-12)


def acceleration(where, q, dq, ddq):
    t = mpmath.mpf(10) ** -10  # central difference: error t² beside 30 digits
    before, now, after = (where(q + dq * s + ddq * s * s / 2) for s in (-t, 0 * t, t))
    return (before - 2 * now + after) / t**2


def shift(q, i, s):
    moved = np.array(q, dtype=object)
    moved[i] += s
    return moved


def particles(p):
    """(mass, position as a function of q) of particles that move as the bodies do."""
    found = [(p.m1 + p.m2, lambda q: q[:3])]
    for k in range(3):
        found += pairs(p.m3, (0, p.I33, p.I33), lambda q, d, k=k: on_arm(p, k, q, d))
        bars = (p.I41, paper.axial(p), p.I43)
        found += pairs(p.m4, bars, lambda q, d, k=k: on_bars(p, k, q, d))
    return found


def pairs(mass, inertia, place):
    """Six particles at ± a distance on each principal axis, with these moments of inertia.

    For the arm, turning about its third axis only, moments of a thin bar along the first do.
    """
    total = sum(inertia) / 2
    for axis in range(3):
        offset = np.zeros(3)
        offset[axis] = np.sqrt(3 * max(total - inertia[axis], 0) / mass)
        for d in (offset, -offset):
            yield mass / 6, lambda q, d=d: place(q, d)


def on_arm(p, k, q, d):
    return in_base(k, shoulder(p) + turn(2, q[3 + 3 * k], np.array([d[1], p.a2 + d[0], d[2]])))


def on_bars(p, k, q, d):
    q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
    elbow = shoulder(p) + turn(2, q1, np.array([0, 2 * p.a2, 0]))
    return in_base(k, elbow + turn(2, q2, turn(0, q3, np.array([d[0], p.a3 + d[1], d[2]]))))


def shoulder(p):
    return np.array([0, p.a1, 0])


def in_base(k, r):
    return turn(0, paper.PHI[k], r)


def turn(axis, angle, r):
    """r rotated about a coordinate axis."""
    c, s, i, j = mpmath.cos(angle), mpmath.sin(angle), (axis + 1) % 3, (axis + 2) % 3
    turned = np.array(r, dtype=object)
    turned[i], turned[j] = c * r[i] - s * r[j], s * r[i] + c * r[j]
    return turned
