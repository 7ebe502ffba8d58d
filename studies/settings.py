"""The planner's settings held against others: what whole plans cost with each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.errors import DeltaOptError
from deltaopt.files.validated_record import Vector3
from deltaopt.planning.flat.flat_problem import FAR, NEAR, Flat
from deltaopt.planning.flat.interior_point import Settings
from deltaopt.planning.planner import Plan, Planner
from deltaopt.robot.robot import Robot

_INTERVALS = (8, 10, 12, 14, 16, 20, 24, 32)
_BARRIERS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 3.0)
_SLACKS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6)
_TOLERANCES = (3e-3, 5e-4)


@dataclass(frozen=True)
class Run:
    """A plan's processor ``seconds`` and ``work``; ``ok``: whether it is within its tolerance."""

    seconds: float
    work: float
    ok: bool


def compare_settings(
    robot: Robot, payload: float, number: int, seed: int, told: Callable[[int], None]
) -> dict[str, list[Run]]:
    """Plans of random moves with every setting, move by move, so that load falls on all alike.

    The planner's own come first.
    """
    planners = {"as chosen": Planner(robot, payload), **_others(Planner(robot, payload))}
    runs: dict[str, list[Run]] = {name: [] for name in planners}
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        for name, planner in planners.items():
            if i == 0:
                _run(planner, scene.start, scene.goal)  # what is built once is built now
            runs[name].append(_run(planner, scene.start, scene.goal))
        told(i + 1)
    return runs


def _others(chosen: Planner) -> dict[str, Planner]:
    """Planners that each differ from this one in one setting."""
    planners = {f"first mesh of {N}": replace(chosen, intervals=N) for N in _INTERVALS}
    ways: tuple[tuple[str, tuple[float, ...], Callable[[Settings, float], Settings]], ...] = (
        ("barrier", _BARRIERS, lambda settings, value: replace(settings, barrier=value)),
        ("slack", _SLACKS, lambda settings, value: replace(settings, closest=value)),
    )
    for name, values, changed in ways:
        for value in values:
            far = changed(FAR, value)
            planners[f"from far, {name} {value:g}"] = _beginning(chosen, far, NEAR)
        for value in values:
            near = changed(NEAR, value)
            planners[f"from near, {name} {value:g}"] = _beginning(chosen, FAR, near)
    for tolerance in _TOLERANCES:
        planners[f"tolerance {tolerance:.0e}"] = replace(chosen, tolerance=tolerance)
    same = _beginning(chosen, FAR, NEAR), chosen
    return {name: planner for name, planner in planners.items() if planner not in same}


def _beginning(chosen: Planner, far: Settings, near: Settings) -> Planner:
    """With other first beginnings; where these do not do, the same ones follow."""
    usual = Flat()
    pose = Flat(from_far=(far, *usual.from_far[1:]), from_near=(near, *usual.from_near[1:]))
    return replace(chosen, formulation=pose)


def _run(planner: Planner, start: Vector3, goal: Vector3) -> Run:
    begin = process_time()
    try:
        plan = planner.plan(start, goal)
    except DeltaOptError:
        return Run(process_time() - begin, np.nan, ok=False)
    return Run(process_time() - begin, work(plan), plan.within_tolerance)


def work(plan: Plan) -> float:
    """Σ intervals · (iterations + 1) over the meshes of a plan."""
    return float(sum(r.intervals * (r.iterations + 1) for r in plan.rounds))


def settings_report(runs: dict[str, list[Run]]) -> str:
    """One line per setting; ratios of medians to the first."""
    first = next(iter(runs.values()))
    lines = [
        f"{'setting':<26}{'within tolerance':>17}{'work':>8}{'99 %':>8}{'ratio':>7}"
        f"{'ms':>8}{'99 %':>8}{'ratio':>7}"
    ]
    for name, found in runs.items():
        line = f"{name:<26}{np.mean([r.ok for r in found]):>17.1%}"
        for number, of in ((0, _works), (2, _milliseconds)):
            own, reference = of(found), of(first)
            line += f"{np.nanmedian(own):>8.{number}f}{np.nanpercentile(own, 99):>8.{number}f}"
            line += f"{np.nanmedian(own) / np.nanmedian(reference):>7.2f}"
        lines.append(line)
    return "\n".join(lines)


def _works(runs: list[Run]) -> list[float]:
    return [r.work for r in runs]


def _milliseconds(runs: list[Run]) -> list[float]:
    return [1e3 * r.seconds for r in runs]
