"""Costates on a mesh, and Pontryagin's condition, from the multipliers of the limits at its points.

A motion of cubics is determined by the positions X and velocities V at its knots. The costate p at
a knot is the change of the duration when X and V shift there and the motion afterwards returns to
its course, as the multipliers λ of the limits c afterwards say; the limits before the knot give
the same with the opposite sign. With time in units of the duration T,

    p_i = Σ_j λ_j ∂c_j/∂(X, V)_i        H = p · (V, A) / T, which is -1 on an optimal motion

The shift returns to zero at the next knot, so that the limits of one interval alone tell p.

H is nearly constant on a mesh that is fine enough. Since controls jump inside intervals, it is not
as constant as with resolved switches.
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial, hermite_pieces
from deltaopt.motion.certificate import Certificate, spread
from deltaopt.planning.flat.constraint_rows import ConstraintRows
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.nlp.scaling import Scaling


def certify_mesh(rows: ConstraintRows, found: MeshSolution) -> Certificate:
    """Certify a mesh solution: how well its motion meets Pontryagin's condition.

    ``hamiltonian_spread``: max |H - mean H| at both ends of all intervals, over |mean H|.
    ``sign_violation``: by how much other controls would lower H, at most, over the largest
    multiplier of a control. The solution must have the multipliers of all limits
    (``has_all_multipliers``).
    """
    control = found.solution.multipliers[:, :, rows.control]
    density = control.sum(axis=1) / found.mesh[:, None]
    mean = found.rows[:, :, rows.control].mean(axis=1)
    lowered = np.abs(density) - density * mean
    largest = float(np.abs(density).max())
    violation = float(lowered.max()) / largest if largest else 0.0
    return Certificate(spread(hamiltonian_on_mesh(rows, found)), violation)


def hamiltonian_on_mesh(rows: ConstraintRows, found: MeshSolution) -> Array:
    """The Hamiltonian at the beginnings, then at the ends of the intervals, (2 N,): -1 all along an
    optimal motion."""
    motion, scaling = found.trajectory, found.scaling
    weights = _hermite(found.mesh, found.program.points)
    states = scaling.states(motion.position, motion.knots, motion.duration)
    states = states.reshape(len(states), 2, -1)
    knots = np.concatenate([states[:-1], states[1:]], axis=1)  # of both ends, (N, 4, m)
    y = np.einsum("danc,nak->ncdk", weights, knots)  # (N, points, 3, m), time in durations
    J = _jacobian(rows, y, motion.duration / scaling.time, scaling)
    pulled = np.einsum("ncr,ncrdk->ncdk", found.solution.multipliers, J)
    by_knots = np.einsum("ncdk,danc->nak", pulled, weights)  # X and V at the beginning, at the end
    p = np.concatenate([by_knots[:, :2], -by_knots[-1:, 2:]])  # the goal must not shift
    A = np.einsum("anc,nak->nck", weights[2][:, :, [0, -1]], knots)
    first = (p[:-1] * np.stack([knots[:, 1], A[:, 0]], axis=1)).sum(axis=(1, 2))
    last = (p[1:] * np.stack([knots[:, 3], A[:, 1]], axis=1)).sum(axis=(1, 2))
    return np.concatenate([first, last])


def _hermite(mesh: Array, points: Array) -> Array:
    """Weights of (X, V) at both knots of an interval in X, V and A inside, (3, 4, N, points)."""
    units = [np.tile(unit, (len(mesh), 1)) for unit in np.eye(4)]
    coefficients = hermite_pieces(mesh, units[:2], units[2:])
    curve = PiecewisePolynomial(np.append(0.0, np.cumsum(mesh)), coefficients)
    pieces, since = np.repeat(np.arange(len(mesh)), len(points)), np.outer(mesh, points).ravel()
    weights = np.array(curve.with_derivatives(pieces, since))
    return weights.reshape(3, len(mesh), len(points), 4).transpose(0, 3, 1, 2)


def _jacobian(rows: ConstraintRows, y: Array, T: float, scaling: Scaling) -> Array:
    """Derivatives of all limits' rows by X, V and A, (N, points, rows, 3, m)."""
    per_time = np.array([1.0, T, T**2])[:, None]
    points = (y / per_time).reshape(-1, 3 * rows.motors)
    J = rows.jacobian(points, scaling.parameters)
    own = rows.constraints.number
    shape = (*y.shape[:2], own, 3, rows.motors)
    return np.asarray(J[:, :own].reshape(shape) / per_time)
