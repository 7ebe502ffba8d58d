"""Finer and finer meshes, until little enough is given away or the switches are resolved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.certificate import MET, Certificate
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import ByOrder, ConstraintRows, multipliers_by_order
from deltaopt.planning.flat.flat_problem import ScaledEquations
from deltaopt.planning.mesh.error_estimate import FRACTIONS, refined
from deltaopt.planning.mesh.mesh_costates import certify_mesh
from deltaopt.planning.mesh.mesh_solution import Attempt, Round, attempt, round_of, shares
from deltaopt.planning.nlp.problem import Guess, Posed
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.switching.conditions import ActiveRows, Barrier
from deltaopt.planning.switching.detection import (
    BY_MULTIPLIERS,
    SHARP,
    STANDARD,
    DetectionSettings,
    detect_structure,
)
from deltaopt.planning.switching.resolution import ResolvedMotion, Unresolved, resolve_switches
from deltaopt.planning.switching.structure import Arc, SwitchingStructure
from deltaopt.robot.model import DeltaModel

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_READABLE, _MOST_READ = 2e-3, 3
"""A mesh solution with a smaller gap shows which motor is at which limit when; so many are read,
for what they do not settle those with knots a little closer hardly do."""
_SHARP = 1e-5
"""One with a smaller gap shows it sharply, and is read once more."""
_FALL, _FALL_TO_READ = 32.0, 16.0
"""From one mesh to the next the gap is to fall to this part at least: asked for more, a coarse
mesh would be split everywhere."""
_COARSE = 1e-3
"""More is not aimed at on any mesh, not even where a motion cannot be slowed to its limits."""
_EXACT, _COARSEST = 300.0, 1e-4
"""A mesh is solved to this part of the gap of the one before, and to so much at least."""
_LEAST_AIM = 3e-7
"""To be given away on a mesh: less cannot be told from what the solver leaves."""
_MOST_ROUNDS, _MOST_ALIKE, _MOST_FAILURES = 17, 4, 2
"""Meshes; of these alike, with limits tightened again and again; that bring no solution."""


@dataclass
class Search:
    """From a first guess to the best motion, for one scene.

    ``resolves``: whether switches are to be resolved. ``attempts`` and ``rounds``: the meshes it
    has taken so far.
    """

    posed: Posed
    scales: Scales
    model: DeltaModel
    tolerance: float
    resolves: bool
    tell: Progress
    attempts: list[Attempt] = field(default_factory=list, init=False)
    rounds: list[Round] = field(default_factory=list, init=False)
    _meshes_to_read: int = field(default=_MOST_READ, init=False)
    _sharp_to_read: int = field(default=1, init=False)
    _alike: int = field(default=0, init=False)
    _failures: int = field(default=0, init=False)

    def from_guess(self, first: Guess, intervals: int) -> ResolvedMotion | None:
        """With its switches resolved, if they are; otherwise the best attempt is the answer.

        Raises NotConverged where the first mesh brings nothing.
        """
        self._solve(np.full(intervals, 1 / intervals), first, self.scales)
        while not self._done:
            last, gap = self.attempts[-1], self.rounds[-1].gap
            aim = max(self.tolerance / 3, _LEAST_AIM, min(gap / _FALL, _COARSE))
            readings = self._readings_left(gap)
            if readings:
                resolved = self._resolved(readings)
                if resolved:
                    return resolved
                aim = max(aim, gap / _FALL_TO_READ)
            mesh = self._finer(last, aim / 3**self._failures)
            scales = last.tightened(mesh)
            if self._repeats(last, mesh, scales):
                self.tell(f"{len(last.mesh)} intervals: no finer mesh is known to be worth it")
                break
            accuracy = max(self.tolerance / 3, min(gap / _EXACT, _COARSEST))
            try:
                self._solve(mesh, Guess(last.trajectory, near=True, tolerance=accuracy), scales)
                self._failures = 0
            except NotConverged as error:  # what is there already is a motion all the same
                self.tell(f"{len(mesh)} intervals: {error}")
                self._failures += 1
        priced = self.attempts[-1].solution.opening_prices is not None
        readable = self.resolves and priced and self.rounds[-1].gap < _READABLE
        return self._resolved(BY_MULTIPLIERS) if readable else None

    @property
    def _done(self) -> bool:
        spent = len(self.rounds) >= _MOST_ROUNDS or self._failures > _MOST_FAILURES
        return self._within_tolerance or spent

    @property
    def _within_tolerance(self) -> bool:
        """After two meshes at least: one alone has nothing to be compared with."""
        return len(self.rounds) > 1 and self.rounds[-1].gap <= self.tolerance

    def _solve(self, mesh: Array, guess: Guess, scales: Scales) -> None:
        self.attempts.append(attempt(self.posed.on(mesh), scales, guess, self.model))
        self.rounds.append(round_of(self.attempts))
        if self._within_tolerance:  # by samples; but is it?
            self.attempts[-1] = self.attempts[-1].exact()
            self.rounds[-1] = round_of(self.attempts)
        self.tell(str(self.rounds[-1]))

    def _finer(self, last: Attempt, aim: float) -> Array:
        """The next mesh: the same if all that is wrong is cured by tighter limits."""
        lost, given_away = last.lost, self.rounds[-1].gap - (last.safe_factor - 1)
        if given_away < self.tolerance / 2 and self.rounds[-1].gap < _SHARP and not self._failures:
            lost = replace(lost, unused=np.zeros_like(lost.unused))
        mesh = refined(last.mesh, lost, aim)
        return mesh if len(mesh) <= last.problem.finest else last.mesh

    def _repeats(self, last: Attempt, mesh: Array, scales: Scales) -> bool:
        """Whether nothing new would be tried; counts what is tried on one mesh."""
        N = len(mesh)
        self._alike = self._alike + 1 if len(last.mesh) == N else 0
        same = self._alike and np.array_equal(scales.shares(N), last.scales.shares(N))
        return bool(same) or self._alike > _MOST_ALIKE

    def _readings_left(self, gap: float) -> Sequence[DetectionSettings]:
        """In which the last mesh is to be read for its structure, each mesh once."""
        if not self.resolves or self._failures or self._alike or gap >= _READABLE:
            return ()
        if gap < _SHARP and self._sharp_to_read:
            self._sharp_to_read -= 1
            return SHARP
        if not self._meshes_to_read:
            return ()
        self._meshes_to_read -= 1
        return STANDARD

    def certificate(self, chosen: Attempt) -> Certificate | None:
        """Of a solution on a mesh where switches were to be resolved, if Pontryagin's condition
        is met there and the prices are known."""
        if not self.resolves or chosen.solution.opening_prices is None:
            return None
        found = certify_mesh(self._rows, chosen)
        return found if found.residual <= MET else None

    def _resolved(self, readings: Sequence[DetectionSettings]) -> ResolvedMotion | None:
        """With its switches resolved, or None if the structure cannot be settled yet."""
        last, read = self.attempts[-1], set[tuple[Arc, ...]]()
        rows = ByOrder(*shares(last.scene, last.loads), self._positions(last.trajectory))
        solved = multipliers_by_order(last.solution)
        multipliers = None if solved is None else solved.per_time(last.mesh)
        for reading in readings:
            structure = detect_structure(last.mesh, rows, reading, multipliers)
            if structure.limits in read:
                continue
            read.add(structure.limits)
            for barrier in self._barriers(structure):
                try:
                    found = resolve_switches(
                        self._rows,
                        self.model,
                        structure,
                        last.trajectory,
                        self.scales,
                        self.tolerance,
                        barrier,
                    )
                except Unresolved as error:
                    self.tell(f"{len(structure.limits)} arcs: not settled yet: {error}")
                    continue
                self.tell(
                    f"{len(found.conditions.structure.limits)} arcs: "
                    f"{found.trajectory.duration:.9f} s, gap {found.gap:.1e}, satisfies "
                    f"Pontryagin's condition to {found.certificate.residual:.0e}"
                )
                return found
        return None

    def _barriers(self, structure: SwitchingStructure) -> tuple[Barrier | None, ...]:
        """None first; then one, where there is anything that it would keep within limits."""
        active = ActiveRows.of(self._rows, structure)
        if self._rows.velocity is None and not (active.singular or active.follows.any()):
            return (None,)
        return None, Barrier(last=self.tolerance / 10)

    @property
    def _rows(self) -> ConstraintRows:
        return _constraint_rows(self.model.functions, self.scales.scene.speed_limits is not None)

    def _positions(self, motion: Trajectory) -> Array:
        """Rows of position limits inside the intervals, (N, len(FRACTIONS), 3)."""
        x, scales = motion.path_inside(FRACTIONS)[0], self.scales
        p = np.concatenate([scales.vector(), motion.model.parameters])
        rows = self._rows.positions((x - scales.origin) / scales.length, p)
        return rows.reshape(-1, len(FRACTIONS), 3)


@lru_cache(maxsize=8)
def _constraint_rows(functions: DeltaFunctions, speed: bool) -> ConstraintRows:
    """Built once in a process for all models with the same terms."""
    return ConstraintRows(ScaledEquations.of(functions, speed=speed))
