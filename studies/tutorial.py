"""The pictures of docs/tutorial.md and the numbers beside them, from the files of `deltaopt new`.

The plan; what a little more time saves; and the torques that a controller's tables ask for.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import per_motor
from deltaopt.limits.running_cost import Running
from deltaopt.motion.running_cost import running_cost
from deltaopt.output.joint_table import (
    CUBIC,
    QUINTIC,
    Interpolation,
    Rows,
    checked_table,
    platform_motion,
)
from deltaopt.output.starting_files import write_starting_files
from deltaopt.planning.comparisons import straight_lines
from deltaopt.problem.of_scene import problem_of
from studies.problems import add_directory

EXTRA = (0.01, 0.02, 0.05, 0.10, 0.20)
SMALL = {"extra": (0.2,)}
CYCLE = 1e-3
"""s, of the tutorial's controller."""
_SAMPLES = 4000
"""Of a curve of torques."""


@dataclass(frozen=True, eq=False)
class AskedTorques:
    """Torques that a table asks for as it is interpolated, (N, 3), in percent of the limit, at
    times t, (N,), s; ``most`` of any limit, as a share of it."""

    name: str
    t: Array
    percent: Array
    most: float


def starting_scene() -> deltaopt.Scene:
    """The scene that `deltaopt new` writes."""
    with TemporaryDirectory() as folder:
        _, scene = write_starting_files(Path(folder))
        return deltaopt.load_scene(scene)


def asked_torques(
    plan: deltaopt.Plan, rows: Rows, interpolation: Interpolation, name: str
) -> AskedTorques:
    """What a controller's table of a plan asks for, between its rows too."""
    checked = checked_table(plan.scene, plan.trajectory, rows, interpolation)
    angles = interpolation.pieces(checked.table)
    speeds = angles.derivative()
    steps = max(2, _SAMPLES // (len(angles.knots) - 1))
    pieces = np.repeat(np.arange(len(angles.knots) - 1), steps)  # both sides of each jump
    since = (np.diff(angles.knots)[:, None] * np.linspace(0, 1, steps)).ravel()
    model = plan.trajectory.model
    motion = platform_motion(
        model, *(each.inside(pieces, since) for each in (angles, speeds, speeds.derivative()))
    )
    torques = model.inverse_dynamics(*motion)
    limits = np.array(per_motor(plan.scene.robot.drive.torque))
    return AskedTorques(
        name, angles.knots[pieces] + since, 100 * torques / limits, checked.demand.share
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "tutorial", "the pictures")
    parser.set_defaults(extra=EXTRA)


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.plots.plan import draw  # slow to import
    from studies.plots.tutorial import draw_effort, draw_tables

    scene, directory = starting_scene(), arguments.directory
    plan = deltaopt.plan(scene)
    duty = deltaopt.verify(scene, plan.trajectory).duty
    draw(directory / "tutorial_plan.png", scene, plan.trajectory, straight_lines(scene), duty)

    efforts = {0.0: running_cost(problem_of(scene), plan.trajectory, Running.EFFORT)}
    for share in arguments.extra:
        objective = deltaopt.Effort(duration=(1 + share) * plan.duration)
        efforts[share] = deltaopt.plan(scene.model_copy(update={"objective": objective})).cost
    for share, cost in efforts.items():
        less = 100 * (1 - cost / efforts[0.0])
        print(f"{100 * share:3.0f} % more time: effort {cost:6.1f} N²m²s, {less:.0f} % less")
    draw_effort(efforts, directory / "tutorial_effort.png")

    asked = [
        asked_torques(plan, Rows(CYCLE), CUBIC, "cubic, rows each ms"),
        asked_torques(plan, Rows(), QUINTIC, "quintic, rows at the plan's own knots"),
    ]
    for each in asked:
        print(f"{each.name}: asks for {each.most:.2f} of a limit")
    draw_tables(asked, directory / "tutorial_table.png")
    print("written:", directory)
    return 0
