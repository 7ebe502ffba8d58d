"""The loop of planning: attempts from first motions, with the remedies that may help after each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from deltaopt.errors import (
    ENDS_AN_ATTEMPT,
    DeltaOptError,
    Infeasible,
)
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.attempts import (
    Attempt,
    Outcomes,
    by_merit,
    until_good,
)
from deltaopt.planning.first_motions.belt import not_met
from deltaopt.planning.first_motions.initial_motion import has_time_to_wait
from deltaopt.planning.first_motions.proposal import Proposal
from deltaopt.planning.journal import Journal
from deltaopt.planning.plan import Plan
from deltaopt.planning.remedies import REMEDIES, better
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from deltaopt.scene.scene import Scene

_USUAL, _ANOTHER_WAY_ABOVE = 1e-3, 3e-3
"""Tolerances of at least the first are to be met, or planning starts again from another first
motion. Where a tighter one is missed it does so above the second: smaller gaps are not the first
motion's fault, and planning again seldom changes them."""


@dataclass(frozen=True)
class Loop:
    """Makes attempts to plan.

    ``optimiser``: what plans from one first motion. ``journal``: what was attempted so far.
    """

    optimiser: TrajectoryOptimiser
    journal: Journal

    def make(self, attempts: Iterator[Attempt], so_far: Outcomes) -> None:
        """Make all attempts of a source, which sees what came of those before."""
        for attempt in attempts:
            so_far.add(self.remedied(attempt))
            if self.journal.is_spent:
                self.journal.note(f"no more attempts after {self.journal.solves} meshes")
                return

    def remedied(self, attempt: Attempt) -> Plan | DeltaOptError:
        """What comes of an attempt and of the remedies that may help after it: the best plan, or
        the first error."""
        first = outcome = self.made(attempt)
        for remedy in REMEDIES:
            changed = remedy(self.optimiser, attempt, outcome)
            if changed is not None:
                attempt, outcome = changed, better(outcome, self.made(changed))
        return outcome if isinstance(outcome, Plan) else first

    def made(self, attempt: Attempt) -> Plan | DeltaOptError:
        """What comes of an attempt alone."""
        self.journal.begin(attempt.proposal, str(attempt))
        try:
            found = self.optimiser.plan(attempt, self.journal.mesh)
        except ENDS_AN_ATTEMPT as error:
            self.journal.end(str(error))
            return error
        self.journal.end(f"{found.duration:.6g} s, gap {found.gap:.1e}", found.duration)
        return found

    def on_first_mesh(self, attempt: Attempt) -> Trajectory:
        """The motion that is best on the first mesh of an attempt. Raises what ends an attempt."""
        self.journal.begin(attempt.proposal, f"{attempt}, the first mesh alone")
        try:
            found = self.optimiser.on_first_mesh(attempt)
        except ENDS_AN_ATTEMPT as error:
            self.journal.end(str(error))
            raise
        self.journal.mesh(f"{found.duration:.6g} s")
        self.journal.end(f"about {found.duration:.4g} s", found.duration)
        return found

    @property
    def good_gap(self) -> float:
        """Gap up to which a plan is good enough; above it planning starts again from another first
        motion."""
        tolerance = self.optimiser.tolerance
        return tolerance if tolerance >= _USUAL else _ANOTHER_WAY_ABOVE

    def outcomes(self, scene: Scene) -> Outcomes:
        return Outcomes(scene, inf if has_time_to_wait(scene) else self.good_gap)

    def by_merit(self, scene: Scene) -> Plan:
        """From first motions in order of merit. Raises Unreachable if there is none, NotConverged
        if none leads to a plan."""
        so_far = self.outcomes(scene)
        self.make(by_merit(so_far, self.optimiser.intervals), so_far)
        return so_far.best_known()

    def until_good(self, scene: Scene, proposals: Iterator[Proposal]) -> Plan | DeltaOptError:
        """From first motions in phases or where an end moves: the best plan, or the first error."""
        so_far = Outcomes(scene, self.good_gap)
        self.make(until_good(so_far, self.optimiser.intervals, proposals), so_far)
        if so_far.plans:
            return so_far.best_known()
        none = Infeasible("no simple motion through all given points stays within reach")
        return not_met(scene, so_far.tried, so_far.failures[0]) if so_far.failures else none

    def only_from(self, attempt: Attempt) -> Plan:
        """From one attempt. Raises what ends it."""
        so_far = Outcomes(attempt.scene, self.good_gap)
        self.make(iter([attempt]), so_far)
        return so_far.best()


def or_raise(found: Plan | DeltaOptError) -> Plan:
    """The plan that is found; raises the error that is found instead of one."""
    if isinstance(found, Plan):
        return found
    raise found
