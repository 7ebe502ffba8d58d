"""Compute the torques along the straight line of a scene: the paper's section 5.3.

The platform goes from start to goal on a straight line, at rest and without acceleration at
both ends, in a time that is given. DIR receives

  inverse.csv   the motion: platform, motors, torques
  motion.png    displacement, velocity, acceleration (the paper's Fig. 4)
  torques.png   torques of the motors (the paper's Fig. 5)

Nothing is optimised, and limits are reported but need not be kept.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from deltaopt.cli.arguments import WrongUsage, add_output, output_directory, positive
from deltaopt.cli.check import bounds_in_words
from deltaopt.cli.streams import new_files
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.plan_files import MOST_ROWS, RATE, write_motion
from deltaopt.planning.first_motions.initial_motion import straight_line
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.scene.task import given_points


def add_arguments(parser: argparse.ArgumentParser) -> None:
    words = "scene file, such as problems/pick_and_place.yaml"
    parser.add_argument("scene", type=Path, metavar="SCENE", help=words)
    add_output(parser)
    words = "time from start to goal, s (default: 0.5; the paper does not say its own)"
    parser.add_argument("--duration", type=positive, default=0.5, metavar="S", help=words)


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.plots.inverse import draw_motion, draw_torques  # slow to import

    longest = (MOST_ROWS - 1) / RATE
    if arguments.duration > longest:
        raise WrongUsage(
            f"--duration is {arguments.duration:g} s; with {RATE:g} rows a second and at most "
            f"{MOST_ROWS} rows in inverse.csv it may be {longest:g} s at most"
        )
    scene = load_scene(arguments.scene)
    check_feasible(scene)
    directory = output_directory(arguments)
    model = delta_model(scene.robot, scene.payload)
    trajectory = straight_line(model, *given_points(scene.task), arguments.duration)
    print(_table(trajectory))
    print(_against_limits(scene, trajectory))
    csv, motion, torques = ("inverse.csv", "motion.png", "torques.png")
    with new_files(directory, csv, motion, torques) as folder:
        write_motion(folder / csv, trajectory)
        draw_motion(folder / motion, trajectory)
        draw_torques(folder / torques, trajectory)
    return 0


def _table(trajectory: Trajectory) -> str:
    """A table of the torques at both ends and their extremes, N·m, a line for each motor."""
    tau = trajectory(trajectory.instants(1001)).tau
    lines = [f"{'torque (N·m)':<14}{'at start':>10}{'at goal':>10}{'least':>10}{'most':>10}"]
    for k in range(3):
        values = (tau[0, k], tau[-1, k], tau[:, k].min(), tau[:, k].max())
        lines.append(f"motor {k + 1:<8}" + "".join(f" {value:>9.4f}" for value in values))
    return "\n".join(lines)


def _against_limits(scene: Scene, trajectory: Trajectory) -> str:
    """Lines that say how near the motion comes to each limit, and when."""
    steps = np.linspace(0.0, 1.0, 2001)
    lines = []
    for curves in limit_curves(problem_of(scene), trajectory, steps):
        share = curves.shares
        share = np.where(np.isfinite(curves.lower), np.abs(share), share)
        instant, row = np.unravel_index(int(np.nanargmax(share)), share.shape)
        which = f" of {curves.limit.subject} {row + 1}" if share.shape[1] > 1 else ""
        bounds = bounds_in_words(curves.lower[[row]], curves.upper[[row]])
        lines.append(
            f"closest to its limit: {curves.limit.name}{which}, {curves.values[instant, row]:.4g} "
            f"{curves.limit.unit} at t = {steps[instant] * trajectory.duration:.4f} s; it may be "
            f"{bounds}"
        )
    return "\n".join(lines)
