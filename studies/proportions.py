"""Robots of random proportions: how accurate are the four models, and do plans succeed?

Each robot has lengths, radii, masses, torques and payload of its own, and one move: inside its
workspace, at the edge of it, or along the edge. The move is planned (tolerance 1e-3) and verified.
At three instants of the plan, or at the move's ends without one, torques and accelerations of the
paper's four models are held against L_I's linear system solved with fifty digits at the rounded
state. Rows are appended to a CSV file; an interrupted campaign goes on where it ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.samples import rounded
from deltaopt.compare.dynamics.tasks import TASKS, Task
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics import ClosedForm, Explicit, Formulation, Kane, Multiplier, VirtualWork
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES, DeltaTerms, delta
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import DeltaModel, delta_parameters
from deltaopt.robot.robot import as_delta
from studies.gap_moves import Move, move_of_random_robot
from studies.kept_rows import kept_rows
from studies.models.singularities import Functions
from studies.problems import add_directory
from studies.text_table import paragraph, table
from studies.timed import attempted

HELP = "robots of random proportions: accuracy of the models, success of plans"
SMALL = {"number": 2}
INSTANTS = (0.25, 0.5, 0.75)
"""Of a plan, as shares of its duration."""
MODELS: dict[str, Formulation] = {
    "K, virtual work": VirtualWork(MOTOR_ANGLES),
    "K, Kane": Kane(MOTOR_ANGLES),
    "L_E, eq. (55)": Explicit(ClosedForm()),
    "L_I": Multiplier(),
}
"""The paper's four, with the constraint matrices that cost least."""


@dataclass(frozen=True)
class Row:
    """A robot: its proportions, what came of its move, and the largest relative error of each model
    (NaN without a state), torques first and then accelerations.

    ``forearm``, ``base``, ``platform``: lengths and radii over that of the arm. ``moved``: mass of
    platform and payload over that of arms and bars. ``seconds``: of the processor, planning.
    """

    number: int
    stratum: str
    forearm: float
    base: float
    platform: float
    moved: float
    speed_limit: bool
    seconds: float
    duration: float
    gap: float
    verified: bool
    failure: str
    inverse_work: float
    inverse_kane: float
    inverse_explicit: float
    inverse_multiplier: float
    forward_work: float
    forward_kane: float
    forward_explicit: float
    forward_multiplier: float

    def errors(self, task: str) -> tuple[float, ...]:
        """Return those of all ``MODELS``."""
        names = ("work", "kane", "explicit", "multiplier")
        return tuple(getattr(self, f"{task}_{name}") for name in names)

    @property
    def good(self) -> bool:
        """Whether there is a plan, verified and within its tolerance."""
        return self.verified and self.gap <= 1e-3


def row_of(each: Move, exact: ManyDigits) -> Row:
    """Plan, verify, and evaluate the models."""
    robot, payload = as_delta(each.scene.robot), each.scene.payload or 0.0
    plan, failure, seconds = attempted(lambda: deltaopt.plan(each.scene))
    gap, verified, motion = np.nan, False, None
    if plan is not None:
        motion, gap = plan.trajectory, plan.gap
        report = deltaopt.verify(each.scene, motion)
        verified, failure = bool(report.ok), "; ".join(report.failures())
    model = DeltaModel(robot, payload)
    states = _states(model, motion) if motion is not None else _at_rest(model, each)
    arm = robot.upper_arm.length
    links = 3 * (robot.upper_arm.mass + robot.forearm.mass)
    return Row(
        each.number,
        each.stratum,
        robot.forearm.length / arm,
        robot.base_radius / arm,
        robot.platform_radius / arm,
        (robot.platform.mass + payload) / links,
        robot.drive.speed is not None,
        seconds,
        motion.duration if motion is not None else np.nan,
        gap,
        verified,
        failure,
        *(error for task in TASKS for error in errors_of(model, task, states, exact)),
    )


States = list[tuple[Array, Array, Array, Array]]
"""q, q̇, q̈ and τ of some instants."""


def _states(model: DeltaModel, motion: Trajectory) -> States:
    there = motion(np.array(INSTANTS) * motion.duration)
    return list(zip(*model.motion(there.x, there.v, there.a), there.tau, strict=True))


def _at_rest(model: DeltaModel, each: Move) -> States:
    x = np.array(each.scene.given_points)
    rest = np.zeros_like(x)
    return list(
        zip(*model.motion(x, rest, rest), model.inverse_dynamics(x, rest, rest), strict=True)
    )


def errors_of(model: DeltaModel, task: Task, states: States, exact: ManyDigits) -> list[float]:
    """Return the largest relative error of each model at some states, against many digits."""
    parameters = delta_parameters(model.robot, model.payload)
    functions, p = _functions(parameters.terms()), parameters.values()
    system = functions.system(task)
    largest = [0.0] * len(MODELS)
    for q, dq, ddq, tau in states:
        given = [q, dq, ddq] if task.name == "inverse" else [q, dq, tau]
        sought = len(tau) if task.name == "inverse" else len(q)
        A, b = exact.evaluate(system, [0.0], *given, p)
        truth = rounded(exact.solve(A, b)[:sought])
        for k, formulation in enumerate(MODELS.values()):
            function = functions.function(task, formulation)
            found = np.asarray(function.call([0.0, *given, p])[0].full()).ravel()
            error = float(np.abs(found - truth).max() / np.abs(truth).max())
            largest[k] = max(largest[k], error)
    return largest


@cache
def _functions(terms: DeltaTerms) -> Functions:
    """Robots of the same terms share their equations."""
    return Functions(delta(terms.symbols()))


def plans_table(rows: Sequence[Row]) -> str:
    """Return a line for each stratum."""
    head = ("moves", "robots", "plan", "verified", "within 1e-3", "ms: median", "99 %", "largest")
    lines: list[tuple[str, ...]] = [head]
    for stratum in (*dict.fromkeys(row.stratum for row in rows), "all"):
        own = [row for row in rows if stratum in (row.stratum, "all")]
        ms = 1e3 * np.array([row.seconds for row in own])
        lines.append(
            (
                stratum,
                str(len(own)),
                str(sum(not np.isnan(row.duration) for row in own)),
                str(sum(row.verified for row in own)),
                str(sum(row.gap <= 1e-3 for row in own)),
                *(f"{np.percentile(ms, share):.0f}" for share in (50, 99, 100)),
            )
        )
    return table(lines)


def errors_table(rows: Sequence[Row]) -> str:
    """Return a line for each task and model."""
    head = ("of", "model", "error: median", "99 %", "largest", "most accurate for")
    lines: list[tuple[str, ...]] = [head]
    for task, what in (("inverse", "torques"), ("forward", "accelerations")):
        errors = np.array([row.errors(task) for row in rows])
        best = np.bincount(errors.argmin(axis=1), minlength=len(MODELS))
        for k, name in enumerate(MODELS):
            shares = (f"{np.percentile(errors[:, k], share):.0e}" for share in (50, 99, 100))
            lines.append((what, name, *shares, f"{best[k]} of {len(rows)}"))
    return table(lines)


def verdict(rows: Sequence[Row]) -> str:
    """Say how wide the proportions are, what fails, and which errors are largest where."""

    def between(name: str) -> str:
        values = [getattr(row, name) for row in rows]
        return f"{min(values):.2g} to {max(values):.2g}"

    worst = max(rows, key=lambda row: max(row.errors("inverse") + row.errors("forward")))
    names = [f"{name}, {task}" for task in ("torques", "accelerations") for name in MODELS]
    errors = worst.errors("inverse") + worst.errors("forward")
    k = int(np.argmax(errors))
    return paragraph(
        f"{len(rows)} robots: forearm {between('forearm')}, base {between('base')}, platform"
        f" {between('platform')} times the arm, platform and payload {between('moved')} times the"
        " mass of arms and bars.",
        f"{sum(row.good for row in rows)} have a plan that is verified and within 1e-3.",
        f"The largest error of all is {errors[k]:.0e} ({names[k]}): robot {worst.number},"
        f" {worst.stratum}.",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=300, metavar="N", help="robots (300)")
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="of them (1)")
    add_directory(parser, "proportions", "a CSV file")


def run(arguments: argparse.Namespace) -> int:
    a, exact = arguments, ManyDigits(50)
    rows = kept_rows(
        a.directory / f"proportions_{a.seed}.csv",
        Row,
        range(a.number),
        lambda row: row.number,
        lambda number: row_of(move_of_random_robot(a.seed, number), exact),
        ProgressBar().counting(a.number, "robots"),
    )
    print(plans_table(rows), errors_table(rows), verdict(rows), sep="\n\n")
    for row in rows:
        if not row.good:
            shape = f"forearm {row.forearm:.2f}, base {row.base:.2f}, platform {row.platform:.2f}"
            print(f"robot {row.number} ({row.stratum}; {shape}): {row.failure or row.gap}")
    return 0
