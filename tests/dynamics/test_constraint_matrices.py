"""Constraint matrices: J C = 0 and J P = 1 where each is meant to work, refusals elsewhere."""

import casadi as ca
import numpy as np
import pytest

from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition
from deltaopt.dynamics.linear import reflect, solve_scalars
from deltaopt.mechanisms.delta.mechanism import delta
from tests import paper_delta as paper
from tests.spherical_pendulum import spherical_pendulum

MATRICES = [ClosedForm(), Partition((0, 1, 2)), Partition((3, 6, 9)), NullSpace()]


@pytest.fixture(scope="module")
def reference():
    return paper.reference("delta_paper")


@pytest.fixture(scope="module")
def mechanism(reference):
    return delta(reference.p)


def numbers(matrix, mechanism, p, *states):
    """(C, P) at each state."""
    f = matrix.function(mechanism)
    return [[np.array(x) for x in f(0, q, paper.values(p))] for q in states]


@pytest.mark.parametrize("matrix", MATRICES, ids=repr)
def test_solves_the_constraints(reference, mechanism, matrix):
    solved = numbers(matrix, mechanism, reference.p, *reference.q)
    for q, (C, P) in zip(reference.q, solved, strict=True):
        J = paper.jacobian(reference.p, q)
        assert C.shape == (12, 3)
        assert P.shape == (12, 9)
        assert np.abs(J @ C).max() <= 1e-14 * np.abs(C).max()
        assert np.abs(J @ P - np.eye(9)).max() <= 1e-14 * np.abs(P).max()


def test_partition_of_the_platform_is_the_closed_form(reference, mechanism):
    q = reference.q[0]
    [(C, _)] = numbers(Partition((0, 1, 2)), mechanism, reference.p, q)
    np.testing.assert_allclose(C, paper.constraint_matrix(reference.p, q), rtol=1e-12, atol=1e-13)


def test_partition_moves_its_coordinates_one_by_one(reference, mechanism):
    [(C, _)] = numbers(Partition((9, 3, 6)), mechanism, reference.p, reference.q[0])
    np.testing.assert_array_equal(C[[9, 3, 6]], np.eye(3))


def test_null_space_is_orthonormal_and_its_inverse_the_smallest(reference, mechanism):
    solved = numbers(NullSpace(), mechanism, reference.p, *reference.q)
    for q, (C, P) in zip(reference.q, solved, strict=True):
        np.testing.assert_allclose(C.T @ C, np.eye(3), atol=1e-14)
        pseudo = np.linalg.pinv(paper.jacobian(reference.p, q))
        np.testing.assert_allclose(P, pseudo, atol=1e-13 * np.abs(pseudo).max())


def test_where_the_closed_form_fails_others_do_not(reference, mechanism):
    """The stretched Delta: det J⁽ᵏ⁾ = 0, yet J has full rank and the platform hangs still."""
    p = reference.p
    stretched = np.sqrt((2 * p.a2 + 2 * p.a3) ** 2 - (p.a1 - p.a4) ** 2)
    q1 = -np.arccos(-(p.a1 - p.a4) / (2 * p.a2 + 2 * p.a3))
    q = np.array([stretched, 0, 0, *(3 * [q1, q1, 0])])
    J = paper.jacobian(p, q)
    assert np.abs(paper.constraints(p, q)).max() < 1e-15
    assert abs(np.linalg.det(paper.jacobian_block(p, q, 0))) < 1e-15
    for matrix in (NullSpace(), Partition.pivoted(J)):
        [(C, P)] = numbers(matrix, mechanism, p, q)
        assert np.abs(J @ C).max() <= 1e-13
        assert np.abs(J @ P - np.eye(9)).max() <= 1e-13


def test_pivoted_partition_is_well_conditioned(reference):
    for q in reference.q:
        J = paper.jacobian(reference.p, q)
        chosen = Partition.pivoted(J)
        dependent = [i for i in range(12) if i not in chosen.independent]
        assert np.linalg.cond(J[:, dependent]) < 20 * np.linalg.cond(J)


@pytest.mark.parametrize("independent", [(0, 1), (0, 1, 1), (0, 1, 12), (0, 1, 2, 3)])
def test_partition_needs_as_many_coordinates_as_freedoms(mechanism, independent):
    with pytest.raises(ValueError, match="delta needs 3 different independent coordinates"):
        Partition(independent).function(mechanism)


def test_closed_form_must_be_there():
    pendulum = spherical_pendulum(1.0, 1.0, 9.81, lambda t: 0 * t)
    assert ClosedForm().function(pendulum).size_out(0) == (5, 2)
    without = type(pendulum)(**{**vars(pendulum), "closed_form": None})
    with pytest.raises(ValueError, match="spherical pendulum has no constraint matrix"):
        ClosedForm().function(without)


@pytest.mark.parametrize("sign", [1, -1, 0])
def test_scalar_qr_solves_whatever_the_sign_of_its_pivots(sign):
    rng = np.random.default_rng(5)
    numeric, b = rng.normal(size=(6, 6)), rng.normal(size=(6, 2))
    numeric[0, 0] = sign * abs(numeric[0, 0])
    A = ca.SX.sym("A", 6, 6)
    X = ca.Function("X", [A], [solve_scalars(A, b)])(numeric)
    R = ca.Function("R", [A], [reflect(A, ca.SX(6, 0))[0]])(numeric)
    np.testing.assert_allclose(numeric @ X, b, atol=1e-13)
    np.testing.assert_allclose(R.T @ R, numeric.T @ numeric, atol=1e-13)
    assert R.sparsity().is_triu()
