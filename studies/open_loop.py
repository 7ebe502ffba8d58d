"""Where the platform arrives if a plan's torques are played without feedback, and something is off.

Torques of every motor by up to 1 %, the payload by 5 %, or the torques as a table of 1 ms: the
forward dynamics of the robot under them, by Runge and Kutta's method of order 4, from the start at
rest. Not what a controller does, which corrects; it says how much there is to correct.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.cli.arguments import load_fastest, one_or_more, seed
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points
from studies.problems import PICK_AND_PLACE, PROBLEMS
from studies.text_table import paragraph, table

HELP = "where a plan's torques lead without feedback: torque, payload or table a little off"
SCENES = tuple(
    PROBLEMS / f"{name}.yaml"
    for name in ("pick_and_place", "light_and_fast", "industrial_cross", "long_diagonal")
)
SMALL = {"scenes": (PICK_AND_PLACE,), "number": 3, "steps": 400}
TORQUE, PAYLOAD, TABLE = 0.01, 0.05, 1e-3
"""Relative, relative, and s."""


@dataclass(frozen=True)
class Arrival:
    """What was off, and how far from the goal (m) and how fast (m/s) the platform is at the end of
    the planned time, for every variant; NaN where it cannot be there."""

    scene: str
    off: str
    distances: Array
    speeds: Array
    way: float


def torques(trajectory: Trajectory, t: Array) -> Array:
    """Return the plan's torques at times, (N, 3), N·m."""
    return np.asarray(trajectory(t).tau)


def follow(
    model: DeltaModel,
    trajectory: Trajectory,
    law: Callable[[Array], Array],
    steps: int,
) -> tuple[Array, Array]:
    """Return place (P, 3) and speed (P, 3) at the end, under ``law``: times (N,) -> (N, P, 3).

    At least ``steps`` steps, none across a knot, where torques may jump.
    """
    start, end = trajectory.knots[0], trajectory.knots[-1]
    grid = np.unique(np.concatenate([trajectory.knots, np.linspace(start, end, steps + 1)]))
    grid = grid[np.concatenate([[True], np.diff(grid) > 1e-12])]
    inside = 1e-9 * (end - start)  # torques after a jump at a step's start, before one at its end
    tau = [law(t) for t in (grid[:-1] + inside, (grid[:-1] + grid[1:]) / 2, grid[1:] - inside)]
    variants = tau[0].shape[1]
    x = np.tile(trajectory(start).x[0], (variants, 1))
    v = np.zeros_like(x)
    for k, h in enumerate(np.diff(grid)):
        a1 = model.forward_dynamics(x, v, tau[0][k])
        v2 = v + h / 2 * a1
        a2 = model.forward_dynamics(x + h / 2 * v, v2, tau[1][k])
        v3 = v + h / 2 * a2
        a3 = model.forward_dynamics(x + h / 2 * v2, v3, tau[1][k])
        v4 = v + h * a3
        a4 = model.forward_dynamics(x + h * v3, v4, tau[2][k])
        x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, v


def measure(
    progress: Callable[[float, str], None],
    scenes: tuple[Path, ...],
    number: int,
    first: int,
    steps: int,
) -> list[Arrival]:
    """Follow the plans of scenes; ``number`` random errors of the torques, seeded."""
    found = []
    for i, file in enumerate(scenes):
        progress(i / len(scenes), file.stem)
        found += _of(file.stem, load_fastest(file), number, first, steps)
    progress(1.0, "done")
    return found


def _of(name: str, scene: Scene, number: int, first: int, steps: int) -> list[Arrival]:
    trajectory = deltaopt.plan(scene).trajectory
    start, goal = given_points(scene.task)
    model = delta_model(scene.robot, scene.payload)
    way = float(np.linalg.norm(np.subtract(goal, start)))
    random = np.random.default_rng(first)
    scales = 1 + random.uniform(-TORQUE, TORQUE, (number, 3))

    def exact(t: Array) -> Array:
        return torques(trajectory, t)[:, None]

    cases = [
        ("nothing", model, exact),
        (f"torques by up to {TORQUE:.0%}", model, lambda t: exact(t) * scales),
        (f"table of {1e3 * TABLE:g} ms, linear between", model, _table(trajectory, linear=True)),
        (f"table of {1e3 * TABLE:g} ms, held", model, _table(trajectory, linear=False)),
    ]
    if scene.payload:
        other = (delta_model(scene.robot, scene.payload * k) for k in (1 + PAYLOAD, 1 - PAYLOAD))
        heavier, lighter = other
        cases.insert(2, (f"payload {PAYLOAD:.0%} heavier", heavier, exact))
        cases.insert(3, (f"payload {PAYLOAD:.0%} lighter", lighter, exact))
    found = []
    for off, robot, law in cases:
        x, v = follow(robot, trajectory, law, steps)
        distances = np.linalg.norm(x - np.asarray(goal), axis=1)
        found.append(Arrival(name, off, distances, np.linalg.norm(v, axis=1), way))
    return found


def _table(trajectory: Trajectory, *, linear: bool) -> Callable[[Array], Array]:
    """The torques sampled every ``TABLE`` seconds, linear between or held."""
    start = trajectory.knots[0]
    count = int(np.ceil(trajectory.duration / TABLE)) + 1
    times = start + TABLE * np.arange(count)
    rows = torques(trajectory, np.minimum(times, trajectory.knots[-1]))

    def law(t: Array) -> Array:
        if linear:
            columns = [np.interp(t, times, rows[:, k]) for k in range(3)]
            return np.column_stack(columns)[:, None]
        return np.asarray(rows[np.floor((t - start) / TABLE + 1e-9).astype(int)][:, None])

    return law


def report(found: list[Arrival]) -> str:
    """Return all arrivals and what they say."""
    rows = [
        ("scene", "off", "variants", "from the goal, mm", "largest", "of the way", "speed, m/s")
    ]
    rows += [
        (
            a.scene,
            a.off,
            str(a.distances.size),
            f"{1e3 * np.median(a.distances):.3g}",
            f"{1e3 * a.distances.max():.3g}",
            f"{a.distances.max() / a.way:.1%}",
            f"{a.speeds.max():.2g}",
        )
        for a in found
    ]
    told = []
    for off in dict.fromkeys(a.off for a in found):
        own = [a for a in found if a.off == off]
        worst = max(own, key=lambda a: float(a.distances.max() / a.way))
        told.append(
            f"{off}: up to {1e3 * worst.distances.max():.2g} mm,"
            f" {worst.distances.max() / worst.way:.1%} of the way ({worst.scene})"
        )
    return f"{table(rows)}\n\n" + paragraph(
        "Off, and how far from the goal: ", "; ".join(told) + "."
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=20, help="random errors (20)")
    parser.add_argument("--seed", type=seed, default=1, help="of them (1)")
    parser.add_argument("--steps", type=one_or_more, default=2000, help="of integration (2000)")
    parser.set_defaults(scenes=SCENES)


def run(arguments: argparse.Namespace) -> int:
    a = arguments
    print(report(measure(ProgressBar(), a.scenes, a.number, a.seed, a.steps)))
    return 0
