"""Finer and finer meshes, until little enough is given away or the switches are resolved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.mechanisms.delta_functions import DeltaFunctions
from deltaopt.model import DeltaModel
from deltaopt.planning.adjoint import certify_mesh
from deltaopt.planning.certificate import Certificate
from deltaopt.planning.extremal import Barrier
from deltaopt.planning.flat import ScaledEquations
from deltaopt.planning.gap import FRACTIONS, refined
from deltaopt.planning.problem import Guess, Posed
from deltaopt.planning.rounds import Attempt, Round, attempt, round_of, shares
from deltaopt.planning.scales import Scales
from deltaopt.planning.settle import Settled, Unsettled, settle
from deltaopt.planning.stage import Stage
from deltaopt.planning.structure import READINGS, SHARP, Limit, Reading, read_structure
from deltaopt.pontryagin import MET
from deltaopt.trajectory import Trajectory

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_READABLE = 2e-3
"""A mesh solution with a smaller gap shows which motor is at which limit when."""
_SHARP = 1e-5
"""One with a smaller gap shows it sharply."""
_MOST_READ = 3
"""Coarse meshes that structures are read from: what they do not settle finer ones hardly do."""
_LEAST_AIM = 3e-7
"""Of a mesh: less than that cannot be told from the solver's rest."""
_MOST_ROUNDS = 16
_MOST_TIGHTENED = 4
"""Rounds on one mesh with limits tightened, one after the other."""


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
    attempts: list[Attempt] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)

    def from_guess(self, first: Guess, intervals: int) -> Settled | None:
        """With its switches resolved, if they are; otherwise the best attempt is the answer.

        Raises NotConverged where the first mesh brings nothing.
        """
        self._solve(np.full(intervals, 1 / intervals), first)
        coarse, sharp, unchanged = _MOST_READ, True, 0
        while not self._done:
            last, gap = self.attempts[-1], self.rounds[-1].gap
            aim = max(self.tolerance / 3, _LEAST_AIM)
            if self.resolves and gap < _READABLE and coarse:
                coarse -= 1
                aim = max(aim, gap / 16)
                resolved = self._resolved(READINGS[: 4 if gap > 1e-4 else 2])
            elif self.resolves and gap < _SHARP and sharp:
                sharp = False
                resolved = self._resolved(SHARP)
            else:
                resolved = None
            if resolved:
                return resolved
            mesh = refined(last.problem.mesh, last.lost, aim)
            unchanged = unchanged + 1 if len(mesh) == len(last.problem.mesh) else 0
            if unchanged > _MOST_TIGHTENED:
                self.tell(f"{len(mesh)} intervals: nothing is known to be gained by more of them")
                break
            self.scales = last.overshoot.tightened(self.scales, mesh)
            accuracy = max(self.tolerance / 3, gap / 300)
            try:
                self._solve(mesh, Guess(last.trajectory, near=True, tolerance=accuracy))
            except NotConverged as error:  # what is there already is a motion all the same
                self.tell(f"{len(mesh)} intervals: {error}")
                break
        return None

    @property
    def _done(self) -> bool:
        """After two meshes at least: one alone has nothing to be compared with."""
        number, last = len(self.rounds), self.rounds[-1]
        too_fine = last.intervals > self.attempts[-1].problem.finest
        return number > 1 and (last.gap <= self.tolerance or too_fine or number > _MOST_ROUNDS)

    def _solve(self, mesh: Array, guess: Guess) -> None:
        self.attempts.append(attempt(self.posed.on(mesh), self.scales, guess, self.model))
        self.rounds.append(round_of(self.attempts))
        if len(self.rounds) > 1 and self.rounds[-1].gap <= self.tolerance:  # by samples; but is it?
            self.attempts[-1] = self.attempts[-1].exact()
            self.rounds[-1] = round_of(self.attempts)
        self.tell(str(self.rounds[-1]))

    def certificate(self, chosen: Attempt) -> Certificate | None:
        """Of a solution on a mesh, if Pontryagin's condition is met there."""
        if chosen.solution.opening_prices is None:
            return None
        torque = shares(chosen.scene, chosen.loads)[0].mean(axis=1)
        found = certify_mesh(self._stage, chosen.solution, chosen.trajectory, self.scales, torque)
        return found if found.residual <= MET else None

    def _resolved(self, readings: Sequence[Reading]) -> Settled | None:
        """With its switches resolved, or None if the structure cannot be settled yet."""
        last, read = self.attempts[-1], set[tuple[tuple[Limit, ...], ...]]()
        loads = (*shares(last.scene, last.loads), self._openings(last.trajectory))
        for reading in readings:
            structure = read_structure(last.problem.mesh, *loads, reading)
            if structure.limits in read:
                continue
            read.add(structure.limits)
            for barrier in self._barriers():
                try:
                    found = settle(
                        self._stage,
                        self.model,
                        structure,
                        last.trajectory,
                        self.scales,
                        self.tolerance,
                        barrier,
                    )
                except Unsettled as error:
                    self.tell(f"{len(structure.limits)} arcs: not settled yet: {error}")
                    continue
                self.tell(
                    f"{len(found.conditions.structure.limits)} arcs: "
                    f"{found.trajectory.duration:.9f} s, gap {found.gap:.1e}, satisfies "
                    f"Pontryagin's condition to {found.certificate.residual:.0e}"
                )
                return found
        return None

    def _barriers(self) -> Iterator[Barrier | None]:
        yield None
        yield Barrier(last=self.tolerance / 10)

    @property
    def _stage(self) -> Stage:
        return _stage(self.model.functions, self.scales.scene.speed_limits is not None)

    def _openings(self, motion: Trajectory) -> Array:
        """How far chains are from the margin of their fold, (N, len(FRACTIONS), 3)."""
        N, scales = len(motion.knots) - 1, self.scales
        since = np.diff(motion.knots)[:, None] * FRACTIONS
        x = motion.position.inside(np.repeat(np.arange(N), len(FRACTIONS)), since.ravel())
        p = np.concatenate([scales.vector(), motion.model.parameters])
        openings = self._stage.openings((x - scales.origin) / scales.length, p)
        return openings.reshape(N, len(FRACTIONS), 3)


@lru_cache(maxsize=8)
def _stage(functions: DeltaFunctions, speed: bool) -> Stage:
    """Built once in a process, as ``_posed``."""
    return Stage(ScaledEquations.of(functions, speed=speed))
