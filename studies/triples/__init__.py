"""Three features at once: what is refused that a crude planner does, and what is planned poorly.

Random scenes of every triple of features that go together, on the shipped robots and on random
ones. Every plan is verified. What is refused is held against a planner of the study's own: from
rest to rest through random points, slowly, judged by verification.

  planned  verified, with the gap that is told
  refused  without a plan, and the crude planner finds none either
  wrong    a plan that verification does not find right, a traceback, or a refusal of what the
           crude planner does: written as a scene
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import process_time

import numpy as np
from numpy.random import Generator

import deltaopt
from deltaopt import Cycle, Plan, Scene
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.running_cost import squared_torques
from deltaopt.output.cycle_files import verified
from deltaopt.planning.journal import Entry
from studies.kept_rows import kept_rows
from studies.problems import add_directory
from studies.reproduced import write_scene
from studies.triples.crude import crude_motion
from studies.triples.drawn import drawn, triple_of

SMALL = {"number": 2}
PLANNED, REFUSED, WRONG = OUTCOMES = ("planned", "refused", "wrong")
_POOR = 3e-3
"""Gaps above it are listed."""


@dataclass(frozen=True)
class Row:
    """What came of a scene.

    ``seconds``: of the processor, for planning. ``solves``: meshes. ``origin``: the first motion
    that the plan was found from. ``reason``: why there is no plan, or what is wrong with it.
    """

    number: int
    features: str
    robot: str
    outcome: str
    seconds: float
    duration: float
    gap: float
    bound: float
    solves: int
    origin: str
    reason: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=300, help="of scenes (300)")
    parser.add_argument("--first", type=int, default=0, help="number of the first (0)")
    parser.add_argument("--seed", type=seed, default=1, help="of the random numbers (1)")
    add_directory(parser, "triples", "a CSV file of all scenes, and what is wrong as scenes")


def run(arguments: argparse.Namespace) -> int:
    """Print what came of the scenes; 1 if something is wrong."""
    name = f"triples_{arguments.seed}_{arguments.first}"
    rows = kept_rows(
        arguments.directory / f"{name}.csv",
        Row,
        range(arguments.first, arguments.first + arguments.number),
        lambda row: row.number,
        lambda i: row_of(arguments.seed, i, arguments.directory / name),
        ProgressBar().counting(arguments.number, "scenes"),
    )
    for row in rows:
        if row.outcome != PLANNED or row.gap > _POOR:
            told = f"{row.outcome}, gap {row.gap:.1e}, {row.seconds:.1f} s"
            print(f"{row.number} {row.features}, {row.robot}: {told} {row.reason}")
    counts = ", ".join(f"{sum(row.outcome == each for row in rows)} {each}" for each in OUTCOMES)
    gaps = np.array([row.gap for row in rows if row.outcome == PLANNED])
    print(
        f"{len(rows)} scenes: {counts}; of the plans {sum(gaps > _POOR)} have gaps above "
        f"{_POOR:g}, {sum(gaps == inf)} unknown ones; median "
        f"{np.median([row.seconds for row in rows]):.2f} s, most "
        f"{max(row.seconds for row in rows):.0f} s",
        flush=True,
    )
    return int(any(row.outcome == WRONG for row in rows))


def row_of(seed: int, number: int, folder: Path) -> Row:
    """Draw a scene and plan it; what is wrong is written into a folder."""
    problem, rng = drawn(seed, number), np.random.default_rng((seed, number, 1))
    legs = problem.legs if isinstance(problem, Cycle) else (problem,)
    begin, duration, gap, bound, solves, origin = process_time(), 0.0, 0.0, 0.0, 0, ""
    try:
        if isinstance(problem, Scene):
            plan = deltaopt.plan(problem)
            outcome, reason = (
                PLANNED,
                "; ".join(deltaopt.verify(problem, plan.trajectory).failures()),
            )
            duration, gap, bound = plan.duration, plan.gap, plan.lower_bound
            entries = [each for each in plan.journal if isinstance(each, Entry)]
            solves, origin = sum(each.solves for each in entries), _origin(plan, entries)
        else:
            cycle = deltaopt.plan_cycle(problem)
            outcome, reason = PLANNED, "; ".join(verified(cycle).failures())
            duration, gap = cycle.period, cycle.gap
        seconds = process_time() - begin
    except DeltaOptError as error:
        seconds = process_time() - begin
        outcome, reason = REFUSED, f"{type(error).__name__}: {error}"
        if _is_done_crudely(problem, rng):
            outcome, reason = WRONG, f"a crude planner does it: {reason}"
    except Exception as error:  # a fault of the program is what is looked for
        outcome, reason, seconds = WRONG, f"{type(error).__name__}: {error}", 0.0
    if outcome == PLANNED and reason:
        outcome = WRONG
    if outcome == WRONG:
        for i, leg in enumerate(legs):
            write_scene(folder / f"{number:05d}_{i}", leg, reason)
    robot, features = legs[0].robot.name, " ".join(triple_of(number))
    return Row(
        number, features, robot, outcome, seconds, duration, gap, bound, solves, origin, reason
    )


def _is_done_crudely(problem: Scene | Cycle, rng: Generator) -> bool:
    """Whether the crude planner does it, a cycle with motors that stay within their RMS torques."""
    if isinstance(problem, Scene):
        return crude_motion(problem, rng) is not None
    motions = [crude_motion(leg, rng) for leg in problem.legs]
    found = [motion for motion in motions if motion]
    if len(found) < len(motions):
        return False
    mean = sum(map(squared_torques, found)) / sum(motion.duration for motion in found)
    return problem.rms_limits is None or bool((np.sqrt(mean) <= problem.rms_limits).all())


def _origin(plan: Plan, entries: list[Entry]) -> str:
    """The first motion of the attempt that led to the plan's duration."""
    found = (each.proposal for each in entries if each.duration == plan.duration)
    return next(found, "none of them")
