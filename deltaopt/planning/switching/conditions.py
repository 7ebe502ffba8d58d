"""The conditions of optimality for one switching structure: the data of a square system.

Once it is known which limit is active when, no inequality is left. On interval i, the q-th part of
an arc of length L_a, h = L_a / q, the motion is a polynomial through accelerations A at nodes c:

    X_c = X_i + h c V_i + h² Σ_j l̿_j(c) A_j          V_c = V_i + h Σ_j l̄_j(c) A_j

and the following Lagrangian is stationary:

    Σ_a L_a + Σ_i p_{i+1} · ((X, V)_1 - (X, V)_{i+1}) + Σ_c λ_c · (r_c - u_c) + Σ ν (e - ē)

r: the active rows, one for each motor at every node, and u their values: a limit, or a polynomial
Σ w φ over the arc where a control is singular. e: entry conditions, which hold where an arc begins.
p: the costates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, Truths
from deltaopt.planning.flat.constraint_rows import ConstraintRows, StateRows
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.switching.arc_mesh import DENSE, ArcMesh
from deltaopt.planning.switching.structure import INACTIVE, ActiveLimits, Arc, SwitchingStructure
from deltaopt.planning.switching.unknowns import KKTIndex, PrimalDualPoint

_LEAST_LENGTH = 1e-9
"""Shortest interval, in units of the scaling's time, that is a part of the resulting motion."""


class EntryCondition(NamedTuple):
    """A row that must have a value at the beginning of an arc."""

    arc: int
    motor: int
    rows: StateRows
    derivative: int
    value: float

    @property
    def row(self) -> int:
        """The index of the row: of the limited quantity or of a derivative of it."""
        return int(self.rows.derivatives[self.derivative][self.motor])


class EndValue(NamedTuple):
    """A given value of a singular control where its arc begins (``end`` 0) or ends (1)."""

    arc: int
    motor: int
    end: int
    value: float

    def legendre(self, modes: int) -> Array:
        """Legendre polynomials at that end, (modes,)."""
        return np.asarray(np.ones(modes) if self.end else (-1.0) ** np.arange(modes), np.float64)


def state_rows(rows: ConstraintRows, arc: Arc) -> list[tuple[int, int]]:
    """The active state limits of an arc, each (motor, row that is zero while it is active)."""
    return [
        (k, int(state.holding[k]))
        for state in rows.states
        for k, limits in enumerate(arc)
        if limits.states[state.order]
    ]


class ActiveRows:
    """The rows that are active on each arc: one for each motor at every node, and entry conditions.

    ``row``: indices of the rows, and ``value``: their values, (arcs, m). ``follows``: controls that
    are not prescribed because a state limit is active in their place, (arcs, m). ``singular``:
    (arc, motor) where the row is a singular control, whose value is an unknown polynomial.
    """

    def __init__(self, rows: ConstraintRows, structure: SwitchingStructure) -> None:
        """The active rows of a structure. A state limit is held in place of a control that is at no
        limit: the motor's own, or another's if its own is at a limit."""
        self.row = np.empty((len(structure.limits), rows.motors), np.intp)
        singular = list[tuple[int, int]]()
        for a, arc in enumerate(structure.limits):
            self.row[a] = rows.control
            left = [k for k, limits in enumerate(arc) if not limits.control]
            own_first = sorted(state_rows(rows, arc), key=lambda state: state[0] not in left)
            for k, state in own_first:
                self.row[a, left.pop(left.index(k) if k in left else 0)] = state
            singular += [(a, k) for k in left]
        self.value, self.singular = structure.control.astype(np.float64), tuple(singular)
        self.follows = np.asarray(self.row != rows.control)
        self.entries = tuple(_entries(rows, structure))

    def is_singular(self) -> Truths:
        """Where a control is singular, (arcs, m)."""
        found = np.zeros(self.row.shape, bool)
        for a, k in self.singular:
            found[a, k] = True
        return found


def _entries(rows: ConstraintRows, structure: SwitchingStructure) -> list[EntryCondition]:
    """Entry conditions of all arcs. Where a limit becomes active its quantity is at the limit and
    all derivatives are zero; at a contact point only the quantity is given."""
    found = []
    for a, arc in enumerate(structure.limits):
        for k, now in enumerate(arc):
            before = structure.limits[a - 1][k] if a else INACTIVE
            for state in rows.states:
                found += _motor_entries(a, k, state, now, before)
    return found


def _motor_entries(
    a: int, k: int, state: StateRows, now: ActiveLimits, before: ActiveLimits
) -> list[EntryCondition]:
    found = []
    contact, sign = now.contacts[state.order], now.states[state.order]
    if contact and before != now:
        found.append(EntryCondition(a, k, state, 0, float(contact)))
    if sign and before.states[state.order] != sign:
        found.append(EntryCondition(a, k, state, 0, float(sign)))
        zero = range(1, len(state.derivatives) - 1)
        found += [EntryCondition(a, k, state, derivative, 0.0) for derivative in zero]
    return found


@dataclass(frozen=True)
class OptimalityConditions:
    """The conditions for one structure and scene, and what they are evaluated with.

    ``goal``: (X, V) at the goal, scaled, (2 m,). ``p``: the parameters of the rows. ``end_values``:
    given values of singular controls. ``barrier``: slack times multiplier, per time, to which an
    interior-point barrier falls that keeps rows which are not active within their limits: at most
    what it costs per limit, as a fraction of the duration; a lower one costs steps. 0 without a
    barrier: a step is cheaper, and rows that exceed their limits are only noticed afterwards.
    """

    rows: ConstraintRows
    structure: SwitchingStructure
    mesh: ArcMesh
    goal: Array
    p: Array
    end_values: tuple[EndValue, ...] = ()
    barrier: float = 0.0

    @cached_property
    def active(self) -> ActiveRows:
        """The rows that are active on each arc."""
        return ActiveRows(self.rows, self.structure)

    @cached_property
    def index(self) -> KKTIndex:
        """Places of the unknowns in the KKT system."""
        active = self.active
        return KKTIndex(
            self.mesh,
            self.rows.motors,
            active.singular,
            len(active.entries),
            len(self.end_values),
        )

    @cached_property
    def bounded(self) -> Index:
        """Indices of the rows that a barrier may bound: controls and velocities. Positions are left
        to the active-set update."""
        velocity = self.rows.state(1)
        of_state = [] if velocity is None else [velocity.value]
        return np.concatenate([self.rows.control, *of_state])

    @cached_property
    def within(self) -> Truths:
        """What the barrier bounds at the nodes, (n, nodes, m + bounded): singular controls, then
        controls that follow from active state limits, then velocities that are not active, but for
        the start, the goal and nodes next to an arc where they are."""
        mesh, m = self.mesh, self.rows.motors
        within = np.zeros(
            (mesh.intervals, len(mesh.polynomials.nodes), m + len(self.bounded)), bool
        )
        if not self.barrier:
            return within
        within[..., :m] = self.active.is_singular()[mesh.arc][:, None]
        within[..., m : 2 * m] = self.active.follows[mesh.arc][:, None]
        if self.rows.state(1) is not None:
            active = self.structure.state(1)[mesh.arc] != 0
            within[..., 2 * m :] = ~active[:, None]
            within[0, 0, 2 * m :] = within[-1, -1, 2 * m :] = False
            within[1:, 0, 2 * m :] &= ~active[:-1]
            within[:-1, -1, 2 * m :] &= ~active[1:]
        return within

    def between(self, point: PrimalDualPoint) -> Array:
        """y = (X, V, A) at ``DENSE`` fractions of the intervals, (n, dense, 3 m)."""
        return point.at(self.mesh, DENSE, self.mesh.polynomials.at_dense)

    def multipliers(self, point: PrimalDualPoint) -> Array:
        """Multipliers of the active rows at the nodes, duration per value and time, (n, nodes, m):
        the shadow prices, by how much raising a limit for a short time shortens the motion."""
        weight = point.interval_lengths(self.mesh)[:, None] * self.mesh.polynomials.quadrature
        return np.asarray(point.multipliers / weight[..., None])

    def multipliers_between(self, point: PrimalDualPoint) -> Array:
        """``multipliers`` at ``DENSE``, (n, dense, m)."""
        return np.asarray(self.mesh.polynomials.at_dense[2] @ self.multipliers(point))

    def polynomial(self, point: PrimalDualPoint, scaling: Scaling) -> PiecewisePolynomial:
        """The motion in m and s, without arcs of no or negative length."""
        h, m = point.interval_lengths(self.mesh), self.rows.motors
        kept = h > _LEAST_LENGTH
        h, A = h[kept], point.A[kept]
        X, V = point.knots[:-1][kept, :m], point.knots[:-1][kept, m:]
        coefficients = self.mesh.polynomials.coefficients(X, V, A, h)
        return scaling.polynomial(h, coefficients, scaling.time)
