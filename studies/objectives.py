"""What less effort costs in time, what time costs in effort, and by which polynomials.

Each scene is planned for least effort in several durations and for time weighted with effort, by
accelerations that are polynomials of three degrees.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import process_time

import deltaopt
from deltaopt import Effort, PiecewiseAcceleration, Plan, Scene, TimeAndEffort
from deltaopt.cli.arguments import positive
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.running_cost import effort
from deltaopt.planning.nlp.transcription import TRANSCRIPTIONS
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.objective import Objective
from deltaopt.verify.pontryagin import extremal
from studies.problems import CROSS, PICK_AND_PLACE, add_scenes

HELP = "what less effort costs in time"
SLOWER = (1.01, 1.1, 1.5, 2.0)
"""Durations of least effort, as multiples of the shortest."""
WEIGHTS = (0.01, 0.1, 1.0)
"""Of effort beside time, where all motors' limits all the time are as dear as the time."""
TOLERANCE = 1e-4
SMALL = {"scenes": (PICK_AND_PLACE,), "slower": (1.5,), "weights": (1.0,)}


@dataclass(frozen=True)
class Trial:
    """A plan by one transcription, its processor ``seconds`` and the ``residual`` of Pontryagin's
    condition with costates fitted to the motion. No plan where it did not converge."""

    objective: Objective
    transcription: str
    seconds: float
    plan: Plan | None
    residual: float


@dataclass(frozen=True)
class ObjectivesStudy:
    """``duration`` (s) and ``effort`` (N²m²s) of the fastest motion, and the trials of all other
    objectives."""

    duration: float
    effort: float
    trials: tuple[Trial, ...]


def objectives_study(
    scene: Scene,
    slower: Sequence[float],
    weights: Sequence[float],
    progress: Callable[[int], None],
) -> ObjectivesStudy:
    """Plan one scene, whatever its own objective, for all others; ``progress`` is called with
    the number of trials that are done."""
    fastest = deltaopt.plan(scene, tolerance=TOLERANCE)
    trials = []
    for objective in _objectives(scene, fastest.duration, slower, weights):
        other = scene.model_copy(update={"objective": objective})
        for name, transcription in TRANSCRIPTIONS.items():
            trials.append(_trial(other, name, transcription))
            progress(len(trials))
    total = effort(problem_of(scene), fastest.trajectory)
    return ObjectivesStudy(fastest.duration, total, tuple(trials))


def _objectives(
    scene: Scene, duration: float, slower: Sequence[float], weights: Sequence[float]
) -> Iterator[Objective]:
    for times in slower:
        yield Effort(duration=times * duration)
    most = sum(limit**2 for limit in scene.robot.torque_limits)
    for weight in weights:
        yield TimeAndEffort(effort=weight / most)


def _trial(scene: Scene, name: str, transcription: PiecewiseAcceleration) -> Trial:
    begin = process_time()
    try:
        found = deltaopt.plan(scene, tolerance=TOLERANCE, transcription=transcription)
    except deltaopt.NotConverged:
        return Trial(scene.objective, name, process_time() - begin, None, float("nan"))
    seconds = process_time() - begin
    residual = extremal(scene, found.trajectory).residual
    return Trial(scene.objective, name, seconds, found, residual)


def table(name: str, study: ObjectivesStudy) -> str:
    """Return a line for each objective and transcription."""
    header = (
        f"{'objective':<46}{'degree':<10}{'T, s':>9}{'effort':>9}{'intervals':>10}{'gap':>9}"
        f"{'residual':>10}{'seconds':>9}"
    )
    rows = [f"{name}: fastest {study.duration:.6f} s, effort {study.effort:.4g} N²m²s", header]
    for trial in study.trials:
        begin = f"{trial.objective!s:<46}{trial.transcription:<10}"
        if trial.plan is None:
            rows.append(f"{begin}did not converge")
            continue
        found = trial.plan
        total = effort(problem_of(found.scene), found.trajectory)
        rows.append(
            f"{begin}{found.duration:>9.5f}{total:>9.4g}"
            f"{found.intervals:>10}{found.gap:>9.0e}{trial.residual:>10.0e}{trial.seconds:>9.2f}"
        )
    return "\n".join(rows)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser, (PICK_AND_PLACE, CROSS))
    for name, default, what in (
        ("--slower", SLOWER, "durations of least effort, of the shortest"),
        ("--weights", WEIGHTS, "of effort beside time, of what all torque limits cost"),
    ):
        parser.add_argument(name, nargs="*", type=positive, default=default, metavar="X", help=what)


def run(arguments: argparse.Namespace) -> int:
    number = len(TRANSCRIPTIONS) * (len(arguments.slower) + len(arguments.weights))
    for file in arguments.scenes:
        progress = ProgressBar().counting(number, file.stem)
        scene = deltaopt.load_scene(file)
        study = objectives_study(scene, arguments.slower, arguments.weights, progress)
        print(table(file.stem, study), flush=True)
    return 0
