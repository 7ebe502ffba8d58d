"""The straight line timed optimally, beside the quintic law on it and the free path.

On a given path there is one coordinate left: with b = ṡ² the torques are affine in b and b′, speeds
are bounds of b, and the duration ∫ ds / √b is convex (Verscheure et al. 2009). The nonlinear
program on a uniform grid in s is solved by Ipopt; torques hold at both ends of every cell.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt.bench.random_scenes import random_scenes
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import limits_of
from studies.problems import PICK_AND_PLACE

Array = NDArray[np.float64]
HELP = "the straight line timed optimally, beside the quintic law and the free path"
SMALL = {"scenes": (PICK_AND_PLACE,), "cells": 100}


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


def timed_line(scene: deltaopt.Scene, cells: int) -> float:
    """The shortest duration on the straight line, s, on a grid of so many cells."""
    model = delta_model(scene.robot, scene.payload)
    s, way = np.linspace(0.0, 1.0, cells + 1), np.subtract(scene.goal, scene.start)
    x, rest = scene.start + np.outer(s, way), np.zeros((cells + 1, 3))
    ways = np.tile(way, (cells + 1, 1))
    g = model.inverse_dynamics(x, rest, rest)
    by_u = model.inverse_dynamics(x, rest, ways) - g
    by_b = model.inverse_dynamics(x, ways, rest) - g
    torque = limits_of(scene).upper("torque")
    assert torque is not None, "a robot's drives have a torque limit"
    opti, most = ca.Opti(), _fastest(scene, model, x, ways)
    scale = float(np.sum(torque) / np.abs(by_u).max())
    b = scale * opti.variable(cells + 1)
    u = (b[1:] - b[:-1]) * cells / 2
    for first in (0, 1):
        rows = slice(first, cells + first)
        for k in range(3):
            tau = by_u[rows, k] * u + by_b[rows, k] * b[rows] + g[rows, k]
            opti.subject_to(opti.bounded(-1, tau / torque[k], 1))
    opti.subject_to(opti.bounded(1e-9, b[1:-1] / scale, most[1:-1] / scale))
    opti.subject_to(b[0] == 0)
    opti.subject_to(b[-1] == 0)
    roots = ca.sqrt(b[1:-1])
    T = 2 / cells * (1 / roots[0] + 1 / roots[-1] + ca.sum1(1 / (roots[1:] + roots[:-1])))
    opti.minimize(T)
    opti.set_initial(opti.x, np.maximum(0.1 * s * (1 - s), 1e-6))
    opti.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    return float(opti.solve().value(T))


def _fastest(scene: deltaopt.Scene, model: deltaopt.DeltaModel, x: Array, ways: Array) -> Array:
    """The largest ṡ² that the speed limits of the motors allow at each point, 1/s²."""
    limits = limits_of(scene).upper("speed")
    if limits is None:
        return np.full(len(x), 1e12)
    rates = model.motion(x, ways, np.zeros_like(ways))[1][:, 3::3]
    return np.asarray(((limits / np.maximum(np.abs(rates), 1e-9)) ** 2).min(axis=1))


def durations(scene: deltaopt.Scene, cells: int) -> Durations:
    """The three durations of a scene."""
    free = deltaopt.plan(scene, tolerance=1e-3).duration
    return Durations(deltaopt.baseline(scene).duration, timed_line(scene, cells), free)


def over_random_moves(
    robot: deltaopt.Robot, number: int, cells: int, seed: int
) -> tuple[Array, int]:
    """How much of the timed line's duration the free path saves, over random moves with 1 kg whose
    line can be driven, as fractions; and of how many moves it cannot."""
    saved: list[float] = []
    blocked = 0
    for scene in random_scenes(robot, 1.0, number, seed):
        try:
            found = durations(scene, cells)
        except (deltaopt.DeltaOptError, RuntimeError):  # the line leaves the workspace, or is too
            blocked += 1  # heavy to be held on it
            continue
        saved.append(1 - found.free / found.timed)
    return np.array(saved), blocked


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", type=Path, metavar="SCENE", help="scene files")
    parser.add_argument("--cells", type=int, default=800, help="of the grid (default: 800)")
    parser.add_argument(
        "--robots", nargs="*", type=Path, default=(), metavar="ROBOT", help="for random moves"
    )
    parser.add_argument("--number", type=int, default=50, help="random moves (default: 50)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")


def run(arguments: argparse.Namespace) -> int:
    """Print one line for each scene, and one for each robot."""
    for file in arguments.scenes:
        found = durations(deltaopt.load_scene(file), arguments.cells)
        print(f"{file.stem}: {found}", flush=True)
    for file in arguments.robots:
        robot = deltaopt.load_robot(file)
        saved, blocked = over_random_moves(robot, arguments.number, arguments.cells, arguments.seed)
        print(
            f"{file.stem}: over {len(saved)} random moves the free path takes "
            f"{np.median(saved):.1%} less than the line timed optimally (median; "
            f"{saved.min():.1%} to {saved.max():.1%}); {blocked} lines cannot be driven",
            flush=True,
        )
    return 0
