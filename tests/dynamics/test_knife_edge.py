"""A blade on an incline: a nonholonomic mechanism without motors, with a known motion.

Coordinates x (down the slope), y, φ; the blade does not slip sideways: ẋ sin φ - ẏ cos φ = 0.
Let go at rest while turning at ω, under the gravity a along the slope:

    x = a/(2ω²) sin² ωt,   y = a/(2ω²) (ωt - sin 2ωt / 2),   φ = ωt,   λ = -2 m a sin ωt

so it never runs down, but creeps along the slope.
"""

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Body, Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from tests import paper_delta

SX = ca.SX
MASS, INERTIA, A, OMEGA = 1.7, 0.3, 4.0, 1.9


def knife_edge():
    q, dq = SX.sym("q", 3), SX.sym("dq", 3)
    sin, cos = ca.sin(q[2]), ca.cos(q[2])
    blade = Body(
        name="blade",
        mass=MASS,
        position=ca.vertcat(q[0], q[1], 0),
        inertia=SX([0, 0, INERTIA]),
        angular_velocity=ca.vertcat(0, 0, dq[2]),
    )
    along = ca.vertcat(ca.horzcat(cos, 0), ca.horzcat(sin, 0), ca.horzcat(0, 1))
    return Mechanism(
        name="knife edge",
        q=q,
        dq=dq,
        bodies=(blade,),
        nonholonomic=dq[0] * sin - dq[1] * cos,  # eq. (3)
        gravity=SX([A, 0, 0]),
        closed_form=(along, ca.vertcat(sin, -cos, 0)),
    )


def blade_speeds(m):
    """Along the blade, across it, and turning."""
    sin, cos = ca.sin(m.q[2]), ca.cos(m.q[2])
    along, across = cos * m.dq[0] + sin * m.dq[1], -sin * m.dq[0] + cos * m.dq[1]
    return ca.vertcat(along, across, m.dq[2])


def motion(t):
    """q, q̇, q̈, λ."""
    s, c, angle = np.sin(2 * OMEGA * t), np.cos(2 * OMEGA * t), OMEGA * t
    q = [A * (1 - c) / (4 * OMEGA**2), A * (angle - s / 2) / (2 * OMEGA**2), angle]
    dq = [A * s / (2 * OMEGA), A * (1 - c) / (2 * OMEGA), OMEGA]
    return np.array(q), np.array(dq), np.array([A * c, A * s, 0]), -2 * MASS * A * np.sin(angle)


FORMULATIONS = [
    Multiplier(),
    *(
        kind(C)
        for kind in (VirtualWork, Explicit, Kane)
        for C in (ClosedForm(), Partition((0, 2)), NullSpace())
    ),
    Kane(ClosedForm(), blade_speeds),
]


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=paper_delta.name)
def test_accelerations_and_force_on_the_blade(formulation):
    forward = formulation.forward_dynamics(knife_edge())
    for t in (0.1, 0.3, 0.6, 1.3, 2.0):
        q, dq, ddq, lam = motion(t)
        found, force = forward(t, q, dq, [], [])
        np.testing.assert_allclose(np.array(found).ravel(), ddq, rtol=0, atol=1e-13)
        np.testing.assert_allclose(float(force), lam, rtol=1e-13)


@pytest.mark.parametrize("formulation", [VirtualWork(), Kane(NullSpace(), blade_speeds)])
def test_follows_the_analytic_motion(formulation):
    m = knife_edge()
    q, dq = ca.MX.sym("q", 3), ca.MX.sym("dq", 3)
    ddq, _ = formulation.forward_dynamics(m)(0, q, dq, [], [])
    ode = {"x": ca.vertcat(q, dq), "ode": ca.vertcat(dq, ddq)}
    tolerances = {"reltol": 1e-13, "abstol": 1e-13, "max_num_steps": 100_000}
    run = ca.integrator("motion", "cvodes", ode, 0, 5, tolerances)
    end = np.array(run(x0=np.r_[motion(0)[0], motion(0)[1]])["xf"]).ravel()
    np.testing.assert_allclose(end[:3], motion(5)[0], atol=1e-9)
    np.testing.assert_allclose(end[3:], motion(5)[1], atol=1e-9)
