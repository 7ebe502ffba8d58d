"""Table I in numbers: what has to be derived, and what an evaluation takes.

Derivation is counted as the scalar expressions that somebody has to find before the equations can
be written down, in the order of the paper's sections: entries that are not structurally zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from deltaopt.compare.dynamics.models import Model, models
from deltaopt.compare.dynamics.samples import NEAR_HOME, PAPER
from deltaopt.compare.dynamics.study import operations
from deltaopt.compare.dynamics.tasks import TASKS
from deltaopt.dynamics.constraint_matrix import Partition
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.mechanisms.delta.mechanism import delta
from studies.text_table import paragraph, table

MODELS = ("K", "L_E", "L_I")
STARS = {"K": (2, 5), "L_E": (4, 5), "L_I": (5, 3)}
"""The paper's, for derivation and for numerical computations."""


@dataclass(frozen=True)
class Effort:
    """Of one model: scalar expressions to derive, their operations when derived by CasADi, and
    operations of inverse and forward dynamics with C of eq. (55) or the best solver of L_I."""

    model: str
    expressions: int
    size: int
    inverse: int
    forward: int


def measure() -> list[Effort]:
    """Count for the paper's Delta."""
    m = delta(PAPER)
    J = ca.Function("J", [m.time, m.q, m.parameters], [m.J])
    at = J(0.0, NEAR_HOME, PAPER.values())
    partition = Partition.pivoted(ca.densify(at).full())
    every = models(partition, PAPER)
    found = []
    for name in MODELS:
        pieces = expressions(m, name)
        size = operations(ca.Function("all", [*_inputs(m)], [ca.vertcat(*map(ca.vec, pieces))]))
        count = sum(piece.nnz() for piece in pieces)
        found.append(Effort(name, count, size, *_evaluations(m, every, name)))
    return found


def expressions(m: Mechanism, model: str) -> list[SX]:
    """Return what has to be derived for a model: for K velocities, accelerations, partial
    velocities and the like of every body; for L_E and L_I the energies' M, Q̂* and Q."""
    if model != "K":
        common = [m.T, m.V, m.M, m.Q_gyr, m.Q, m.J, m.J_bias]
        assert m.closed_form is not None
        return [*common, m.closed_form[0]] if model == "L_E" else common
    pieces = [m.J, m.J_bias]
    for body in m.bodies:
        v = m.velocity(body)
        pieces += [v, m.rate_of_change(v), ca.jacobian(v, m.dq)]
        if body.angular_velocity.numel():
            omega = body.angular_velocity
            pieces += [omega, m.rate_of_change(omega), ca.jacobian(omega, m.dq)]
    assert m.closed_form is not None
    return [ca.sparsify(piece) for piece in [*pieces, m.closed_form[0]]]


def _inputs(m: Mechanism) -> tuple[SX, ...]:
    return m.time, m.q, m.dq, m.ddq, m.controls, m.parameters


def _evaluations(m: Mechanism, every: list[Model], name: str) -> tuple[int, int]:
    wanted = {
        "K": ("K, virtual work", ("closed form",)),
        "L_E": ("L_E", ("closed form",)),
        "L_I": ("L_I", ("written out", "sparse QR", "LAPACK LU")),
    }[name]
    counts = []
    for task in TASKS:
        own = [x for x in every if x.name == wanted[0] and x.variant in wanted[1]]
        counts.append(min(operations(x.build(m, task)) for x in own))
    inverse, forward = counts
    return inverse, forward


def report(found: list[Effort]) -> str:
    """Return the table and what it says of the stars."""
    rows = [
        (
            "model",
            "stars: derivation, computing",
            "expressions to derive",
            "operations in them",
            "inverse dynamics",
            "forward dynamics",
        )
    ]
    rows += [
        (
            e.model,
            f"{STARS[e.model][0]}, {STARS[e.model][1]}",
            str(e.expressions),
            f"{e.size:,}",
            f"{e.inverse:,}",
            f"{e.forward:,}",
        )
        for e in found
    ]
    k, explicit, multiplier = found
    return f"{table(rows)}\n\n" + paragraph(
        f"Derivation: K asks for {k.expressions / multiplier.expressions:.1f} times as many"
        f" expressions as L_I, L_E for {explicit.expressions / multiplier.expressions:.2f} times:"
        " the order of the stars"
        f" {'holds' if k.expressions > explicit.expressions > multiplier.expressions else 'fails'}."
        f" Computing: the fewest operations are {min(found, key=lambda e: e.inverse).model}'s for"
        f" torques and {min(found, key=lambda e: e.forward).model}'s for accelerations; L_I takes"
        f" {multiplier.inverse / explicit.inverse:.2f} and"
        f" {multiplier.forward / explicit.forward:.2f} times L_E's."
    )
