"""Limits kept without slowing: where a motion begins or ends moving, slowing it would change that.

So its limits are tightened where it exceeds them between mesh points, and it is solved again, until
it keeps all of them at all instants.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite

import numpy as np

from deltaopt.curves.piecewise import with_neighbours
from deltaopt.errors import NotConverged
from deltaopt.motion.time_scaling import highest_rows
from deltaopt.planning.mesh.error_estimate import split
from deltaopt.planning.mesh.mesh_solution import MeshSolution, solve_on_mesh
from deltaopt.planning.nlp.phases import FacePhases
from deltaopt.planning.nlp.problem import Formulated, Guess

KEPT = 1e-10
"""Excess over a limit, as a share of it, that counts as none: a tenth of what verification
allows."""
_SOLVER_SHARE, _FINEST = 1e-2, 1e-8
"""Relative tolerance to which these solves meet rows, as a share of the plan's, and the smallest. A
finer one takes more iterations, a coarser one costs more margin."""
_LOOSEST = 0.1
"""The same share where the method does not converge with that one, as under limits of order 3 on a
thousand intervals. Where rates of torques peak it hardly ever does, and this is the first."""
_DEAR = 10.0
"""What tightening limits costs, as a fraction of the cost per share of them, above which they are
met to a smaller share: of motions that are hardly slower than the fastest."""
_LOOSER, _LOOSER_PAST_FACES = 3.0, 30.0
"""A plan's tolerance over that to which the solver finds the least duration, at its tightest: along
a valley that is nearly flat a smaller one is never met. Where phases meet on edges, the instant at
which they do so is a flat optimum, in which the solver leaves up to what it is allowed to."""
_MARGIN = 3.0
"""By which all limits are tightened, in units of the tolerance to which rows are met: what that may
leave. It costs as much of the duration."""
_FACTOR = 1.25
"""Tightening over the excess that was seen. A larger factor costs time, a smaller one solves."""
_MOST = 24
"""Solves at most; it takes one to three as a rule, a dozen where rates of torques peak."""
_NOTHING = 0.1
"""Of the tolerance: what slowing may cost, of the cost, so that limits are not tightened."""
_PATIENCE, _PIECES = 4, 3
"""After how many solves an interval that still exceeds a limit is split, and into how many. Beside
a start that is at a limit of speed itself tightening does not help, but a shorter interval does.
Where rates of torques peak none is: intervals are short there, and without the multipliers of their
own mesh solves hardly converge."""


def tightest(tolerance: float, faces: FacePhases | None) -> float:
    """The tightest relative tolerance to which a solver finds the least duration, for that of a
    plan; ``faces``: phases past edges."""
    return tolerance / (_LOOSER if faces is None else _LOOSER_PAST_FACES)


def kept(program: Formulated, solution: MeshSolution, tolerance: float) -> MeshSolution:
    """A solution near another whose motion keeps all limits at all instants.

    ``program``: whose solution on a mesh it is. ``tolerance``: gap that the plan asks for. Raises
    NotConverged where tightening does not lead to such a motion.
    """
    dear = max(1.0, solution.price_of_limits / _DEAR)
    accuracies = [max(share * tolerance / dear, _FINEST) for share in (_SOLVER_SHARE, _LOOSEST)]
    last, accuracy = solution, accuracies[-1 if solution.problem.rates_peak else 0]
    for attempt in range(1, _MOST + 1):
        excess = np.maximum(last.sizes.max(axis=1) - 1, 0.0)
        if last.excess is not None:
            convex = last.scaling.constraints.convex
            excess[:, convex] = np.maximum(excess[:, convex], last.excess)
        if excess.max() <= KEPT:
            peaks = highest_rows(last.problem, last.trajectory)
            if peaks.values.max() <= 1 + KEPT:
                return last.as_it_is(peaks.values)
            rows = np.arange(excess.shape[1])
            excess[peaks.intervals, rows] = np.maximum(peaks.values - 1, 0.0)
        around = with_neighbours(excess)  # the peak may come to lie in the next interval
        step = np.where(around > 0, _FACTOR * around + accuracy, 0.0)
        share = last.scaling.shares(len(last.mesh)) - step
        pieces = np.ones(len(last.mesh), np.intp)
        if attempt % _PATIENCE == 0 and not solution.problem.rates_peak:
            too_high = (excess.max(axis=1) > KEPT).reshape(-1, last.problem.together)
            pieces[np.repeat(too_high.any(axis=1), last.problem.together)] = _PIECES
        share = np.repeat(np.minimum(share, 1 - _MARGIN * accuracy), pieces, axis=0)
        if share.min() <= 0:
            break
        mesh = split(last.mesh, pieces)
        guess = Guess(
            last.trajectory,
            near=True,
            tolerance=max(tightest(tolerance, last.faces), accuracy),
            rows=accuracy,
            multipliers=last.solution.multipliers if len(mesh) == len(last.mesh) else None,
        )
        scaling = replace(last.scaling, share=share, faces=last.faces)
        try:
            last = solve_on_mesh(program(mesh), scaling, guess)
        except NotConverged:
            if accuracy == accuracies[-1]:
                raise
            accuracy = accuracies[-1]
    raise NotConverged(
        "limits that are exceeded between the points of the mesh, where slowing is no remedy, are "
        f"still exceeded by {excess.max():.1e} after they were tightened {attempt} times",
        "No_Progress",
        last.trajectory,
    )


def kept_or_slowed(program: Formulated, solution: MeshSolution, tolerance: float) -> MeshSolution:
    """A solution near another whose motion keeps all limits at all instants: by tightening them.

    Where the motion rests at both ends and its duration is free, it is slowed instead if that costs
    next to nothing, or if tightening does not converge. Raises NotConverged.
    """
    problem = solution.problem
    if problem.objective.duration is not None or not problem.is_at_rest:
        return kept(program, solution, tolerance)
    slowed = _slowed(solution)
    if slowed.needed.keeps_places and slowed.cost <= (1 + _NOTHING * tolerance) * solution.cost:
        return slowed
    try:
        return kept(program, solution, tolerance)
    except NotConverged:
        return slowed


def _slowed(solution: MeshSolution) -> MeshSolution:
    """A solution with its motion slowed until it keeps its limits."""
    exact = replace(solution, is_exact=False).exact()
    needed = replace(exact.needed, factor=1.0)
    if not isfinite(exact.safe_factor):
        return replace(exact, needed=replace(needed, misplaced=inf))
    slowed = exact.trajectory.slowed((1 + KEPT) * exact.safe_factor)
    return replace(exact, trajectory=slowed, needed=needed)
