"""What less effort costs in time, what time costs in effort, and by which polynomials."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import process_time

from deltaopt.errors import NotConverged
from deltaopt.motion.effort import effort
from deltaopt.planning.nlp.transcription import TRANSCRIPTIONS, PiecewiseAcceleration
from deltaopt.planning.planner import Plan, plan
from deltaopt.scene.objective import Effort, Objective, TimeAndEffort
from deltaopt.scene.scene import Scene
from deltaopt.verify.pontryagin import extremal

SLOWER = (1.01, 1.1, 1.5, 2.0)
"""Durations of least effort, of the fastest motion's."""
WEIGHTS = (0.01, 0.1, 1.0)
"""Of effort beside time, where all motors' limits all the time are as dear as the time."""
TOLERANCE = 1e-4


@dataclass(frozen=True)
class Trial:
    """A plan by one transcription: processor ``seconds``, ``residual`` of Pontryagin's condition
    as fitted to the motion. No plan where it did not converge."""

    objective: Objective
    transcription: str
    seconds: float
    plan: Plan | None
    residual: float


@dataclass(frozen=True)
class ObjectivesStudy:
    """``duration`` and ``effort`` of the fastest motion, s and N²m²s; other objectives'."""

    duration: float
    effort: float
    trials: tuple[Trial, ...]


def objectives_study(scene: Scene, told: Callable[[float], None]) -> ObjectivesStudy:
    """Of one scene, whatever its own objective."""
    fastest = plan(scene, tolerance=TOLERANCE)
    objectives = list(_objectives(scene, fastest.duration))
    trials = []
    for objective in objectives:
        other = scene.model_copy(update={"objective": objective})
        for name, transcription in TRANSCRIPTIONS.items():
            trials.append(_trial(other, name, transcription))
            told(len(trials) / (len(objectives) * len(TRANSCRIPTIONS)))
    total = effort(scene, fastest.trajectory)
    return ObjectivesStudy(fastest.duration, total, tuple(trials))


def _objectives(scene: Scene, duration: float) -> Iterator[Objective]:
    for slower in SLOWER:
        yield Effort(duration=slower * duration)
    most = sum(limit**2 for limit in scene.torque_limits)
    for weight in WEIGHTS:
        yield TimeAndEffort(effort=weight / most)


def _trial(scene: Scene, name: str, transcription: PiecewiseAcceleration) -> Trial:
    begin = process_time()
    try:
        found = plan(scene, tolerance=TOLERANCE, transcription=transcription)
    except NotConverged:
        return Trial(scene.objective, name, process_time() - begin, None, float("nan"))
    seconds = process_time() - begin
    residual = extremal(scene, found.trajectory).residual
    return Trial(scene.objective, name, seconds, found, residual)


def table(name: str, study: ObjectivesStudy) -> str:
    """An objective and a transcription a line."""
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
        rows.append(
            f"{begin}{found.duration:>9.5f}{effort(found.scene, found.trajectory):>9.4g}"
            f"{found.intervals:>10}{found.gap:>9.0e}{trial.residual:>10.0e}{trial.seconds:>9.2f}"
        )
    return "\n".join(rows)
