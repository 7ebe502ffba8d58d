"""What a gap costs: uniform meshes, refined meshes and switch resolution, in processor time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from time import process_time

import numpy as np

from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.flat_problem import FlatEquations, equations
from deltaopt.planning.initial_motion import first_motion
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.planner import RESOLVED_BELOW, Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene

UNIFORM = (10, 20, 40, 80, 160)
"""Intervals."""
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
FINEST_MESH = 1e-6
"""Tolerances below this no mesh is refined to: it could not tell its gap from rounding."""
_RUNS = 5
"""Of each plan; the first of a process derives what is derived once, the median does not."""
MESHES, REFINED, SWITCHES = "uniform meshes", "refined meshes", "switch resolution"


@dataclass(frozen=True)
class Cost:
    """One plan: its safe duration (s) and what it took, ``seconds`` of one processor, the median
    of several runs.

    ``tolerance``: what was asked for; NaN of a uniform mesh.
    """

    method: str
    tolerance: float
    intervals: int
    seconds: float
    duration: float


@dataclass(frozen=True)
class ToleranceStudy:
    """All plans of one scene; the last is the reference, planned to the smallest tolerance."""

    costs: tuple[Cost, ...]

    @property
    def reference(self) -> float:
        """The shortest duration, s."""
        return self.costs[-1].duration

    def gap(self, cost: Cost) -> float:
        """By what fraction a plan takes longer than the reference."""
        return cost.duration / self.reference - 1

    def ratio(self, tolerance: float, to: float) -> float:
        """What a tolerance costs, by switch resolution, in units of what another does, refined."""
        (fine,) = (c for c in self.costs if (c.method, c.tolerance) == (SWITCHES, tolerance))
        (coarse,) = (c for c in self.costs if (c.method, c.tolerance) == (REFINED, to))
        return fine.seconds / coarse.seconds


def tolerance_study(
    scene: Scene,
    tolerances: tuple[float, ...] = TOLERANCES,
    uniform: tuple[int, ...] = UNIFORM,
    told: Callable[[float, str], None] = lambda done, what: None,
) -> ToleranceStudy:
    """Plan a scene in all ways, from nothing each time; the smallest tolerance comes last."""
    by_method = [
        [partial(_on_uniform_mesh, scene, n) for n in uniform],
        [partial(_planned, scene, t, REFINED) for t in tolerances if t >= FINEST_MESH],
        [partial(_planned, scene, t, SWITCHES) for t in tolerances if t < RESOLVED_BELOW],
    ]
    tasks = [task for tasks in by_method for task in tasks]
    costs = []
    for task in tasks:
        runs = [task() for _ in range(_RUNS)]
        costs.append(replace(runs[0], seconds=float(np.median([run.seconds for run in runs]))))
        told(len(costs) / len(tasks), costs[-1].method)
    return ToleranceStudy(tuple(costs))


def _planned(scene: Scene, tolerance: float, method: str) -> Cost:
    below = 0.0 if method == REFINED else RESOLVED_BELOW
    begin = process_time()
    planner = Planner(scene.robot, scene.payload, scene.limits, tolerance, resolved_below=below)
    found = planner.plan(scene.start, scene.goal)
    return Cost(method, tolerance, found.intervals, process_time() - begin, found.duration)


def _on_uniform_mesh(scene: Scene, intervals: int) -> Cost:
    """One mesh, one solution, slowed to its limits."""
    begin = process_time()
    model = DeltaModel(scene.robot, scene.payload)
    guess = first_motion(scene)
    scales = Scales(scene, guess.duration, least_opening(scene))
    rows = equations(model.functions, speed=scene.speed_limits is not None)
    problem = FlatEquations(rows, LINEAR).on(np.full(intervals, 1 / intervals))
    p = np.concatenate([scales.vector(), model.parameters])
    solution = problem.program.solve(problem.pack(guess, scales), *problem.bounds(scales), p)
    trajectory = Trajectory(problem.unpack(solution.z, scales), model)
    duration = trajectory.duration * safe_factor(scene, trajectory)
    return Cost(MESHES, float("nan"), intervals, process_time() - begin, duration)


def csv(studies: dict[str, ToleranceStudy]) -> str:
    """A plan a line."""
    lines = ["scene,method,tolerance,intervals,processor_seconds,duration,gap"]
    for name, study in studies.items():
        lines += [
            f"{name},{c.method},{c.tolerance:g},{c.intervals},{c.seconds:.4f},"
            f"{c.duration:.10f},{study.gap(c):.3e}"
            for c in study.costs
        ]
    return "\n".join(lines) + "\n"


def table(name: str, study: ToleranceStudy) -> str:
    """The same for people, the reference in the last line."""
    rows = [
        f"{c.method:<18}{c.tolerance:>10.0e}{c.intervals:>10}{c.seconds:>10.4f}"
        f"{study.gap(c):>10.1e}"
        for c in study.costs
    ]
    header = f"{'method':<18}{'tolerance':>10}{'intervals':>10}{'seconds':>10}{'gap':>10}"
    return "\n".join([name, header, *rows, f"gaps against {study.reference:.10f} s"])
