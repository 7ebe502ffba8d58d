"""Bricard's mechanism: a ring of six revolute joints that Grübler's formula says is rigid.

A04 of the IFToMM library of computational benchmark problems.

Natural coordinates: points and, where axes are not parallel, unit vectors along them.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.mechanism import SX, Body, Mechanism


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
    closures = [unit_length(axis) for axis in axes[1:5]]
    for (start, end), (u, w) in zip(pairwise(points), pairwise(axes), strict=True):
        rod = end - start
        closures += [unit_length(rod), ca.dot(rod, u), ca.dot(rod, w), ca.dot(u, w)]
    return Mechanism(
        name="Bricard mechanism",
        q=q,
        dq=dq,
        bodies=thin_rods(list(pairwise(points))),
        holonomic=ca.vertcat(*closures),
        gravity=SX([0, -9.81, 0]),
    )


def bricard_start() -> tuple[Array, Array]:
    """Return q, q̇: along the edges of a cube, at rest."""
    points = [(1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1)]
    axes = [(0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    return np.ravel([*points, *axes]).astype(float), np.zeros(24)


def unit_length(vector: SX) -> SX:
    """Return what is zero if the vector has length 1."""
    return (ca.sumsqr(vector) - 1) / 2


def thin_rods(rods: list[tuple[SX, SX]]) -> tuple[Body, ...]:
    """Return rods of 1 kg between two points each: m/6 at each end and 2 m/3 at the middle."""
    return tuple(
        Body(f"rod {i}", mass, place)
        for i, (start, end) in enumerate(rods)
        for mass, place in ((1 / 6, start), (2 / 3, (start + end) / 2), (1 / 6, end))
    )
