"""The same mesh, the same start, other solvers: what one problem costs with each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter, process_time
from typing import Protocol

import casadi as ca
import numpy as np

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.codegen.compile import compiler
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import DeltaOptError
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.planning.flat.flat_problem import FAR, Flat, FlatProblem
from deltaopt.planning.flat.interior_point import Settings
from deltaopt.planning.formulations.choice import Redundant
from deltaopt.planning.formulations.delta import rest_to_rest
from deltaopt.planning.initial_motion import first_motion
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.program import Options, Program
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene
from studies.stages import StageResult, Stages, StageSolver, Start, fatrop

IPOPT: Mapping[str, Options] = {
    "Ipopt, as the planner's": {},
    "Ipopt, tolerance 1e-4": {"ipopt.tol": 1e-4},
    "Ipopt, tolerance 1e-5": {"ipopt.tol": 1e-5},
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

_BEST_FATROP = "fatrop, 1e-5, first barrier 1"
FATROP: Mapping[str, Options] = {
    "fatrop, tolerance 1e-4": {"tolerance": 1e-4},
    "fatrop, tolerance 1e-5": {"tolerance": 1e-5},
    _BEST_FATROP: {"tolerance": 1e-5, "mu_init": 1.0},
    "fatrop, 1e-6, first barrier 1": {"tolerance": 1e-6, "mu_init": 1.0},
    "fatrop, 1e-8, first barrier 1": {"tolerance": 1e-8, "mu_init": 1.0},
}
MULTIPLIER = "multiplier form, Ipopt"


@dataclass(frozen=True)
class Trial:
    """One solver on one move: processor ``seconds``, the share of them spent on rows and their
    derivatives, and the duration found, ``T``, in the scene's unit."""

    seconds: float
    iterations: float
    solved: bool
    evaluation: float = np.nan
    T: float = np.nan


@dataclass(frozen=True)
class Case:
    """A move on a mesh, ready to be solved."""

    problem: FlatProblem
    guess: Guess
    scales: Scales
    parameters: Array

    def start(self, motion: Trajectory) -> Start:
        """The flat problem's variables and bounds, from a motion."""
        p = np.concatenate([self.scales.vector(), self.parameters])
        bounds = self.problem.bounds(self.scales)
        return Start(self.problem.pack(motion, self.scales), *bounds, p)


Solver = Callable[[Case], Trial]
HEADER = (
    f"{'solver':<46}{'solved':>7}{'iterations':>11}{'ms':>8}{'99 %':>8}{'ratio':>7}"
    f"{'evaluating':>11}{'above':>9}"
)


def compare_solvers(
    robot: Robot,
    payload: float,
    number: int,
    seed: int,
    intervals: int,
    told: Callable[[int], None],
) -> dict[str, list[Trial]]:
    """Every solver on every move, one after the other, so that load falls on all alike."""
    problem = flat_problem(robot, payload, intervals)
    solvers = {**_own(), **_on_flat(problem), **_on_multiplier(robot, payload, intervals)}
    trials: dict[str, list[Trial]] = {name: [] for name in solvers}
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        case = case_of(problem, scene)
        for name, solver in solvers.items():
            trials[name].append(solver(case))
        told(i + 1)
    return trials


def flat_problem(robot: Robot, payload: float, intervals: int) -> FlatProblem:
    """On a uniform mesh."""
    functions, speed = DeltaModel(robot, payload).functions, robot.speed_limits is not None
    posed = Flat().of(functions, LINEAR, speed=speed)
    return posed.on(np.full(intervals, 1 / intervals))


def case_of(problem: FlatProblem, scene: Scene) -> Case:
    """From the planner's first motion."""
    model, motion = DeltaModel(scene.robot, scene.payload), first_motion(scene)
    scales = Scales(scene, motion.duration, least_opening(scene))
    return Case(problem, Guess(motion, near=False, tolerance=1e-3), scales, model.parameters)


def flat_stages(problem: FlatProblem) -> Stages:
    """The flat problem stage by stage: states X and V, controls A and τ."""
    return _stages(problem.program, problem.n_variables, problem.intervals, tuple(range(3)), 3)


def _stages(program: Program, n: int, intervals: int, which: tuple[int, ...], m: int) -> Stages:
    """``which`` of m components go on at the knots, with their velocities."""
    states = (*which, *(m + i for i in which))
    block = (n - 2 * m - 1) // intervals
    return Stages(n, program.linear, program.points, block, states)


def _own() -> dict[str, Solver]:
    return {name: partial(by_interior_point, settings) for name, settings in INTERIOR.items()}


def _on_flat(problem: FlatProblem) -> dict[str, Solver]:
    stages = flat_stages(problem)
    solvers: dict[str, Solver] = {
        name: partial(_by_program, problem.program_with(options)) for name, options in IPOPT.items()
    }
    for name, options in FATROP.items() if available("fatrop") else ():
        solvers[name] = partial(_by_stages, fatrop(stages, options))
    return solvers


def _on_multiplier(robot: Robot, payload: float, intervals: int) -> dict[str, Solver]:
    """The same moves in twelve coordinates with λ: the other coordinates are controls."""
    functions, speed = DeltaModel(robot, payload).functions, robot.speed_limits is not None
    posed = Redundant(Multiplier()).of(functions, LINEAR, speed=speed)
    chain = posed.on(np.full(intervals, 1 / intervals)).chain
    independent, m = chain.equations.system.independent, chain.variables.components
    stages = _stages(chain.program, chain.variables.number, intervals, independent, m)

    def start(case: Case) -> Start:
        task = rest_to_rest(case.scales, case.parameters)
        z = chain.pack(case.guess.trajectory.position, task)
        return Start(z, *chain.bounds(task), task.p)

    solvers: dict[str, Solver] = {
        MULTIPLIER: lambda case: _timed_program(chain.program, start(case)),
    }
    if available("fatrop"):
        solver = fatrop(stages, FATROP[_BEST_FATROP])
        solvers[f"multiplier form, {_BEST_FATROP}"] = lambda case: timed(solver, start(case))
    return solvers


def available(plugin: str) -> bool:
    """Whether this CasADi has a solver and this machine a compiler to feed it with."""
    return bool(ca.has_nlpsol(plugin)) and compiler() is not None


def left_out(*plugins: str) -> list[str]:
    """A sentence for each of these solvers that cannot be tried here."""
    if compiler() is None:
        return [f"without a C compiler {', '.join(plugins)} are left out"]
    return [
        f"{plugin} is not in this build of CasADi and left out"
        for plugin in plugins
        if not (ca.has_nlpsol(plugin) or ca.has_conic(plugin))
    ]


def by_interior_point(settings: Settings, case: Case) -> Trial:
    """The second of two runs: it is over before caches forget what was solved before."""
    case.problem.from_inside(case.guess, case.scales, case.parameters, settings)
    begin, clock = process_time(), perf_counter()
    found = case.problem.from_inside(case.guess, case.scales, case.parameters, settings)
    seconds, clock = process_time() - begin, perf_counter() - clock
    if found is None:
        return Trial(seconds, np.nan, False)
    duration = sum(phase.duration for phase in found.phases)
    return Trial(seconds, found.iterations, found.solved, found.spent.evaluation / clock, duration)


def _by_program(program: Program, case: Case) -> Trial:
    return _timed_program(program, case.start(case.guess.trajectory))


def _timed_program(program: Program, start: Start) -> Trial:
    begin = process_time()
    try:
        found = program.solve(start.z, start.lower, start.upper, start.p)
    except DeltaOptError:
        return Trial(process_time() - begin, np.nan, False)
    seconds, spent = process_time() - begin, found.spent
    share = spent.evaluation / (spent.evaluation + spent.algebra)
    return Trial(seconds, found.iterations, True, share, float(found.z[-1]))


def _by_stages(solver: StageSolver, case: Case) -> Trial:
    return timed(solver, case.start(case.guess.trajectory))


class FromStart(Protocol):
    """A solver of a program written stage by stage."""

    def solve(self, start: Start, multipliers: StageResult | None = None) -> StageResult: ...


def timed(solver: FromStart, start: Start, multipliers: StageResult | None = None) -> Trial:
    begin = process_time()
    found = solver.solve(start, multipliers)
    seconds = process_time() - begin
    return Trial(seconds, found.iterations, found.solved, found.evaluation / found.total, found.T)


def solver_report(trials: dict[str, list[Trial]]) -> str:
    """One line per solver; ratios of medians to the planner's own, the first; durations above
    those that Ipopt finds for the same problem to 1e-8."""
    first = next(iter(trials.values()))
    lines = [HEADER]
    for name, results in trials.items():
        exact = trials[MULTIPLIER if name.startswith("multiplier") else next(iter(IPOPT))]
        lines.append(report_line(name, results, first, exact))
    return "\n".join(lines)


def report_line(name: str, results: list[Trial], first: list[Trial], exact: list[Trial]) -> str:
    """Medians over moves; iterations and what follows of those that were solved."""
    seconds = np.array([t.seconds for t in results])
    solved = [(t, e) for t, e in zip(results, exact, strict=True) if t.solved]
    iterations, evaluation, above = np.median(
        [(t.iterations, t.evaluation, t.T / e.T - 1) for t, e in solved] or [3 * (np.nan,)], axis=0
    )
    return (
        f"{name:<46}{np.mean([t.solved for t in results]):>7.0%}{iterations:>11.0f}"
        f"{1e3 * np.median(seconds):>8.2f}{1e3 * np.percentile(seconds, 99):>8.1f}"
        f"{np.median(seconds) / np.median([t.seconds for t in first]):>7.1f}"
        f"{evaluation:>11.0%}{above:>9.0e}"
    )
