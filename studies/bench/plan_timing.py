"""How long plans of seeded random moves take: each measured by itself, in one process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter, thread_time

import numpy as np

from deltaopt.errors import NO_PLAN
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify
from studies.bench.random_scenes import random_scenes

_REFERENCE = 1e-4
"""Tolerance of the plans that others are held against: a tenth of the default, so that what is
left of theirs does not matter, and still a few hundredths of a second each."""


@dataclass(frozen=True)
class Timed:
    """A plan and the seconds it took: ``wall`` on the clock, ``processor`` of this thread.

    ``gap``: estimated. ``true_gap``: against a finer plan, NaN if there is none. ``ok``: whether
    the plan passes verification and is within its tolerance.
    """

    wall: float
    processor: float
    gap: float
    true_gap: float = np.nan
    ok: bool = False


def finer(planner: Planner) -> Planner:
    """Return a planner of the same robot for the plans that others are held against, on meshes
    alone."""
    return replace(planner, tolerance=_REFERENCE, intervals=40, resolved_below=0.0)


def timed_plans(
    planner: Planner, number: int, seed: int, *, references: int, progress: Callable[[int], None]
) -> list[Timed]:
    """Time plans of random moves, then verify them, and hold the first ``references`` of them
    against finer ones; ``progress`` is called after each move, timed or verified, with how many of
    twice ``number`` are done.

    Nothing else runs between plans: it would empty the processor's caches.
    """
    scenes = list(random_scenes(as_delta(planner.robot), planner.payload, number, seed))
    _timed(planner, scenes[0])  # what is built once is built now
    plans: list[tuple[Timed, Plan | None]] = []
    for scene in scenes:
        plans.append(_timed(planner, scene))
        progress(len(plans))
    reference = finer(planner)
    results: list[Timed] = []
    for timed, plan in plans:
        results.append(_checked(timed, plan, reference if len(results) < references else None))
        progress(number + len(results))
    return results


def _timed(planner: Planner, scene: Scene) -> tuple[Timed, Plan | None]:
    wall, processor = perf_counter(), thread_time()
    try:
        plan = planner.plan(scene.start, scene.goal)
    except NO_PLAN:
        spent = perf_counter() - wall, thread_time() - processor
        return Timed(*spent, np.nan), None
    wall, processor = perf_counter() - wall, thread_time() - processor
    return Timed(wall, processor, plan.gap), plan


def _checked(timed: Timed, plan: Plan | None, reference: Planner | None) -> Timed:
    if plan is None:
        return timed
    ok = plan.within_tolerance and verify(plan.scene, plan.trajectory).ok
    return replace(timed, ok=ok, true_gap=_true_gap(plan, reference))


def _true_gap(plan: Plan, reference: Planner | None) -> float:
    """Return the gap to the shortest duration that a finer plan leaves possible."""
    if reference is None:
        return np.nan
    try:
        best = reference.plan(plan.scene.start, plan.scene.goal)
    except NO_PLAN:
        return np.nan
    return plan.duration / (best.duration * (1 - best.gap)) - 1


def plan_report(name: str, results: list[Timed]) -> str:
    """Report medians and 99th percentiles of one robot's plans."""

    def both(of: Callable[[Timed], float]) -> str:
        values = [of(r) for r in results]
        return f"{1e3 * np.nanmedian(values):.2f} / {1e3 * np.nanpercentile(values, 99):.2f} ms"

    true = [r.true_gap for r in results if np.isfinite(r.true_gap)]
    lines = [
        f"{name}: {sum(r.ok for r in results)} of {len(results)} verified and within tolerance",
        f"  median / 99 %: clock {both(lambda r: r.wall)}, processor {both(lambda r: r.processor)}",
        f"  estimated gap: median {np.nanmedian([r.gap for r in results]):.1e}, "
        f"largest {np.nanmax([r.gap for r in results]):.1e}",
    ]
    if true:
        lines.append(
            f"  gap to a finer plan ({len(true)} moves): median {np.median(true):.1e}, "
            f"largest {np.max(true):.1e}"
        )
    return "\n".join(lines)
