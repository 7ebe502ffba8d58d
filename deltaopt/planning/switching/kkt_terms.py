"""What rows, barrier and Lagrangian of a switching structure are at a point: the terms of Newton's
equations."""

from __future__ import annotations

from dataclasses import dataclass

from deltaopt.curves.piecewise import Array


@dataclass(frozen=True)
class Derivatives:
    """All rows at the nodes, (n, nodes, rows), their Jacobian by y, (…, rows, 3 m), and the Hessian
    of their sum times ``weights``, (…, 3 m, 3 m)."""

    r: Array
    J: Array
    H: Array
    weights: Array


@dataclass(frozen=True)
class BarrierTerms:
    """What the barrier adds at the nodes, (n, nodes, m + bounded) each: ``off``, bounded value less
    slack; ``mu``, slack times multiplier to be reached; ``stiffness``, the condensed second
    derivative; ``force``, upper less lower multipliers; ``aim``, by how much a full step changes
    ``force`` before the slacks move."""

    off: Array
    mu: Array
    stiffness: Array
    force: Array
    aim: Array


@dataclass(frozen=True)
class Primal:
    """Violations of the primal conditions: of the ``values`` of active rows, (n, nodes, m), of
    ``continuity`` at the ends of the intervals, (n, 2 m), and of ``entries``, (entries,). The
    slopes are derivatives of active rows by y and of entry conditions by (X, V)."""

    values: Array
    continuity: Array
    entries: Array
    value_slopes: Array
    entry_slopes: list[Array]


@dataclass(frozen=True)
class Dual:
    """Derivatives of the Lagrangian: ``by_y`` at the nodes, (n, nodes, 3 m); ``own``, by (X_i, V_i,
    h, A), (n, 2 m + 1 + m nodes); ``singular``, by coefficients of singular controls, (n, m, most
    modes). The aims are these with what a full step adds for the barrier: what it is to remove."""

    by_y: Array
    own: Array
    own_aim: Array
    singular: Array
    singular_aim: Array
