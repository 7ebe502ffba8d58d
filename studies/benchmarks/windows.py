"""What a right-hand side costs for N four-bars, counted: who grows with N, and who with N³.

Operations of one evaluation of q̈, counted: elementary operations of what is written out in scalars,
and of L_I's linear system those of CasADi's sparse QR (four for each entry that a reflection
touches), or 2/3 n³ + 2 n² of a dense LU.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.study import operations
from deltaopt.dynamics import Explicit, Multiplier, NullSpace, Partition
from deltaopt.dynamics.mechanism import Mechanism
from studies.benchmarks.four_bars import n_four_bar, n_four_bar_start
from studies.text_table import csv, paragraph, table

Progress = Callable[[float, str], None]
WINDOWS = (1, 2, 4, 8, 16)
METHODS = ("L_I, sparse QR", "L_I, dense LU", "L_E, partition", "L_E, null space")


@dataclass(frozen=True)
class Cost:
    """Operations of one evaluation of q̈ of a mechanism with so many windows."""

    windows: int
    method: str
    operations: int


def measure(progress: Progress, windows: tuple[int, ...] = WINDOWS) -> list[Cost]:
    """Count for every number of windows and every method."""
    found = []
    for i, n in enumerate(windows):
        progress(i / len(windows), f"{n} windows")
        found += [Cost(n, method, count) for method, count in _counts(n).items()]
    progress(1.0, "done")
    return found


def _counts(windows: int) -> dict[str, int]:
    m, (q0, _) = n_four_bar(windows), n_four_bar_start(windows)
    dense = operations(Multiplier().forward_dynamics(m))
    sparsity = _big_matrix(m)
    n = sparsity.size1()
    sparse = dense - round(2 / 3 * n**3 + 2 * n**2) + _sparse_qr(sparsity)
    J = ca.Function("J", [m.q], [ca.densify(m.J)])(q0).full()
    return {
        "L_I, sparse QR": sparse,
        "L_I, dense LU": dense,
        "L_E, partition": _written_out(m, Partition.pivoted(J)),
        "L_E, null space": _written_out(m, NullSpace()),
    }


def _big_matrix(m: Mechanism) -> ca.Sparsity:
    gamma = m.J.shape[0]
    matrix = ca.blockcat([[m.M, m.J.T], [m.J, ca.SX(gamma, gamma)]])
    return ca.sparsify(matrix).sparsity()


def _sparse_qr(sparsity: ca.Sparsity) -> int:
    """Operations of a factorization, Qᵀ b and a back-substitution, from the factors' patterns."""
    V, R, _, _ = sparsity.qr_sparse()
    reflected = np.diff(V.colind())  # entries of each Householder vector
    touched = np.bincount(R.row(), minlength=len(reflected))[: len(reflected)]
    return int(4 * (reflected * (touched + 1)).sum() + 2 * R.nnz())


def _written_out(m: Mechanism, C: Partition | NullSpace) -> int:
    return operations(Explicit(C).forward_dynamics(m))


def power(costs: list[Cost], method: str) -> float:
    """Return the exponent of N by which cost grows between the two largest N."""
    (n1, c1), (n2, c2) = [(c.windows, c.operations) for c in costs if c.method == method][-2:]
    return float(np.log(c2 / c1) / np.log(n2 / n1))


def table_of(costs: list[Cost]) -> str:
    """Return operations, a line for each N."""
    rows: list[tuple[str, ...]] = [("N", *METHODS)]
    for n in dict.fromkeys(c.windows for c in costs):
        own = {c.method: c.operations for c in costs if c.windows == n}
        rows.append((str(n), *(f"{own[method]:,}" for method in METHODS)))
    return table(rows)


def verdict(costs: list[Cost]) -> str:
    """Say how each grows."""
    largest = max(c.windows for c in costs)
    told = ", ".join(f"{method} as N^{power(costs, method):.1f}" for method in METHODS)
    least = min((c for c in costs if c.windows == largest), key=lambda c: c.operations)
    return paragraph(
        f"At the largest N the cost of a right-hand side grows: {told}. With {largest} windows"
        f" {least.method} costs least, {least.operations:,} operations."
    )


def csv_of(costs: list[Cost]) -> str:
    """Return one line a count."""
    return csv("windows,method,operations", ((c.windows, c.method, c.operations) for c in costs))
