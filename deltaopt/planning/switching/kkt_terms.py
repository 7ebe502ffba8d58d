"""What rows, barrier and Lagrangian of a switching structure are at a point: the terms of Newton's
equations."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.planning.switching.conditions import OptimalityConditions
from deltaopt.planning.switching.unknowns import PrimalDualPoint


class Derivatives:
    """What there is at the nodes: ``y``, (n, nodes, 3 m), which rows are ``active`` and which
    values ``singular`` controls have, (n, nodes, m) each; all rows ``r``, (…, rows), their Jacobian
    ``J`` by y, (…, rows, 3 m), that of the ``bounded`` ones, and the Hessian ``H`` of their sum
    times ``weights``, (…, 3 m, 3 m), the multipliers that they have in the Lagrangian."""

    def __init__(self, of: OptimalityConditions, at: PrimalDualPoint) -> None:
        self.of, self.at, mesh, m = of, at, of.mesh, of.rows.motors
        n, k, R = mesh.intervals, len(mesh.polynomials.nodes), of.rows.number
        self.y, self.singular = at.at_nodes(mesh), mesh.singular_controls(at.singular)
        self.active = np.broadcast_to(of.active.row[mesh.arc][:, None], (n, k, m))
        self.weights = np.zeros((n, k, R))
        np.put_along_axis(self.weights, self.active, at.multipliers, axis=2)
        for entry, nu in zip(of.active.entries, at.entry, strict=True):
            self.weights[mesh.first[entry.arc], 0, entry.row] += nu
        self.weights[..., of.bounded] += (at.upper - at.lower)[..., m:]
        y, weights = self.y.reshape(-1, 3 * m), self.weights.reshape(-1, R)
        r, J, H = of.rows.derivatives(y, weights, of.p)
        self.r, self.J = r.reshape(n, k, R), J.reshape(n, k, R, -1)
        self.H = H.reshape(n, k, 3 * m, 3 * m)
        self.bounded = self.J[:, :, of.bounded]


class BarrierTerms:
    """What the barrier adds at the nodes, (n, nodes, m + bounded) each: ``off``, bounded value less
    slack; ``mu``, slack times multiplier to be reached; ``stiffness``, the condensed second
    derivative; ``force``, upper less lower multipliers; ``aim``, by how much a full step changes
    ``force`` before the slacks move."""

    def __init__(self, rows: Derivatives, barrier: float) -> None:
        """``barrier``: slack times multiplier, per time."""
        of, at, within = rows.of, rows.at, rows.of.within
        bounded = np.concatenate([rows.singular, rows.r[..., of.bounded]], axis=2)
        self.off = np.where(within, np.where(within, bounded, 0.0) - at.slack, 0.0)
        above, below = (np.maximum(1 + s * at.slack, 1e-300) for s in (-1, 1))
        h = np.abs(at.interval_lengths(of.mesh))[:, None, None]
        self.mu = barrier * h * of.mesh.polynomials.quadrature[:, None] * within
        self.stiffness, self.force = at.upper / above + at.lower / below, at.upper - at.lower
        self.aim = self.stiffness * self.off + self.mu / above - self.mu / below - self.force


class Primal:
    """Violations of the primal conditions: of the ``values`` of active rows, (n, nodes, m), of
    ``continuity`` at the ends of the intervals, (n, 2 m), and of ``entries``, (entries,). The
    slopes are derivatives of active rows by y and of entry conditions by (X, V)."""

    def __init__(self, rows: Derivatives) -> None:
        of, states = rows.of, rows.of.index.states
        wanted = rows.singular + of.active.value[of.mesh.arc][:, None]
        entries = [(of.mesh.first[e.arc], 0, e.row) for e in of.active.entries]
        pairs = zip(entries, of.active.entries, strict=True)
        self.values = np.take_along_axis(rows.r, rows.active, axis=2) - wanted
        self.continuity = rows.y[:, -1, :states] - np.vstack([rows.at.knots[1:-1], of.goal])
        self.entries = np.array([rows.r[i] - e.value for i, e in pairs], dtype=float)
        self.value_slopes = np.take_along_axis(rows.J, rows.active[..., None], axis=2)
        self.entry_slopes = [rows.J[i][:states] for i in entries]


class Dual:
    """Derivatives of the Lagrangian: ``by_y`` at the nodes, (n, nodes, 3 m); ``own``, by (X_i, V_i,
    h, A), (n, 2 m + 1 + m nodes); ``singular``, by coefficients of singular controls, (n, m, most
    modes). The aims are these with what a full step adds for the barrier: what it is to remove."""

    def __init__(self, rows: Derivatives, barrier: BarrierTerms, slopes: Array) -> None:
        """``slopes``: of y at the nodes by (X_i, V_i, h, A)."""
        at, legendre, m = rows.at, rows.of.mesh.legendre, rows.of.rows.motors
        self.by_y = np.einsum("nkr,nkra->nka", rows.weights, rows.J)
        self.by_y[:, -1, : 2 * m] += at.costates
        n, width = len(slopes), self.by_y[0].size
        y_slopes = slopes.reshape(n, width, -1)
        aim = np.einsum("nkr,nkra->nka", barrier.aim[..., m:], rows.bounded)
        pull = barrier.force[..., :m] - at.multipliers
        self.own = (self.by_y.reshape(n, 1, -1) @ y_slopes)[:, 0]
        self.own_aim = self.own + (aim.reshape(n, 1, -1) @ y_slopes)[:, 0]
        self.singular = np.einsum("nkr,nkl->nrl", pull, legendre)
        added = np.einsum("nkr,nkl->nrl", barrier.aim[..., :m], legendre)
        self.singular_aim = self.singular + added
