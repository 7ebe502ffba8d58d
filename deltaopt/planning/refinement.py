"""Mesh refinement: finer and finer meshes, until little enough time is given away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.error_estimate import refined
from deltaopt.planning.mesh.mesh_solution import (
    Iteration,
    MeshSolution,
    iteration_of,
    solve_on_mesh,
)
from deltaopt.planning.nlp.problem import FormulatedProblem, Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.robot.model import DeltaModel

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_DETECTABLE_GAP, _MOST_DETECTIONS = 2e-3, 3
"""A mesh solution with a smaller gap shows which limit is active when; from so many meshes the
switching structure is detected, for what they do not resolve those with knots a little closer
hardly do."""
_SHARP_GAP = 1e-5
"""One with a smaller gap shows it sharply, and is tried once more."""
_REDUCTION, _REDUCTION_AFTER_DETECTION = 32.0, 16.0
"""From one mesh to the next the gap is to fall to this part at least: asked for more, a coarse
mesh would be split everywhere."""
_LARGEST_TARGET = 1e-3
"""More is not aimed at on any mesh, not even where a motion cannot be slowed to its limits."""
_SOLVER_MARGIN, _LOOSEST_TOLERANCE = 300.0, 1e-4
"""A mesh is solved to this part of the gap of the one before, and to so much at least."""
_SMALLEST_TARGET = 3e-7
"""To be given away on a mesh: less cannot be told from what the solver leaves."""
_MOST_MESHES, _MOST_REPEATS, _MOST_FAILURES = 17, 4, 2
"""Meshes; of these alike, with limits tightened again and again; that bring no solution."""


class ResolvedMotion(Protocol):
    """A motion whose switches are resolved, with its gap and certificate."""

    @property
    def trajectory(self) -> Trajectory: ...
    @property
    def safe_factor(self) -> float: ...
    @property
    def gap(self) -> float: ...
    @property
    def certificate(self) -> Certificate: ...
    @property
    def iterations(self) -> int: ...
    @property
    def status(self) -> str: ...
    @property
    def name(self) -> str: ...


class Resolver(Protocol):
    """Resolves switches from mesh solutions, and certifies these."""

    def from_coarse(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From a mesh that shows the structure roughly; None if it cannot be resolved yet."""
        ...

    def from_fine(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From a mesh on which next to nothing is given away."""
        ...

    def from_last(self, solution: MeshSolution) -> ResolvedMotion | None:
        """From the last mesh, where multipliers tell what is at its limit."""
        ...

    def certificate(self, solution: MeshSolution) -> Certificate | None:
        """Of a mesh solution, if Pontryagin's condition is met there."""
        ...


@dataclass
class Refinement:
    """From a first guess to the best motion, for one scene.

    ``resolver``: how switches are resolved, None if they are not to be. ``solutions`` and
    ``iterations``: of the meshes it has taken so far.
    """

    problem: FormulatedProblem
    scaling: Scaling
    model: DeltaModel
    tolerance: float
    resolver: Resolver | None
    report: Progress
    solutions: list[MeshSolution] = field(default_factory=list, init=False)
    iterations: list[Iteration] = field(default_factory=list, init=False)
    _coarse_left: int = field(default=_MOST_DETECTIONS, init=False)
    _fine_left: int = field(default=1, init=False)
    _repeats: int = field(default=0, init=False)
    _failures: int = field(default=0, init=False)

    def from_guess(self, first: Guess, intervals: int) -> ResolvedMotion | None:
        """The motion with its switches resolved, if they are; otherwise the best of ``solutions``
        is the answer.

        Raises NotConverged where the first mesh brings nothing.
        """
        self._solve(np.full(intervals, 1 / intervals), first, self.scaling)
        while not self._done:
            last, gap = self.solutions[-1], self.iterations[-1].gap
            target = max(
                self.tolerance / 3, _SMALLEST_TARGET, min(gap / _REDUCTION, _LARGEST_TARGET)
            )
            resolve = self._next_resolution(gap)
            if resolve:
                resolved = resolve(last)
                if resolved:
                    return resolved
                target = max(target, gap / _REDUCTION_AFTER_DETECTION)
            mesh = self._finer(last, target / 3**self._failures)
            scaling = last.tightened(mesh)
            if self._is_repetition(last, mesh, scaling):
                self.report(f"{len(last.mesh)} intervals: no finer mesh is known to be worth it")
                break
            accuracy = max(self.tolerance / 3, min(gap / _SOLVER_MARGIN, _LOOSEST_TOLERANCE))
            try:
                self._solve(mesh, Guess(last.trajectory, near=True, tolerance=accuracy), scaling)
                self._failures = 0
            except NotConverged as error:  # what is there already is a motion all the same
                self.report(f"{len(mesh)} intervals: {error}")
                self._failures += 1
        if self.resolver is None or self.iterations[-1].gap >= _DETECTABLE_GAP:
            return None
        return self.resolver.from_last(self.solutions[-1])

    def certificate(self, chosen: int) -> Certificate | None:
        """Of a mesh solution, where switches were to be resolved and its condition is met."""
        resolver, solution = self.resolver, self.solutions[chosen]
        return None if resolver is None else resolver.certificate(solution)

    @property
    def _done(self) -> bool:
        spent = len(self.iterations) >= _MOST_MESHES or self._failures > _MOST_FAILURES
        return self._within_tolerance or spent

    @property
    def _within_tolerance(self) -> bool:
        """After two meshes at least: one alone has nothing to be compared with."""
        return len(self.iterations) > 1 and self.iterations[-1].gap <= self.tolerance

    def _solve(self, mesh: Array, guess: Guess, scaling: Scaling) -> None:
        self.solutions.append(solve_on_mesh(self.problem.on(mesh), scaling, guess, self.model))
        self.iterations.append(iteration_of(self.solutions))
        if self._within_tolerance:  # by samples; but is it?
            self.solutions[-1] = self.solutions[-1].exact()
            self.iterations[-1] = iteration_of(self.solutions)
        self.report(str(self.iterations[-1]))

    def _finer(self, last: MeshSolution, target: float) -> Array:
        """The next mesh: the same if all that is wrong is cured by tighter limits."""
        lost, unused = last.lost, self.iterations[-1].gap - (last.safe_factor - 1)
        if (
            unused < self.tolerance / 2
            and self.iterations[-1].gap < _SHARP_GAP
            and not self._failures
        ):
            lost = replace(lost, unused=np.zeros_like(lost.unused))
        mesh = refined(last.mesh, lost, target)
        return mesh if len(mesh) <= last.problem.finest else last.mesh

    def _is_repetition(self, last: MeshSolution, mesh: Array, scaling: Scaling) -> bool:
        """Whether nothing new would be tried; counts what is tried on one mesh."""
        N = len(mesh)
        self._repeats = self._repeats + 1 if len(last.mesh) == N else 0
        same = self._repeats and np.array_equal(scaling.shares(N), last.scaling.shares(N))
        return bool(same) or self._repeats > _MOST_REPEATS

    def _next_resolution(
        self, gap: float
    ) -> Callable[[MeshSolution], ResolvedMotion | None] | None:
        """How the switches of the last mesh are to be resolved, each mesh once; None if not."""
        if self.resolver is None or self._failures or self._repeats or gap >= _DETECTABLE_GAP:
            return None
        if gap < _SHARP_GAP and self._fine_left:
            self._fine_left -= 1
            return self.resolver.from_fine
        if not self._coarse_left:
            return None
        self._coarse_left -= 1
        return self.resolver.from_coarse
