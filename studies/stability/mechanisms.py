"""Two mechanisms of the IFToMM library of computational benchmarks that defeat solvers.

In natural coordinates: points and, where axes are not parallel, unit vectors along them. A
thin rod of mass m moves as m/6 at each end and 2 m/3 at its middle, so that the inertia
matrix is constant and no angle is needed.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.mechanism import SX, Body, Mechanism

GRAVITY = (0.0, -9.81, 0.0)
"""m/s², in both benchmarks."""


def n_four_bar(windows: int = 2) -> Mechanism:
    """Return A02: ``windows`` squares side by side, cranks on the ground, unit links of 1 kg.

    Coordinates: x and y of the joints B₀ … B_N on top of the cranks, m. One degree of
    freedom, but N + 1 whenever all links lie in one line.
    """
    n = windows + 1
    q, dq = SX.sym("q", 2 * n), SX.sym("dq", 2 * n)
    tops = [ca.vertcat(q[2 * i : 2 * i + 2], 0) for i in range(n)]
    cranks = [(SX([i, 0, 0]), top) for i, top in enumerate(tops)]
    rods = [*cranks, *pairwise(tops)]
    return Mechanism(
        name=f"{windows}-four-bar",
        q=q,
        dq=dq,
        bodies=_particles(rods),
        holonomic=ca.vertcat(*(_unit(end - start) for start, end in rods)),
        gravity=SX(GRAVITY),
    )


def n_four_bar_start(windows: int = 2) -> tuple[Array, Array]:
    """Return q, q̇: cranks upright, 1 m/s to the right."""
    q = np.ravel([(i, 1.0) for i in range(windows + 1)])
    return q, np.tile([1.0, 0.0], windows + 1)


def bricard() -> Mechanism:
    """Return A04: five unit rods of 1 kg and the ground in a ring of six revolute joints.

    At each joint the axis is across both rods, and the two axes of a rod are across each
    other. Coordinates: points P₁ … P₄ (m) and unit vectors u₁ … u₄ along the axes there; the
    ends P₀ = (0, 0, 0) with u₀ = y and P₅ = (0, 0, 1) with u₅ = x belong to the ground. One of
    the 24 constraints always follows from the others.
    """
    q, dq = SX.sym("q", 24), SX.sym("dq", 24)
    inner = [q[3 * i : 3 * i + 3] for i in range(8)]
    points = [SX([0, 0, 0]), *inner[:4], SX([0, 0, 1])]
    axes = [SX([0, 1, 0]), *inner[4:], SX([1, 0, 0])]
    closures = [_unit(axis) for axis in axes[1:5]]
    for (start, end), (u, w) in zip(pairwise(points), pairwise(axes), strict=True):
        rod = end - start
        closures += [_unit(rod), ca.dot(rod, u), ca.dot(rod, w), ca.dot(u, w)]
    return Mechanism(
        name="Bricard mechanism",
        q=q,
        dq=dq,
        bodies=_particles(list(pairwise(points))),
        holonomic=ca.vertcat(*closures),
        gravity=SX(GRAVITY),
    )


def bricard_start() -> tuple[Array, Array]:
    """Return q, q̇: along the edges of a cube, at rest."""
    points = [(1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1)]
    axes = [(0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    return np.ravel([*points, *axes]).astype(float), np.zeros(24)


def _unit(vector: SX) -> SX:
    """Zero if the vector has length 1."""
    return (ca.sumsqr(vector) - 1) / 2


def _particles(rods: list[tuple[SX, SX]]) -> tuple[Body, ...]:
    """Thin rods of 1 kg between two points each."""
    return tuple(
        Body(f"rod {i}", mass, place)
        for i, (start, end) in enumerate(rods)
        for mass, place in ((1 / 6, start), (2 / 3, (start + end) / 2), (1 / 6, end))
    )
