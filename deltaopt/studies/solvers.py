"""The same mesh, the same start, other solvers: what the flat problem costs with each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from deltaopt.errors import DeltaOptError
from deltaopt.model import DeltaModel
from deltaopt.planning.baseline import first_motion
from deltaopt.planning.flat import FAR, Flat, FlatProblem
from deltaopt.planning.interior_point import Settings
from deltaopt.planning.nlp import Options, Program
from deltaopt.planning.problem import Guess, solved_by_ipopt
from deltaopt.planning.scales import Scales
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.robot import Robot
from deltaopt.scene import Scene
from deltaopt.studies.random_scenes import random_scenes
from deltaopt.trajectory import Array

IPOPT: Mapping[str, Options] = {
    "Ipopt, as the planner's": {},
    "Ipopt, tolerance 1e-4": {"ipopt.tol": 1e-4},
    "Ipopt, monotone barrier": {"ipopt.mu_strategy": "monotone"},
    "Ipopt, monotone from 1e-3": {"ipopt.mu_strategy": "monotone", "ipopt.mu_init": 1e-3},
    "Ipopt, probing oracle": {"ipopt.mu_oracle": "probing"},
    "Ipopt, LOQO's oracle": {"ipopt.mu_oracle": "loqo"},
    "Ipopt, bound push 1e-4": {"ipopt.bound_push": 1e-4, "ipopt.bound_frac": 1e-4},
    "Ipopt, MUMPS with AMD": {"ipopt.mumps_pivot_order": 0},
    "Ipopt, MUMPS with METIS": {"ipopt.mumps_pivot_order": 5},
    "Ipopt, SPRAL": {"ipopt.linear_solver": "spral"},
}
INTERIOR: Mapping[str, Settings] = {
    "interior point, as the planner's": replace(FAR, tolerance=1e-3),
    "interior point, tolerance 1e-5": replace(FAR, tolerance=1e-5),
    "interior point, tolerance 1e-8": replace(FAR, tolerance=1e-8),
    "interior point, first barrier 1": replace(FAR, tolerance=1e-3, barrier=1.0),
    "interior point, first barrier 0.05": replace(FAR, tolerance=1e-3, barrier=0.05),
    "interior point, slack from 0.05": replace(FAR, tolerance=1e-3, closest=0.05),
    "interior point, slack from 0.1": replace(FAR, tolerance=1e-3, closest=0.1),
}


@dataclass(frozen=True)
class Trial:
    """One solver on one move."""

    seconds: float
    iterations: float
    solved: bool


@dataclass(frozen=True)
class _Case:
    """A move on a mesh, ready to be solved."""

    problem: FlatProblem
    guess: Guess
    scales: Scales
    parameters: Array


def compare_solvers(
    robot: Robot,
    payload: float,
    number: int,
    seed: int,
    intervals: int,
    told: Callable[[int], None],
) -> dict[str, list[Trial]]:
    """Every solver on every move, one after the other, so that load falls on all alike."""
    posed = Flat().of(
        DeltaModel(robot, payload).functions,
        PiecewiseAcceleration(),
        speed=robot.speed_limits is not None,
    )
    problem = posed.on(np.full(intervals, 1 / intervals))
    programs = {name: problem.program_with(options) for name, options in IPOPT.items()}
    trials: dict[str, list[Trial]] = {name: [] for name in (*INTERIOR, *IPOPT)}
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        case = _case(problem, scene)
        if i == 0:
            _interior(case, FAR)  # compiles, on a machine's first run
        for name, settings in INTERIOR.items():
            trials[name].append(_interior(case, settings))
        for name, program in programs.items():
            trials[name].append(_ipopt(case, program))
        told(i + 1)
    return trials


def _case(problem: FlatProblem, scene: Scene) -> _Case:
    model, motion = DeltaModel(scene.robot, scene.payload), first_motion(scene)
    openings = model.openings([scene.start, scene.goal])
    scales = Scales(scene, motion.duration, float(openings.min()))
    return _Case(problem, Guess(motion, near=False, tolerance=1e-3), scales, model.parameters)


def _interior(case: _Case, settings: Settings) -> Trial:
    begin = perf_counter()
    found = case.problem.from_inside(case.guess, case.scales, case.parameters, settings)
    seconds = perf_counter() - begin
    return Trial(seconds, found.iterations if found else np.nan, bool(found and found.solved))


def _ipopt(case: _Case, program: Program) -> Trial:
    begin = perf_counter()
    try:
        found = solved_by_ipopt(case.problem, program, case.guess, case.scales, case.parameters)
    except DeltaOptError:
        return Trial(perf_counter() - begin, np.nan, False)
    return Trial(perf_counter() - begin, found.iterations, True)


def solver_report(trials: dict[str, list[Trial]]) -> str:
    """One line per solver; ratios of medians to the planner's own, the first."""
    reference = np.median([t.seconds for t in next(iter(trials.values()))])
    lines = [
        f"{'solver':<36}{'solved':>8}{'iterations':>12}{'median ms':>11}{'99 %':>9}{'ratio':>8}"
    ]
    for name, results in trials.items():
        seconds = [t.seconds for t in results]
        iterations = [t.iterations for t in results if t.solved] or [np.nan]
        lines.append(
            f"{name:<36}{np.mean([t.solved for t in results]):>8.0%}{np.median(iterations):>12.0f}"
            f"{1e3 * np.median(seconds):>11.2f}{1e3 * np.percentile(seconds, 99):>9.1f}"
            f"{np.median(seconds) / reference:>8.1f}"
        )
    return "\n".join(lines)
