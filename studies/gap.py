"""The estimated gap of plans against the true one, from a far finer plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from deltaopt.planning.planner import Plan, plan
from deltaopt.scene.scene import Scene

TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
REFERENCE = 1e-5
"""Tolerance of the plan that stands for the optimum."""


@dataclass(frozen=True)
class GapStudy:
    """Plans of one scene at several tolerances, and the one they are held against."""

    reference: Plan
    plans: tuple[Plan, ...]

    def true_gap(self, plan: Plan) -> float:
        """By what fraction a plan takes longer than the reference."""
        return plan.duration / self.reference.duration - 1


def gap_study(
    scene: Scene,
    tolerances: tuple[float, ...] = TOLERANCES,
    reference: float = REFERENCE,
    told: Callable[[int], None] = lambda done: None,
) -> GapStudy:
    """Plan a scene at each tolerance, then at the reference's; ``told`` after each how many."""
    plans = []
    for tolerance in (*tolerances, reference):
        plans.append(plan(scene, tolerance=tolerance))
        told(len(plans))
    return GapStudy(plans[-1], tuple(plans[:-1]))
