"""What a gap costs: uniform meshes, refined meshes and switch resolution, in processor time.

Each scene is planned in all ways, from nothing each time; what comes out is held against the plan
to the smallest tolerance.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import process_time

import numpy as np

from deltaopt import Planner, Scene
from deltaopt.cli.arguments import load_fastest
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.planning.nlp.problem import Guess
from deltaopt.problem.of_scene import problem_of
from deltaopt.settings import RESOLVED_BELOW
from studies.problems import PICK_AND_PLACE, add_directory, add_scenes, add_tolerances
from studies.uniform_mesh import motion_of, solved_on

HELP = "what a gap costs, on meshes and by switch resolution"
UNIFORM = (10, 20, 40, 80, 160)
"""Intervals."""
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
SMALL = {"scenes": (PICK_AND_PLACE,), "tolerances": (1e-2, 1e-3, 1e-6), "uniform": (10,)}
FINEST_MESH = 1e-6
"""Tolerances below this no mesh is refined to: it could not tell its gap from rounding."""
_SOLVED = 1e-6
"""To which a uniform mesh is solved: its own gap is ten times that at least."""
_RUNS = 5
"""Of each plan; the first in a process derives what is derived once, the median does not."""
MESHES, REFINED, SWITCHES = "uniform meshes", "refined meshes", "switch resolution"


@dataclass(frozen=True)
class Cost:
    """One plan: its safe ``duration`` (s) and the processor ``seconds`` it took, the median of
    several runs. ``tolerance``: what was asked for; NaN for a uniform mesh."""

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
        """Return the shortest duration, s."""
        return self.costs[-1].duration

    def gap(self, cost: Cost) -> float:
        """Return by what fraction a plan takes longer than the reference."""
        return cost.duration / self.reference - 1

    def ratio(self, tolerance: float, to: float) -> float:
        """Return how many times as long a tolerance takes by switch resolution as another on
        refined meshes."""
        (fine,) = (c for c in self.costs if (c.method, c.tolerance) == (SWITCHES, tolerance))
        (coarse,) = (c for c in self.costs if (c.method, c.tolerance) == (REFINED, to))
        return fine.seconds / coarse.seconds


def tolerance_study(
    scene: Scene,
    tolerances: Sequence[float],
    uniform: Sequence[int],
    progress: Callable[[float, str], None] = lambda done, what: None,
) -> ToleranceStudy:
    """Plan a scene in all ways; the smallest tolerance comes last.

    ``progress`` is called with the share that is done and the name of the method.
    """
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
        progress(len(costs) / len(tasks), costs[-1].method)
    return ToleranceStudy(tuple(costs))


def _planned(scene: Scene, tolerance: float, method: str) -> Cost:
    below = 0.0 if method == REFINED else RESOLVED_BELOW
    begin = process_time()
    planner = Planner(scene.robot, scene.payload, scene.limits, tolerance, resolved_below=below)
    found = planner.plan(scene.start, scene.goal)
    return Cost(method, tolerance, found.intervals, process_time() - begin, found.duration)


def _on_uniform_mesh(scene: Scene, intervals: int) -> Cost:
    """Solve once on one mesh, and slow the motion until it keeps its limits."""
    begin = process_time()
    start = Guess(first_motion(scene), near=False, tolerance=_SOLVED)
    trajectory = motion_of(solved_on(scene, intervals, start), start)
    duration = trajectory.duration * safe_factor(problem_of(scene), trajectory)
    return Cost(MESHES, float("nan"), intervals, process_time() - begin, duration)


def csv(studies: dict[str, ToleranceStudy]) -> str:
    """Return a line of numbers for each plan."""
    lines = ["scene,method,tolerance,intervals,processor_seconds,duration,gap"]
    for name, study in studies.items():
        lines += [
            f"{name},{c.method},{c.tolerance:g},{c.intervals},{c.seconds:.4f},"
            f"{c.duration:.10f},{study.gap(c):.3e}"
            for c in study.costs
        ]
    return "\n".join(lines) + "\n"


def table(name: str, study: ToleranceStudy) -> str:
    """Return a line for each plan, the reference in the last."""
    rows = [
        f"{c.method:<18}{c.tolerance:>10.0e}{c.intervals:>10}{c.seconds:>10.4f}"
        f"{study.gap(c):>10.1e}"
        for c in study.costs
    ]
    header = f"{'method':<18}{'tolerance':>10}{'intervals':>10}{'seconds':>10}{'gap':>10}"
    return "\n".join([name, header, *rows, f"gaps against {study.reference:.10f} s"])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    add_tolerances(parser, TOLERANCES)
    parser.add_argument(
        "--uniform",
        nargs="*",
        type=int,
        default=UNIFORM,
        metavar="N",
        help="intervals of uniform meshes (default: 10 to 160)",
    )
    add_directory(parser, "tolerances", "resolution.png and resolution.csv")


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.files.atomic_write import atomic_write
    from studies.plots.tolerances import draw  # slow to import

    studies = {}
    for file in arguments.scenes:
        scene = load_fastest(file)
        study = tolerance_study(scene, arguments.tolerances, arguments.uniform, ProgressBar())
        studies[file.stem] = study
        print(table(file.stem, study), end="\n\n", flush=True)
    if {1e-3, 1e-6} <= set(arguments.tolerances):
        ratios = ", ".join(f"{study.ratio(1e-6, to=1e-3):.1f}" for study in studies.values())
        print(f"1e-6 takes so many times as long as 1e-3: {ratios}")
    chart, numbers = (arguments.directory / f"resolution.{kind}" for kind in ("png", "csv"))
    with atomic_write(numbers) as temporary:
        temporary.write_text(csv(studies), encoding="utf-8")
    draw(studies, chart)
    print(f"written: {chart}, {numbers}")
    return 0
