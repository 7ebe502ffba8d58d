"""Random moves, planned and verified: how many succeed, and in how long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from deltaopt.errors import NO_PLAN, DeltaOptError
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify
from studies.bench.random_scenes import random_scenes


@dataclass(frozen=True)
class MeshComparison:
    """A plan with resolved switches beside a plan of the same move on meshes alone, which know of
    no switching structure. ``longer``: by what fraction the former takes longer. ``explained``: the
    largest such fraction, of either sign, that the estimated gaps of both explain."""

    longer: float
    explained: float


@dataclass(frozen=True)
class Outcome:
    """The result of one move; ``failures`` is empty if its plan passed verification and is within
    the tolerance.

    ``seconds``: of planning, without verification. ``resolved``: whether its switches are.
    ``certified``: whether Pontryagin's condition is met. ``verified``: whether it passed
    verification. ``meshes``: the comparison with a plan on meshes alone, where there are both.
    """

    scene: Scene
    seconds: float
    gap: float
    intervals: int
    failures: tuple[str, ...]
    resolved: bool = False
    certified: bool = False
    verified: bool = False
    meshes: MeshComparison | None = None


def random_plans(
    planner: Planner, number: int, seed: int, progress: Callable[[int], None]
) -> list[Outcome]:
    """Plan and verify random moves of a planner's robot, and plan those whose switches are
    resolved on meshes alone too; ``progress`` is called after each with how many are done."""
    outcomes = []
    for scene in random_scenes(as_delta(planner.robot), planner.payload, number, seed):
        outcomes.append(_outcome(planner, scene))
        progress(len(outcomes))
    return outcomes


def _outcome(planner: Planner, scene: Scene) -> Outcome:
    begin = perf_counter()
    try:
        plan = planner.plan(scene.start, scene.goal)
    except DeltaOptError as error:
        return Outcome(scene, perf_counter() - begin, float("nan"), 0, (str(error),))
    seconds = perf_counter() - begin
    failures = list(verify(scene, plan.trajectory).failures())
    verified = not failures
    if not plan.within_tolerance:
        failures.append(f"the gap, {plan.gap:.1e}, exceeds the tolerance of {plan.tolerance:g}")
    return Outcome(
        scene=scene,
        seconds=seconds,
        gap=plan.gap,
        intervals=plan.intervals,
        failures=tuple(failures),
        resolved=plan.resolved,
        certified=plan.certificate is not None,
        verified=verified,
        meshes=_on_meshes(planner, plan) if plan.resolved else None,
    )


def _on_meshes(planner: Planner, plan: Plan) -> MeshComparison | None:
    meshes = replace(planner, resolved_below=0.0)
    try:
        other = meshes.plan(plan.scene.start, plan.scene.goal)
    except NO_PLAN:
        return None
    return MeshComparison(plan.duration / other.duration - 1, plan.gap + other.gap)


def summary(name: str, outcomes: list[Outcome]) -> str:
    """Summarise the outcomes of one robot in a line, and in another those planned twice."""
    seconds = [o.seconds for o in outcomes]
    succeeded = sum(not o.failures for o in outcomes)
    gaps = [o.gap for o in outcomes if o.intervals]  # of the plans there are
    gap = f"{np.median(gaps):.1e}" if gaps else "unknown"
    return (
        f"{name}: {succeeded} of {len(outcomes)} solved and verified; "
        f"planning median {np.median(seconds):.2f} s, 99 % {np.percentile(seconds, 99):.2f} s; "
        f"estimated gap median {gap}; planned {len(gaps)}, switches resolved "
        f"{sum(o.resolved for o in outcomes)}, certified {sum(o.certified for o in outcomes)}, "
        f"verified {sum(o.verified for o in outcomes)}{_beside_meshes(outcomes)}"
    )


def _beside_meshes(outcomes: list[Outcome]) -> str:
    both = [o.meshes for o in outcomes if o.meshes]
    if not both:
        return ""
    unexplained = [each.longer for each in both if abs(each.longer) > each.explained]
    slower, faster = [d for d in unexplained if d > 0], [-d for d in unexplained if d < 0]
    return (
        f"\n  {len(both)} planned on meshes alone too: these are slower by more than both gaps "
        f"tell in {len(faster)}, by {max(faster, default=0.0):.1e} at most, and faster in "
        f"{len(slower)}, by {max(slower, default=0.0):.1e} at most"
    )
