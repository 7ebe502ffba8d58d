"""Phases: the parts of a motion between via points, of an approach, or past the faces of a body,
each with a mesh and a duration of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.problem import Problem

_FEWEST = 4
"""Intervals of a phase on the first mesh at least: fewer cannot speed up and slow down."""

_GIVES_WAY = 0.3
"""Of an interval in which phases meet: knots that are nearer give way. Very unequal neighbours are
badly conditioned, and fewer knots are less exact."""


def joined(each: Array, together: int) -> Array:
    """The sums of so many numbers after each other, such as of the thirds of intervals."""
    return np.asarray(each.reshape(-1, together).sum(axis=1))


def parts(mesh: Array, passed: Array) -> list[slice]:
    """The intervals of each phase, of a mesh (N,) and of when its via points are passed, (n,), both
    as fractions of the duration: the knots that are nearest to these."""
    knots = np.cumsum(mesh)
    ends = [int(np.abs(knots - fraction).argmin()) + 1 for fraction in passed.tolist()]
    return [slice(a, b) for a, b in pairwise([0, *ends, len(mesh)])]


def first_mesh(problem: Problem, motion: Trajectory, intervals: int) -> Array:
    """A mesh of about so many intervals, (N,), fractions of the duration: uniform or, where there
    are phases, in each phase of a first motion; each in thirds where acceleration is continuous."""
    if not problem.gates:
        return np.full(problem.together * intervals, 1 / (problem.together * intervals))
    lengths = np.diff((boundary_instants(problem, motion) - motion.knots[0]) / motion.duration)
    counts = np.maximum(np.rint(intervals * lengths), _FEWEST).astype(int)
    counts *= problem.together
    return np.repeat(lengths / counts, counts)


def own_mesh(motion: Trajectory, pieces: int, together: int) -> Array:
    """The mesh of the knots of a motion, each interval split evenly into so many pieces, (N,),
    fractions of the duration. So many ``together`` are equally long: thirds, unless the motion's
    own intervals are thirds already."""
    own = motion.shares
    if len(own) % together == 0 and np.allclose(own, np.repeat(own[::together], together)):
        together = 1
    return np.repeat(own / (pieces * together), pieces * together)


@dataclass(frozen=True, eq=False)
class FacePhases:
    """The phases of a motion past edges: in each it keeps clear of one face of every body whose
    sharp edges it touches, and in the tube about one stretch of a path, so that phases meet on
    edges, and where those of the problem do.

    ``instants``: when they meet, fractions of the duration, (n,). ``gates``: what is given there.
    ``numbers``: of all limits in each phase, (n + 1, numbers), where faces stand for bodies and
    stretches for a path. ``rows``: which of the rows of ``Constraints.convex`` are these bodies',
    (rows,).
    """

    instants: Array
    gates: tuple[Boundary, ...]
    numbers: Array
    rows: Truths

    def moved(self, before: Array, after: Array) -> FacePhases:
        """These phases after a solution has changed the lengths of a mesh, (N,) each."""
        ends = [part.stop - 1 for part in parts(before, self.instants)[:-1]]
        return replace(self, instants=np.cumsum(after)[ends])

    def is_like(self, other: FacePhases) -> bool:
        """Whether there are the same phases, whenever they meet."""
        alike = len(self.gates) == len(other.gates) and np.array_equal(self.rows, other.rows)
        return alike and bool(np.array_equal(self.numbers, other.numbers))

    def on(self, mesh: Array, together: int) -> Array:
        """A mesh, (N,), with knots where phases meet: knots that are near give way. ``together``:
        how many intervals after each other are of equal length, as of ``Problem.together``."""
        knots = np.append(0.0, np.cumsum(joined(mesh, together)))
        inside = knots[1:-1]
        for instant in self.instants.tolist():
            after = int(np.searchsorted(inside, instant))
            beside = np.concatenate([knots[:1], inside, knots[-1:]])[[after, after + 1]]
            near = _GIVES_WAY * (beside[1] - beside[0])
            stays = (np.abs(inside - instant) > near) | np.isin(inside, self.instants)
            inside = np.unique(np.append(inside[stays], instant))
        found = np.diff(np.concatenate([knots[:1], inside, knots[-1:]]))
        return np.repeat(found / together, together)
