"""Reference durations again, by means that have as little in common as possible.

The plan of each scene with its switches resolved is held against the same arcs solved by Ipopt with
polynomials of two other degrees, against shooting, and against forward dynamics on meshes that know
nothing of switches and on meshes that have knots there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt import NotConverged, Plan, Scene, forward
from deltaopt.cli.arguments import first_intervals, load_fastest
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.time_scaling import loads_inside
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.formulations.delta import DeltaProblem
from deltaopt.planning.mesh.error_estimate import FRACTIONS
from deltaopt.planning.nlp.cost import FASTEST
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.planning.switching.structure import SwitchingStructure
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import limits_of
from studies.problems import LIGHT, add_scenes
from tests.oracles.arcs import ArcProblem
from tests.oracles.shooting import shoot

HELP = "reference durations again by shooting, by forward dynamics, by other polynomials"
Array = NDArray[np.float64]

DEGREES = (8, 11)
"""Of the polynomials on arcs."""
INTERVALS = 160
"""Of the meshes for forward dynamics."""
SMALL = {"scenes": (LIGHT,), "intervals": 80}
_DISTURBED = 1e-3
"""The other methods start from lengths of arcs that are off by up to this share."""
_SLOWER = 1.1
"""Factor by which the guess for forward dynamics is slowed, so that its torques are well within
their limits."""


@dataclass(frozen=True)
class Answer:
    """The duration that a method finds, s; NaN and the reason where it finds none."""

    method: str
    duration: float
    trouble: str = ""


@dataclass(frozen=True)
class Agreement:
    """The duration of the plan at a tolerance of 1e-8 (s), and the answers of other methods."""

    reference: float
    answers: tuple[Answer, ...]

    def differs(self, answer: Answer) -> float:
        """Return the difference to the reference, as a fraction of it."""
        return answer.duration / self.reference - 1


def agreement(scene: Scene, intervals: int, progress: Callable[[int], None]) -> Agreement:
    """Solve one scene by all methods; ``intervals``: of the meshes for forward dynamics.

    ``progress`` is called after each method with how many are done.
    """
    found = deltaopt.plan(scene, tolerance=1e-8)
    structure = _structure(found)
    methods: list[tuple[str, Callable[[], float]]] = [
        (f"arcs, degree {degree}", partial(_by_arcs, found, structure, degree))
        for degree in DEGREES
    ]
    methods += [
        ("shooting", lambda: shoot(scene, structure, found.duration).duration),
        (f"forward, {intervals} uniform", partial(_forward, found, _uniform(intervals))),
        (
            f"forward, {intervals} on switches",
            partial(_forward, found, _on_switches(found, intervals)),
        ),
    ]
    answers = []
    for method, duration in methods:
        try:
            answers.append(Answer(method, duration()))
        except NotConverged as error:
            answers.append(Answer(method, float("nan"), str(error)))
        progress(len(answers))
    return Agreement(found.duration, tuple(answers))


def _structure(found: Plan) -> SwitchingStructure:
    """Detect from the motion itself which limits hold when, and disturb the lengths of the arcs."""
    scene, motion = found.scene, found.trajectory
    rows = loads_inside(problem_of(scene), motion, FRACTIONS).rows
    by_interval = rows.reshape(-1, len(FRACTIONS), rows.shape[1])
    of_order = ByOrder.of(limits_of(scene).constraints, by_interval)._replace(position=None)
    detected = detect_structure(np.diff(motion.knots) / found.duration, of_order)
    rng = np.random.default_rng(1)
    off = 1 + _DISTURBED * rng.uniform(-1, 1, len(detected.lengths))
    detected.lengths[:] *= off
    return detected


def _by_arcs(found: Plan, structure: SwitchingStructure, degree: int) -> float:
    model, scaling = found.trajectory.model, Scaling(problem_of(found.scene), found.duration)
    equations = point_equations(model.functions, scaling.constraints)
    problem = ArcProblem(equations, structure, degree)
    guess = problem.pack(found.trajectory, scaling)
    p = scaling.parameters(model.parameters)
    solution = problem.program.solve(guess, *problem.bounds(scaling), p)
    return float(problem.lengths(solution.z).sum()) * scaling.time


def _forward(found: Plan, mesh: Array) -> float:
    """Return the duration on a mesh, not slowed: limits hold at its points only."""
    model, scaling = found.trajectory.model, Scaling(problem_of(found.scene), found.duration)
    equations = forward.of(model.functions, QUADRATIC, scaling.constraints, FASTEST)
    start = Guess(found.trajectory.slowed(_SLOWER), near=False, tolerance=1e-8)
    # the duration alone
    collocation = replace(equations.on(mesh).collocation, regularisation=0.0)
    found_there = DeltaProblem(collocation).solve(start, scaling, model.parameters)
    return float(found_there.position.knots[-1])


def _uniform(intervals: int) -> Array:
    return np.full(intervals, 1 / intervals)


def _on_switches(found: Plan, intervals: int) -> Array:
    """Return a mesh of about as many intervals, none of them across a switch."""
    lengths = np.diff(found.trajectory.knots) / found.duration
    pieces = np.ceil(lengths * intervals).astype(int)
    return np.repeat(lengths / pieces, pieces)


def table(name: str, study: Agreement) -> str:
    """Return a line for each method."""
    rows = [f"{name}: {study.reference:.10f} s by deltaopt plan --tolerance 1e-8"]
    for answer in study.answers:
        if answer.trouble:
            rows.append(f"  {answer.method:<26}no answer: {answer.trouble}")
        else:
            seconds, differs = f"{answer.duration:.10f} s", f"{study.differs(answer):+.1e}"
            rows.append(f"  {answer.method:<26}{seconds}{differs:>10}")
    return "\n".join(rows)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    parser.add_argument(
        "--intervals",
        type=first_intervals,
        default=INTERVALS,
        metavar="N",
        help=f"of the meshes for forward dynamics (default: {INTERVALS})",
    )


def run(arguments: argparse.Namespace) -> int:
    for file in arguments.scenes:
        progress = ProgressBar().counting(len(DEGREES) + 3, file.stem)
        study = agreement(load_fastest(file), arguments.intervals, progress)
        print(table(file.stem, study), flush=True)
    return 0
