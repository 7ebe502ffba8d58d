"""Random moves planned and verified: how many succeed, in how long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.errors import DeltaOptError
from deltaopt.planning.planner import Plan, Planner
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify


@dataclass(frozen=True)
class Against:
    """A plan whose switches are resolved held against one of meshes alone, which know of no
    structure. ``differs``: by what fraction it is longer. ``told``: by how much they may differ,
    by the gaps of both."""

    differs: float
    told: float


@dataclass(frozen=True)
class Outcome:
    """What became of one move: ``failures`` is empty if its plan passed verification and is
    within the tolerance. ``seconds``: of planning, without verification. ``resolved``: its
    switches are. ``certified``: Pontryagin's condition is met to `pontryagin.MET` or better.
    ``verified``: passed verification. ``against``: if there are both plans."""

    scene: Scene
    seconds: float
    gap: float
    intervals: int
    failures: tuple[str, ...]
    resolved: bool = False
    certified: bool = False
    verified: bool = False
    against: Against | None = None


def random_plans(
    robot: Robot,
    payload: float,
    number: int,
    seed: int,
    tolerance: float,
    told: Callable[[int], None],
) -> list[Outcome]:
    """Plan and verify so many random moves, and on meshes alone too where switches are resolved;
    ``told`` after each of how many are done."""
    planner = Planner(robot, payload, tolerance=tolerance)
    outcomes = []
    for scene in random_scenes(robot, payload, number, seed):
        outcomes.append(_outcome(planner, scene))
        told(len(outcomes))
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
    certified = plan.certificate is not None
    return Outcome(
        scene=scene,
        seconds=seconds,
        gap=plan.gap,
        intervals=plan.intervals,
        failures=tuple(failures),
        resolved=plan.resolved,
        certified=certified,
        verified=verified,
        against=_against(planner, plan) if plan.resolved else None,
    )


def _against(planner: Planner, plan: Plan) -> Against | None:
    meshes = replace(planner, resolved_below=0.0)
    try:
        other = meshes.plan(plan.scene.start, plan.scene.goal)
    except DeltaOptError:
        return None
    return Against(plan.duration / other.duration - 1, plan.gap + other.gap)
