"""Pontryagin's condition on a switch-resolved motion, from the multipliers of its program.

The Lagrangian's derivative with respect to the state at a knot is the costate there: what a
small shift of position (p_x) or velocity (p_v) would cost. Along an optimal motion

    H = p_x · ẋ + p_v · ẍ + r           the Hamiltonian, constant; r: rate of a running cost
    τ_k at its upper (lower) limit      only where raising the limit does not cost (gain)

and H = -1 where time is what is minimised. A motion that meets both satisfies the necessary
condition of optimality: no motion near it is better. A quite different one may be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.motion.certificate import Certificate
from deltaopt.planning.nlp.program import IpoptSolution
from tests.oracles.arcs import ArcProblem

Array = NDArray[np.float64]


def certify(problem: ArcProblem, solution: IpoptSolution, p: Array) -> Certificate:
    """Of the solution of a program with parameters p."""
    H = hamiltonian(problem, solution, p)
    multipliers = problem.control_multipliers(solution)
    held = problem.structure.control[problem.arc][:, None]
    wrong = np.maximum(-multipliers * held, 0).max()
    largest_rate = float(np.abs(running_rate(problem, solution, p)[0]).max())
    uneven = np.abs(H - H.mean()).max() / max(abs(H.mean()), largest_rate)
    return Certificate(float(uneven), float(wrong / np.abs(multipliers).max()))


def hamiltonian(problem: ArcProblem, solution: IpoptSolution, p: Array) -> Array:
    """H at the beginning and at the end of every interval that has a length, (n, 2)."""
    kept = problem.interval_lengths(solution.z) > 1e-9
    first, last = _costates(problem, solution, p)
    velocity, acceleration = problem.velocities(solution.z), problem.accelerations(solution.z)
    rate, _ = running_rate(problem, solution, p)
    ends = [
        (np.hstack([velocity[:, i], acceleration[:, i]]) * costate).sum(axis=1) + rate[:, i]
        for i, costate in ((0, first), (-1, last))
    ]
    return np.stack(ends, axis=1)[kept]


def _costates(problem: ArcProblem, solution: IpoptSolution, p: Array) -> tuple[Array, Array]:
    """(p_x, p_v), (n, 6), at the beginnings and the ends of the intervals."""
    n, d = problem.intervals, problem.degree
    at_nodes, position, velocity = problem.row_multipliers(solution)
    shape = (n, d + 1, 6)
    limits = _pull_back(problem, solution.z, at_nodes, p).reshape(shape)
    weights = problem.interval_lengths(solution.z)[:, None] * problem.transcription.quadrature
    limits += weights[..., None] * running_rate(problem, solution, p)[1]
    step = problem.interval_lengths(solution.z)[:, None] * problem.transcription.nodes[1:]
    first_x = -position.sum(axis=1)
    first_v = -velocity.sum(axis=1) - (step[..., None] * position).sum(axis=1)
    first = np.hstack([first_x, first_v]) + limits[:, 0]
    last = -np.hstack([position[:, -1], velocity[:, -1]]) - limits[:, -1]
    return first, last


def _pull_back(problem: ArcProblem, z: Array, multipliers: Array, p: Array) -> Array:
    """Multipliers of the rows at the nodes times the rows' derivatives by X and V, (N, 6).

    Rows of the state alone are left out: at a knot they make the costate
    jump, and each side of the jump has its own.
    """
    orders = problem.equations.constraints.orders
    of_state_alone = slice(3, 3 + int((orders < 2).sum()))
    multipliers = multipliers.copy()
    multipliers[:, of_state_alone] = 0.0
    jacobian, sparsity = problem.rows.jacobian
    _, nonzeros = evaluate_rows(jacobian, problem.at_nodes(z), parameters=p)
    rows, columns = (np.array(i) for i in sparsity.get_triplet())
    products = nonzeros * multipliers[:, rows]
    return np.stack([products[:, columns == j].sum(axis=1) for j in range(6)], axis=1)


def running_rate(problem: ArcProblem, solution: IpoptSolution, p: Array) -> tuple[Array, Array]:
    """r at the nodes, (n, degree + 1), and its derivatives by X and V, (n, degree + 1, 6)."""
    shape = problem.intervals, problem.degree + 1
    if problem.running is None:
        return np.zeros(shape), np.zeros((*shape, 6))
    jacobian, sparsity = problem.running.points.function.jacobian
    y = np.insert(problem.at_nodes(solution.z), 13, 1.0, axis=1)
    rate, nonzeros = (problem.cost.running * r for r in evaluate_rows(jacobian, y, parameters=p))
    dense = np.zeros((len(y), 14))
    dense[:, np.array(sparsity.get_triplet()[1])] = nonzeros.reshape(len(y), -1)
    return rate.reshape(shape), dense[:, :6].reshape(*shape, 6)
