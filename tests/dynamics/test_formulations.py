"""The formulations against each other and against the reference, on the Delta.

Errors are relative to the longest vector of the kind: |a - b| / |b|.
"""

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.mechanism import delta
from tests import paper_delta as paper

MATRICES = [ClosedForm(), Partition((0, 1, 2)), Partition((3, 6, 9)), NullSpace()]
FORMULATIONS = [
    Multiplier(),
    *(kind(C) for kind in (VirtualWork, Explicit, Kane) for C in MATRICES),
]


def bar_speeds(mechanism):
    """Platform velocity, arm rates, and for each pair of bars ω about its two cross axes."""
    q, dq = mechanism.q, mechanism.dq
    u = [dq[:3]]
    for k in range(3, 12, 3):
        u.append(ca.vertcat(dq[k], ca.cos(q[k + 2]) * dq[k + 1], dq[k + 2]))
    return ca.vertcat(*u)


def sum_speeds(mechanism):
    """u = X q̇ + y with X full, far from the unit matrix, and y ≠ 0."""
    n = mechanism.q.numel()
    mix = np.random.default_rng(7).normal(size=(n, n)) + 5 * np.eye(n)
    return ca.DM(mix) @ mechanism.dq + ca.sin(mechanism.q) + 0.3 * ca.cos(mechanism.time)


def error(actual, expected):
    """Relative, row by row."""
    scale = np.linalg.norm(expected, axis=1)
    return np.linalg.norm(np.array(actual).T - expected, axis=1) / np.where(scale > 0, scale, 1)


class Delta:
    """A Delta with its numbers put in: arrays of states in, arrays out."""

    def __init__(self, p):
        self.p, self.mechanism = p, delta(p)

    def call(self, function, *state):
        return function.map(len(state[0]))(0, *(s.T for s in state), paper.values(self.p))

    def inverse(self, formulation, q, dq, ddq):
        return self.call(formulation.inverse_dynamics(self.mechanism), q, dq, ddq)

    def forward(self, formulation, q, dq, tau):
        return self.call(formulation.forward_dynamics(self.mechanism), q, dq, tau)


@pytest.fixture(scope="module")
def robot():
    return Delta(paper.reference("delta_paper").p)


@pytest.fixture(scope="module")
def states(robot):
    """250 motions that obey the constraints: q, q̇, q̈, and torques that are not theirs."""
    rng = np.random.default_rng(42)
    m, rows = robot.mechanism, []
    bias = ca.Function("bias", [m.q, m.dq, m.parameters], [m.J_bias])
    for _ in range(250):
        q = paper.inverse_kinematics(robot.p, rng.uniform([0.38, -0.12, -0.12], [0.6, 0.12, 0.12]))
        J, v, a = paper.jacobian(robot.p, q), rng.normal(size=3), 20 * rng.normal(size=3)
        dq = paper.constraint_matrix(robot.p, q) @ v
        at = np.array(bias(q, dq, paper.values(robot.p))).ravel()
        ddq = np.concatenate([a, np.linalg.solve(J[:, 3:], -at - J[:, :3] @ a)])
        assert np.abs(paper.constraints(robot.p, q)).max() < 1e-15
        rows.append(np.concatenate([q, dq, ddq, rng.uniform(-10, 10, size=3)]))
    return np.split(np.array(rows), [12, 24, 36], axis=1)


@pytest.mark.parametrize("formulation", FORMULATIONS[1:], ids=paper.name)
def test_formulations_agree(robot, states, formulation):
    agree(robot, states, formulation, FORMULATIONS[0])


@pytest.mark.parametrize("speeds", [bar_speeds, sum_speeds])
def test_general_speeds_change_nothing(robot, states, speeds):
    agree(robot, states, Kane(speeds=speeds), Multiplier())


def agree(robot, states, one, other):
    q, dq, ddq, tau = states
    for a, b in zip(
        (*robot.inverse(one, q, dq, ddq), *robot.forward(one, q, dq, tau)),
        (*robot.inverse(other, q, dq, ddq), *robot.forward(other, q, dq, tau)),
        strict=True,
    ):
        assert error(a, np.array(b).T).max() < 1e-12


def test_partition_pivoted_at_each_state(robot, states):
    q, dq, ddq, _ = states
    choices = [Partition.pivoted(paper.jacobian(robot.p, row)) for row in q]
    tau, lam = robot.inverse(Multiplier(), q, dq, ddq)
    for choice in set(choices):
        rows = np.array([c == choice for c in choices])
        own_tau, own_lam = robot.inverse(Explicit(choice), q[rows], dq[rows], ddq[rows])
        assert error(own_tau, np.array(tau).T[rows]).max() < 1e-12
        assert error(own_lam, np.array(lam).T[rows]).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=paper.name)
@pytest.mark.parametrize("name", ["delta_paper", "delta_general_inertia"])
def test_reference(name, formulation):
    """Torques and accelerations to 1e-12 (1 + cond), multipliers to 1e-10."""
    r = paper.reference(name)
    robot = Delta(r.p)
    tau, lam = robot.inverse(formulation, r.q, r.qd, r.qdd)
    ddq, lam_forward = robot.forward(formulation, r.q, r.qd, r.tau)
    assert (error(tau, r.tau) / (1 + r.cond)).max() < 1e-12
    assert (error(ddq, r.qdd) / (1 + r.cond)).max() < 1e-12
    assert error(lam, r.lam).max() < 1e-10
    assert error(lam_forward, r.lam).max() < 1e-10


@pytest.mark.parametrize("matrix", MATRICES, ids=repr)
def test_constraint_forces_do_no_work(robot, states, matrix):
    """Cᵀ Jᵀ λ = 0, with the printed J, beside the size of what cancels."""
    q, dq, ddq, _ = states
    _, lam = robot.inverse(VirtualWork(matrix), q, dq, ddq)
    C_of = matrix.function(robot.mechanism)
    for row, forces in list(zip(q, np.array(lam).T, strict=True)):
        C, _ = C_of(0, row, paper.values(robot.p))
        C, constraint_force = np.array(C), paper.jacobian(robot.p, row).T @ forces
        assert np.all(
            np.abs(C.T @ constraint_force) <= 1e-12 * (np.abs(C).T @ abs(constraint_force))
        )


@pytest.mark.parametrize("formulation", FORMULATIONS[1:], ids=paper.name)
def test_residual_vanishes_on_the_motion_and_only_there(robot, states, formulation):
    q, dq, ddq, tau_other = states
    tau, _ = robot.inverse(Multiplier(), q, dq, ddq)
    residual = formulation.residual(robot.mechanism)
    scale = np.abs(np.array(robot.call(residual, q, dq, ddq, tau_other))).max()
    assert np.abs(np.array(robot.call(residual, q, dq, ddq, np.array(tau).T))).max() < 1e-12 * scale


def test_multiplier_residual(robot, states):
    q, dq, ddq, _ = states
    tau, lam = (np.array(x).T for x in robot.inverse(Explicit(), q, dq, ddq))
    residual = Multiplier().residual(robot.mechanism)
    zero = np.array(robot.call(residual, q, dq, ddq, tau, lam))
    scale = np.abs(np.array(robot.call(residual, q, dq, ddq, tau, 0 * lam))).max()
    assert np.abs(zero).max() < 1e-12 * scale


@pytest.mark.parametrize("kind", [VirtualWork, Kane, lambda: Kane(speeds=bar_speeds)])
def test_identities(kind):
    """Eq. (84)-(87): M̃ = Cᵀ M, Q̃* = Cᵀ Q̂*, Q̃ = Cᵀ Q, with everything printed on the right."""
    for name in ("delta_paper", "delta_general_inertia"):
        p = paper.reference(name).p
        m = delta(p)
        residual = kind().residual(m)  # -M̃ q̈ + Q̃* + Q̃
        M_tilde = ca.Function("M", [m.q, m.parameters], [_inertia(residual, m)])
        rng = np.random.default_rng(3)
        for _ in range(20):
            x = rng.uniform([0.38, -0.12, -0.12], [0.6, 0.12, 0.12])
            q, dq, tau = paper.inverse_kinematics(p, x), rng.normal(size=12), rng.normal(size=3)
            C, zero = paper.constraint_matrix(p, q), np.zeros(12)
            at_rest = np.array(residual(0, q, zero, zero, tau, paper.values(p))).ravel()
            moving = np.array(residual(0, q, dq, zero, tau, paper.values(p))).ravel()
            same(M_tilde(q, paper.values(p)), C.T @ paper.inertia_matrix(p, q))
            same(moving - at_rest, C.T @ paper.gyroscopic_force(p, q, dq))
            same(at_rest, C.T @ paper.active_force(p, q, tau))


def _inertia(residual, m):
    """M̃ of eq. (84)."""
    ddq = ca.SX.sym("ddq", 12)
    equations = residual(0, m.q, ca.SX.zeros(12), ddq, ca.SX.zeros(3), m.parameters)
    return -ca.jacobian(equations, ddq)


def same(actual, expected):
    np.testing.assert_allclose(
        np.array(actual).squeeze(), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )
