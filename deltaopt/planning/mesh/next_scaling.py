"""The scaling of the next mesh: limits tightened where the motion on the last one exceeds them
between its points."""

from __future__ import annotations

from dataclasses import replace
from math import isinf

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.mesh.constraint_tightening import (
    bulge_shares,
    corner_shares,
    samples_at,
    tightened_where_exceeded,
)
from deltaopt.planning.mesh.error_estimate import FRACTIONS, longest_tightened
from deltaopt.planning.mesh.mesh_solution import MeshSolution, time_costing_rows
from deltaopt.planning.nlp.phases import FacePhases
from deltaopt.planning.nlp.scaling import UNTIGHTENED, Scaling

_NEARLY_LAST = 5e-3
"""Gap of a motion that cannot be slowed below which the next mesh may be the last. Limits that are
tightened on coarser meshes lead finer ones astray."""


def next_scaling(last: MeshSolution, mesh: Array, faces: FacePhases | None = None) -> Scaling:
    """The scaling with tightened limits for the next mesh, which divides that of the ``last``.

    ``faces``: phases of the next mesh.

    Limits of position are tightened in intervals of any length, for slowing does not help them;
    others in short ones alone, unless slowing does not help these either, or the motion cannot be
    slowed: its last mesh is solved again until it keeps all limits, and then takes fewer solves.
    """
    constraints = last.scaling.constraints
    places, others = constraints.sampled_places, time_costing_rows(constraints)
    cannot_slow = not last.problem.may_be_slowed and last.own_gap < _NEARLY_LAST
    soon = cannot_slow or _is_held(last, others)
    anywhere = places | others if soon else places
    is_short = mesh <= longest_tightened(last.problem, last.trajectory, mesh)
    tightenable = places | others if is_short.any() else anywhere
    tightened = replace(last.scaling, share=UNTIGHTENED)
    if tightenable.any():
        points, seen = last.program.points, _with_missed(last, places)
        tightened = tightened_where_exceeded(
            last.scaling, last.mesh, mesh, points, seen, tightenable, anywhere, is_short
        )
    tightened = replace(tightened, faces=faces)
    return tightened if last.excess is None else _at_bodies(last, last.excess, tightened, mesh)


def _is_held(last: MeshSolution, others: Truths) -> bool:
    """Whether a limit that is kept in motion alone is exceeded between points, as a torque limit
    near a singularity, where gravity asks for more at rest; or was on a mesh before.

    ``others``: the limits that slowing usually helps to keep, (rows,).
    """
    long = last.mesh > longest_tightened(last.problem, last.trajectory, last.mesh)
    shares = last.scaling.shares(len(long))[:, others]
    return isinf(last.safe_factor) or bool((shares[long] < UNTIGHTENED).any())


def _with_missed(last: MeshSolution, places: Truths) -> Array:
    """Sizes of all rows, with what samples between the points have missed of limits of position, if
    a search of all instants has found that these are exceeded, and what the solver may leave of
    them next time."""
    size, missed = last.sizes, last.needed.misplaced
    if not last.is_exact or missed <= 0 or size[:, :, places].max(initial=0.0) > 1:
        return size
    between = np.setdiff1d(np.arange(len(FRACTIONS)), samples_at(last.program.points))
    seen = size.copy()
    raised = np.ix_(np.arange(len(size)), between, np.flatnonzero(places))
    seen[raised] += missed + last.solution.left
    return seen


def _at_bodies(last: MeshSolution, excess: Array, scaling: Scaling, mesh: Array) -> Scaling:
    """A scaling for the next mesh with limits that are convex in the position tightened where the
    motion bulges over them; ``excess``: of the last."""
    convex = last.scaling.constraints.convex
    size, shares = last.sizes[:, :, convex], last.scaling.shares(len(last.mesh))[:, convex]
    highest = 1 + excess
    if scaling.faces is not None:  # the bound may be far from what it bounds beside an edge
        is_clear = scaling.faces.rows & (excess <= 0)
        highest = np.where(is_clear, size.max(axis=1), highest)
    rounded = corner_shares(scaling, last.trajectory, mesh)
    share = scaling.shares(len(mesh)).copy()
    bulging = bulge_shares(last.mesh, mesh, last.program.points, size, highest, shares)
    share[:, convex] = np.minimum(bulging, rounded)
    return replace(scaling, share=share)
