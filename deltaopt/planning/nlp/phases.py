"""Phases: the parts of a motion between via points, or of an approach, each with a mesh and a
duration of its own."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory, passes
from deltaopt.scene.task import Task

Array = NDArray[np.float64]

_FEWEST = 4
"""Intervals of a phase on the first mesh at least: fewer cannot speed up and slow down."""


def parts(mesh: Array, passed: Array) -> list[slice]:
    """The intervals of each phase, of a mesh (N,) and of when its via points are passed, (n,), both
    as fractions of the duration: the knots that are nearest to these."""
    knots = np.cumsum(mesh)
    ends = [int(np.abs(knots - fraction).argmin()) + 1 for fraction in passed.tolist()]
    return [slice(a, b) for a, b in pairwise([0, *ends, len(mesh)])]


def first_mesh(task: Task, motion: Trajectory, intervals: int) -> Array:
    """A mesh of about so many intervals, (N,), fractions of the duration: uniform or, where there
    are phases, in each phase of a first motion."""
    if not task.gates:
        return np.full(intervals, 1 / intervals)
    passed = (passes(task, motion) - motion.knots[0]) / motion.duration
    lengths = np.diff([0.0, *passed.tolist(), 1.0])
    counts = np.maximum(np.rint(intervals * lengths), _FEWEST).astype(int)
    return np.repeat(lengths / counts, counts)
