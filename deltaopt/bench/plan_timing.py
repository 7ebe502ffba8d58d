"""How long plans take, on seeded random moves: each measured apart, in one process."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time

import numpy as np

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.codegen.compile import compiler
from deltaopt.errors import DeltaOptError, MissingPackage
from deltaopt.motion.time_scaling import speed_excess, torque_excess
from deltaopt.motion.trajectory import Array
from deltaopt.output.controller_c import export_c
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.planner import Plan, Planner
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene

_WITHIN = 1e-9
"""Excess of torque or speed that is rounding."""
_REFERENCE = 1e-4
"""Tolerance of the plans that others are held against."""


@dataclass(frozen=True)
class Timed:
    """A plan and what it took, s: ``wall`` on the clock, ``processor`` of this thread's core,
    parts of the former for rows with derivatives and for linear systems. ``gap``: estimated;
    ``true_gap``: against a finer plan, NaN if there is none. ``ok``: whether the plan keeps
    all limits and its tolerance."""

    wall: float
    processor: float
    evaluation: float
    algebra: float
    gap: float
    true_gap: float
    ok: bool


def timed_plans(
    planner: Planner, number: int, seed: int, *, references: int, told: Callable[[int], None]
) -> list[Timed]:
    """Plans of random moves, the first ``references`` of them held against finer ones."""
    finer = replace(planner, tolerance=_REFERENCE, intervals=40, resolved_below=0.0)
    results: list[Timed] = []
    for scene in random_scenes(planner.robot, planner.payload, number, seed):
        if not results:
            _timed(planner, scene, None)  # what is built once is built now
        results.append(_timed(planner, scene, finer if len(results) < references else None))
        told(len(results))
    return results


def _timed(planner: Planner, scene: Scene, finer: Planner | None) -> Timed:
    wall, processor = perf_counter(), thread_time()
    try:
        plan = planner.plan(scene.start, scene.goal)
    except DeltaOptError:
        spent = perf_counter() - wall, thread_time() - processor
        return Timed(*spent, np.nan, np.nan, np.nan, np.nan, ok=False)
    wall, processor = perf_counter() - wall, thread_time() - processor
    evaluation = sum(r.spent.evaluation for r in plan.rounds)
    algebra = sum(r.spent.algebra for r in plan.rounds)
    ok = plan.within_tolerance and _keeps_limits(plan)
    return Timed(wall, processor, evaluation, algebra, plan.gap, _true_gap(plan, finer), ok)


def _keeps_limits(plan: Plan) -> bool:
    speed = speed_excess(plan.scene, plan.trajectory)
    torque = torque_excess(plan.scene, plan.trajectory)
    return torque.value <= _WITHIN and (speed is None or speed.value <= _WITHIN)


def _true_gap(plan: Plan, finer: Planner | None) -> float:
    """Against the shortest that a finer plan leaves possible."""
    if finer is None:
        return np.nan
    try:
        best = finer.plan(plan.scene.start, plan.scene.goal, near=plan)
    except DeltaOptError:
        return np.nan
    return plan.duration / (best.duration * (1 - best.gap)) - 1


def plan_report(name: str, results: list[Timed]) -> str:
    """Medians and 99th percentiles of one robot's plans, in words."""

    def both(of: Callable[[Timed], float]) -> str:
        values = [of(r) for r in results]
        return f"{1e3 * np.nanmedian(values):.2f} / {1e3 * np.nanpercentile(values, 99):.2f} ms"

    true = [r.true_gap for r in results if np.isfinite(r.true_gap)]
    share = (
        np.nanmedian([r.evaluation / r.wall for r in results]),
        np.nanmedian([r.algebra / r.wall for r in results]),
    )
    lines = [
        f"{name}: {sum(r.ok for r in results)} of {len(results)} within limits and tolerance",
        f"  median / 99 %: clock {both(lambda r: r.wall)}, processor {both(lambda r: r.processor)}",
        f"  evaluation {both(lambda r: r.evaluation)}, linear systems {both(lambda r: r.algebra)}",
        f"  shares of the clock: evaluation {share[0]:.0%}, linear systems {share[1]:.0%}, "
        f"Python, steps and dense checks {1 - share[0] - share[1]:.0%}",
        f"  estimated gap: median {np.nanmedian([r.gap for r in results]):.1e}, "
        f"largest {np.nanmax([r.gap for r in results]):.1e}",
    ]
    if true:
        lines.append(
            f"  gap to a finer plan ({len(true)} moves): median {np.median(true):.1e}, "
            f"largest {np.max(true):.1e}"
        )
    return "\n".join(lines)


@dataclass(frozen=True)
class Scaling:
    """Milliseconds of an iteration, (number of meshes,), and what they grow with."""

    intervals: tuple[int, ...]
    milliseconds: Array

    @property
    def exponent(self) -> float:
        """Of N in time ~ N^exponent, by least squares."""
        return float(np.polyfit(np.log(self.intervals), np.log(self.milliseconds), 1)[0])


def scaling(
    robot: Robot, payload: float, seed: int, moves: int = 5, repetitions: int = 5
) -> Scaling:
    """An iteration on meshes of 10 to 640 intervals; medians over moves and repetitions."""
    intervals = tuple(10 * 2**k for k in range(7))
    times: list[list[float]] = [[] for _ in intervals]
    planner = Planner(robot, payload)
    for scene in random_scenes(robot, payload, moves, seed):
        near = planner.plan(scene.start, scene.goal)
        for k, N in enumerate(intervals):
            times[k] += [_iteration(near, N) for _ in range(repetitions)]
    return Scaling(intervals, np.array([1e3 * np.median(t) for t in times]))


def _iteration(near: Plan, intervals: int) -> float:
    """Seconds of one iteration on a uniform mesh."""
    scene, model = near.scene, near.trajectory.model
    posed = Flat().of(model.functions, LINEAR, speed=scene.speed_limits is not None)
    problem = posed.on(np.full(intervals, 1 / intervals))
    scales = Scales(scene, near.duration, least_opening(scene))
    guess = Guess(near.trajectory, near=True, tolerance=1e-3)
    solved = problem.solve(guess, scales, model.parameters)
    spent = solved.spent
    return (spent.evaluation + spent.algebra) / (solved.iterations + 1)


def exported_nanoseconds(robot: Robot) -> tuple[float, float]:
    """Inverse and forward dynamics of ``deltaopt export c``, by its own test program.

    Raises MissingPackage where there is no C compiler.
    """
    found = compiler()
    if found is None:
        raise MissingPackage("no C compiler is installed")
    with TemporaryDirectory() as folder:
        export_c(robot, Path(folder))
        build = [found.command, "-O2", "delta.c", "test_delta.c", "-lm", "-o", "test_delta"]
        subprocess.run(build, cwd=folder, check=True)
        ran = subprocess.run([f"{folder}/test_delta"], capture_output=True, text=True, check=True)
    inverse, forward = re.findall(r"(\d+) ns", ran.stdout)
    return float(inverse), float(forward)
