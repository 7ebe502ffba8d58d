"""The straight line timed optimally, beside the quintic law on it and the free path."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from studies.bench.random_scenes import random_scenes
from studies.problems import PICK_AND_PLACE, add_scenes

SMALL = {"scenes": (PICK_AND_PLACE,)}


@dataclass(frozen=True)
class Durations:
    """Of one scene, s: the line by a quintic law, the line timed optimally, the free path."""

    quintic: float
    timed: float
    free: float

    def __str__(self) -> str:
        return (
            f"line by a quintic law {self.quintic:.4f} s, line timed optimally {self.timed:.4f} s, "
            f"free path {self.free:.4f} s: {1 - self.free / self.quintic:.1%} less than the first, "
            f"{1 - self.free / self.timed:.1%} less than the second"
        )


def durations(scene: deltaopt.Scene) -> Durations:
    """The three durations of a scene."""
    free = deltaopt.plan(scene, tolerance=1e-3).duration
    timed = deltaopt.timed_line(scene, tolerance=1e-4).duration
    return Durations(deltaopt.baseline(scene).duration, timed, free)


def over_random_moves(robot: deltaopt.Robot, number: int, seed: int) -> tuple[Array, int]:
    """How much of the timed line's duration the free path saves, over random moves with 1 kg whose
    line can be driven, as fractions; and of how many moves it cannot."""
    saved: list[float] = []
    blocked = 0
    for scene in random_scenes(robot, 1.0, number, seed):
        try:
            found = durations(scene)
        except deltaopt.DeltaOptError:  # the line leaves the workspace, or is too heavy to be held
            blocked += 1  # on it
            continue
        saved.append(1 - found.free / found.timed)
    return np.array(saved), blocked


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    parser.add_argument(
        "--robots", nargs="*", type=Path, default=(), metavar="ROBOT", help="for random moves"
    )
    parser.add_argument("--number", type=int, default=50, help="random moves (default: 50)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")


def run(arguments: argparse.Namespace) -> int:
    """Print one line for each scene, and one for each robot."""
    for file in arguments.scenes:
        found = durations(deltaopt.load_scene(file))
        print(f"{file.stem}: {found}", flush=True)
    for file in arguments.robots:
        robot = deltaopt.load_robot(file)
        saved, blocked = over_random_moves(robot, arguments.number, arguments.seed)
        print(
            f"{file.stem}: over {len(saved)} random moves the free path takes "
            f"{np.median(saved):.1%} less than the line timed optimally (median; "
            f"{saved.min():.1%} to {saved.max():.1%}); {blocked} lines cannot be driven",
            flush=True,
        )
    return 0
