"""What a neighbouring solution is worth: the planner and other solvers started from one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from time import process_time

import casadi as ca
import numpy as np

from deltaopt.bench.random_scenes import random_scenes
from deltaopt.codegen.compile import compiler
from deltaopt.compare.timing import timed_call
from deltaopt.errors import DeltaOptError
from deltaopt.motion.time_scaling import rough_factor
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.planning.flat.flat_problem import FAR, NEAR, FlatProblem
from deltaopt.planning.initial_motion import between
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.program import Options
from deltaopt.planning.planner import Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from studies.settings import work
from studies.solvers import (
    HEADER,
    Case,
    FromStart,
    Trial,
    available,
    by_interior_point,
    case_of,
    flat_problem,
    flat_stages,
    report_line,
    timed,
)
from studies.sqp import FeasibleSqp, ipopt, sqp
from studies.stages import StageResult, StageSolver, fatrop

_EXACT = "Ipopt, cold"
SHARES = (0.01, 0.05)
"""How far both ends are moved, as shares of the way between them."""
_WARM: Options = {
    "ipopt.mu_strategy": "monotone",
    "ipopt.mu_init": 1e-4,
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-4,
    "ipopt.warm_start_mult_bound_push": 1e-4,
}


@dataclass(frozen=True)
class Neighbour:
    """A move and what is known from another with its ends nearby: the fastest motion there, with
    its ends moved to these and slowed until it keeps all rows, and the multipliers there."""

    case: Case
    motion: Trajectory
    multipliers: StageResult | None


Solver = Callable[[Neighbour], Trial]


def solvers_near(
    robot: Robot,
    payload: float,
    number: int,
    seed: int,
    intervals: int,
    share: float,
    told: Callable[[int], None],
) -> dict[str, list[Trial]]:
    """Solvers on one mesh from the solution of a neighbour, the first two from none."""
    problem = flat_problem(robot, payload, intervals)
    solvers = _solvers(problem)
    exact = ipopt(flat_stages(problem), {}) if compiler() else None
    trials: dict[str, list[Trial]] = {name: [] for name in solvers}
    for i, neighbour in enumerate(_neighbours(problem, exact, robot, payload, number, seed, share)):
        for name, solver in solvers.items():
            trials[name].append(solver(neighbour))
        told(i + 1)
    return trials


def _solvers(problem: FlatProblem) -> dict[str, Solver]:
    """Those that there are: all but the first two want a compiler."""
    solvers: dict[str, Solver] = {
        "interior point, near": lambda n: by_interior_point(
            replace(NEAR, tolerance=1e-3),
            replace(n.case, guess=Guess(n.motion, near=True, tolerance=1e-3)),
        ),
        "interior point, cold": lambda n: by_interior_point(replace(FAR, tolerance=1e-3), n.case),
    }
    if compiler() is None:
        return solvers
    stages = flat_stages(problem)
    cold = ipopt(stages, {})
    solvers[_EXACT] = lambda n: timed(cold, n.case.start(n.case.guess.trajectory))
    warm: dict[str, FromStart] = {
        "Ipopt, near": ipopt(stages, {}),
        "Ipopt, near, tolerance 1e-5": ipopt(stages, {"ipopt.tol": 1e-5}),
        "Ipopt, near, its warm start": ipopt(stages, _WARM),
    }
    if available("fatrop"):
        warm["fatrop, near, tolerance 1e-5"] = fatrop(stages, {"tolerance": 1e-5, "mu_init": 1e-3})
    for quadratic in filter(ca.has_conic, ("hpipm", "piqp")):
        warm[f"SQP with {quadratic}"] = sqp(stages, quadratic)
    if ca.has_conic("hpipm"):
        warm["feasible SQP with hpipm"] = FeasibleSqp(stages, "hpipm")
    return solvers | {name: partial(_from_near, solver) for name, solver in warm.items()}


def _from_near(solver: FromStart, near: Neighbour) -> Trial:
    begin = process_time()
    try:
        return timed(solver, near.case.start(near.motion), near.multipliers)
    except RuntimeError:  # a quadratic program that CasADi will not pose
        return Trial(process_time() - begin, np.nan, False)


def _neighbours(
    problem: FlatProblem,
    exact: StageSolver | None,
    robot: Robot,
    payload: float,
    number: int,
    seed: int,
    share: float,
) -> Iterator[Neighbour]:
    rng, left = np.random.default_rng(seed), number
    for scene in random_scenes(robot, payload, 10 * number, seed):
        there, model = case_of(problem, scene), DeltaModel(robot, payload)
        try:
            known = problem.solve(there.guess, there.scales, there.parameters)
            other = moved(scene, share, rng)
            here, fastest = case_of(problem, other), Trajectory(known.position, model)
            motion = between(fastest, model, other.start, other.goal)
        except DeltaOptError:
            continue
        factor = rough_factor(other, motion)
        if not np.isfinite(factor):
            continue
        multipliers = exact.solve(there.start(fastest)) if exact else None
        yield Neighbour(here, motion.slowed(max(factor, 1.0)), multipliers)
        left -= 1
        if not left:
            return


def moved(scene: Scene, share: float, rng: np.random.Generator) -> Scene:
    """With both ends moved by this share of the way between them, in any direction.

    Raises DeltaOptError where the platform cannot be held there.
    """
    way = np.linalg.norm(np.subtract(scene.goal, scene.start))
    steps = rng.normal(size=(2, 3))
    steps *= share * way / np.linalg.norm(steps, axis=1, keepdims=True)
    start, goal = (np.array([scene.start, scene.goal]) + steps).tolist()
    other = Scene(robot=scene.robot, payload=scene.payload, start=tuple(start), goal=tuple(goal))
    check_feasible(other)
    return other


def near_report(trials: dict[str, list[Trial]]) -> str:
    """One line per solver; ratios to the planner's own from near; durations above those that
    Ipopt finds to 1e-8."""
    own, cold = trials["interior point, near"], trials["interior point, cold"]
    exact = trials.get(_EXACT, cold)
    lines = [report_line(name, results, own, exact) for name, results in trials.items()]
    return "\n".join([HEADER, *lines])


# The planner


@dataclass(frozen=True)
class Gain:
    """A move planned from nothing and from a neighbour's plan: processor seconds and work."""

    cold: tuple[float, float]
    warm: tuple[float, float]
    difference: float


def planner_near(
    planner: Planner, number: int, seed: int, share: float, told: Callable[[int], None]
) -> list[Gain]:
    """``planner.plan(…, near=…)`` beside the same without; moves that it cannot do left out."""
    rng, gains = np.random.default_rng(seed), list[Gain]()
    for scene in random_scenes(planner.robot, planner.payload, 10 * number, seed):
        try:
            known = planner.plan(scene.start, scene.goal)
            other = moved(scene, share, rng)
            cold, seconds = timed_call(partial(planner.plan, other.start, other.goal))
            warm, faster = timed_call(partial(planner.plan, other.start, other.goal, near=known))
        except DeltaOptError:
            continue
        difference = warm.duration / cold.duration - 1
        gains.append(Gain((seconds, work(cold)), (faster, work(warm)), difference))
        told(len(gains))
        if len(gains) == number:
            break
    return gains


def gain_report(gains: list[Gain]) -> str:
    cold, warm = np.array([g.cold for g in gains]), np.array([g.warm for g in gains])
    differences = np.array([g.difference for g in gains])

    def both(values: Array) -> str:
        return f"{np.median(values):.2f} / {np.percentile(values, 99):.2f}"

    return (
        f"  plans, median / 99 %: cold {both(1e3 * cold[:, 0])} ms, near "
        f"{both(1e3 * warm[:, 0])} ms; intervals times iterations {np.median(cold[:, 1]):.0f} and "
        f"{np.median(warm[:, 1]):.0f}; ratio of medians "
        f"{np.median(warm[:, 0]) / np.median(cold[:, 0]):.2f} of the time, "
        f"{np.median(warm[:, 1]) / np.median(cold[:, 1]):.2f} of the work; the motion "
        f"found from near is longer by more than 1e-3 in {np.mean(differences > 1e-3):.1%} of "
        f"{len(gains)} moves, shorter in {np.mean(differences < -1e-3):.1%}"
    )
