"""Reference durations by means that have as little in common as possible.

By switch resolution with polynomials of two degrees, by shooting (see ``shooting``), and by
forward dynamics on meshes that know nothing of switches and on meshes that have knots there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.motion.time_scaling import loads_inside
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.flat.flat_problem import ScaledEquations
from deltaopt.planning.formulations.choice import Forward
from deltaopt.planning.formulations.delta import DeltaProblem
from deltaopt.planning.mesh.error_estimate import FRACTIONS
from deltaopt.planning.mesh.mesh_solution import shares
from deltaopt.planning.nlp.cost import FASTEST
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import QUADRATIC
from deltaopt.planning.planner import Plan, plan
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.planning.switching.structure import SwitchingStructure
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene
from tests.oracles.arcs import ArcProblem
from tests.oracles.shooting import shoot

Array = NDArray[np.float64]

DEGREES = (8, 11)
INTERVALS = 160
_DISTURBED = 1e-3
"""Lengths of arcs from which the others begin are off by so much."""
_SLOWER = 1.1
"""So much the guess for forward dynamics is slowed: its torques are within their limits then."""


@dataclass(frozen=True)
class Answer:
    """A way, and the duration it finds, s; NaN and why, where it finds none."""

    way: str
    duration: float
    trouble: str = ""


@dataclass(frozen=True)
class Agreement:
    """The plan's duration at a tolerance of 1e-8, s, and what others say."""

    reference: float
    answers: tuple[Answer, ...]

    def differs(self, answer: Answer) -> float:
        """As a fraction of the reference."""
        return answer.duration / self.reference - 1


def agreement(scene: Scene, told: Callable[[float], None], intervals: int = INTERVALS) -> Agreement:
    """Of all ways, for one scene; ``intervals``: of the meshes for forward dynamics."""
    found = plan(scene, tolerance=1e-8)
    structure = _structure(found)
    ways: list[tuple[str, Callable[[], float]]] = [
        (f"arcs, degree {degree}", partial(_by_arcs, found, structure, degree))
        for degree in DEGREES
    ]
    ways += [
        ("shooting", lambda: shoot(scene, structure, found.duration).duration),
        (f"forward, {intervals} uniform", partial(_forward, found, _uniform(intervals))),
        (
            f"forward, {intervals} on switches",
            partial(_forward, found, _on_switches(found, intervals)),
        ),
    ]
    answers = []
    for i, (way, duration) in enumerate(ways, 1):
        try:
            answers.append(Answer(way, duration()))
        except NotConverged as error:
            answers.append(Answer(way, float("nan"), str(error)))
        told(i / len(ways))
    return Agreement(found.duration, tuple(answers))


def _structure(found: Plan) -> SwitchingStructure:
    """Which limits hold when, from the motion itself; lengths a little off."""
    scene, motion = found.scene, found.trajectory
    rows = ByOrder(*shares(scene, loads_inside(scene, motion, FRACTIONS)))
    detected = detect_structure(np.diff(motion.knots) / found.duration, rows)
    rng = np.random.default_rng(1)
    off = 1 + _DISTURBED * rng.uniform(-1, 1, len(detected.lengths))
    detected.lengths[:] *= off
    return detected


def _by_arcs(found: Plan, structure: SwitchingStructure, degree: int) -> float:
    model, scales = found.trajectory.model, _scales(found)
    equations = ScaledEquations.of(model.functions, speed=found.scene.speed_limits is not None)
    problem = ArcProblem(equations, structure, degree)
    p = np.concatenate([scales.vector(), model.parameters])
    guess = problem.pack(found.trajectory, scales)
    solution = problem.program.solve(guess, *problem.bounds(scales), p)
    return float(problem.lengths(solution.z).sum()) * scales.time


def _forward(found: Plan, mesh: Array) -> float:
    """Unslowed: what the transcription takes for the fastest."""
    model, scales = found.trajectory.model, _scales(found)
    speed = found.scene.speed_limits is not None
    posed = Forward().of(model.functions, QUADRATIC, speed=speed, cost=FASTEST)
    start = Guess(found.trajectory.slowed(_SLOWER), near=False, tolerance=1e-8)
    chain = replace(posed.on(mesh).chain, steadiness=0.0)  # the duration alone
    found_there = DeltaProblem(chain).solve(start, scales, model.parameters)
    return float(found_there.position.knots[-1])


def _scales(found: Plan) -> Scales:
    scene = found.scene
    return Scales(scene, found.duration, least_opening(scene))


def _uniform(intervals: int) -> Array:
    return np.full(intervals, 1 / intervals)


def _on_switches(found: Plan, intervals: int) -> Array:
    """About as many intervals, none across a switch."""
    lengths = np.diff(found.trajectory.knots) / found.duration
    pieces = np.ceil(lengths * intervals).astype(int)
    return np.repeat(lengths / pieces, pieces)


def table(name: str, study: Agreement) -> str:
    """A way a line."""
    rows = [f"{name}: {study.reference:.10f} s by deltaopt plan --tolerance 1e-8"]
    for answer in study.answers:
        if answer.trouble:
            rows.append(f"  {answer.way:<26}no answer: {answer.trouble}")
        else:
            seconds, differs = f"{answer.duration:.10f} s", f"{study.differs(answer):+.1e}"
            rows.append(f"  {answer.way:<26}{seconds}{differs:>10}")
    return "\n".join(rows)
