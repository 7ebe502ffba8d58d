"""The tilt of the platform, a singularity that models of a level platform do not see.

Three parallelograms keep the platform level. Each takes it one turn, the one about its normal;
where the three normals lie in one plane the platform turns about the axis across that plane,
whatever the motors hold, and beyond it the robot is in another assembly mode. The distance ε is the
volume that the unit normals span: 1 at best, 0 there, negative beyond. Printed are: where this lies
in the workspace of each robot, how near plans of random moves come, and what becomes of torques and
of the forces in the single bars on the way there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path

import casadi as ca
import numpy as np

import deltaopt
from deltaopt.cli.arguments import large_number, one_or_more, seed
from deltaopt.codegen.vectorised import RowFunction, evaluate_rows
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.mechanisms.delta.singularities import parallel_margin, tilt_margin
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from studies.bar_forces import bar_forces
from studies.bench.random_scenes import MARGIN, points_in_workspace, random_scenes
from studies.gap_moves import EDGE
from studies.problems import PROBLEMS, add_directory
from studies.text_table import csv, paragraph, table

HELP = "the tilt of the platform: where it is, how near plans come, what the bars bear"
ROBOTS = tuple(
    PROBLEMS / "robots" / f"{name}.yaml" for name in ("orsino", "industrial", "hornet_565", "rl5")
)
SMALL = {"robots": ROBOTS[:1], "moves": 1, "points": 2000}
PAYLOAD = 1.0
"""kg."""
OTHERS = 0.02
"""Least distance of a place from the singularities that the model of a level platform has: such
places count as its workspace."""
NEAR = 0.1
"""Distance from which on places count as near to tilting."""
DISTANCES = np.geomspace(0.5, 1e-4, 12)
"""ε on the way into it."""
LINES = 500
"""Between random places, of which the one that is clearest of other singularities is taken."""
INSTANTS = 2000
"""Of a motion, at which bars and distances are looked at."""


@dataclass(frozen=True)
class Place:
    """Of the places of a robot that are at least ``OTHERS`` from all other singularities: the share
    beyond the tilt and the share nearer than ``NEAR``; what it is of those at which gravity can be
    held."""

    robot: str
    points: int
    beyond: float
    near: float
    held_beyond: float


@dataclass(frozen=True)
class Passage:
    """A plan: the least distance of its ends and of its motion from tilting, and the largest force
    of a bar over the largest share that a bar of an equally loaded pair would have."""

    robot: str
    stratum: str
    ends: float
    least: float
    force: float
    unequal: float
    verified: bool


@dataclass(frozen=True)
class Approach:
    """At rest with a payload at ``DISTANCES``: largest motor torque (N·m) and largest force of a
    bar (N)."""

    robot: str
    torques: Array
    forces: Array


@dataclass(frozen=True)
class Tilt:
    """All that was found."""

    places: list[Place]
    passages: list[Passage]
    approaches: list[Approach]


def distances(model: DeltaModel, x: Array) -> Array:
    """Return the distances from the parallel singularity and from tilting, N × 2, at places, m."""
    (found,) = _margins()(model.inverse_kinematics(x), parameters=np.zeros(0))
    return np.asarray(found)


@cache
def _margins() -> RowFunction:
    q = ca.SX.sym("q", 12)
    margins = ca.vertcat(parallel_margin(q), tilt_margin(q))
    return RowFunction(ca.Function("margins", [q, ca.SX(0, 1)], [margins]))


def _workspace(model: DeltaModel, number: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Random places of a level platform, (n, 3), and their distances from tilting, (n,)."""
    reach = model.robot.upper_arm.length + model.robot.forearm.length
    x = rng.uniform([0, -reach, -reach], reach, size=(number, 3)) + model.robot.tool_offset
    serial = evaluate_rows(model.functions.serial_distances, x, parameters=model.parameters)[0]
    x = x[(serial > OTHERS**2).all(axis=1)]
    parallel, tilt = distances(model, x).T
    return x[parallel > OTHERS], tilt[parallel > OTHERS]


def place_of(name: str, robot: Robot, number: int, rng: np.random.Generator) -> Place:
    """Look at so many random places in the box about the workspace."""
    model = DeltaModel(robot, PAYLOAD)
    x, tilt = _workspace(model, number, rng)
    rest = np.zeros_like(x)
    share = np.abs(model.inverse_dynamics(x, rest, rest)) / np.array(robot.torque_limits)
    held = (share < 1).all(axis=1)
    return Place(
        name,
        len(x),
        float(np.mean(tilt < 0)),
        float(np.mean(np.abs(tilt) < NEAR)),
        float(np.mean(tilt[held] < 0)),
    )


def scenes(robot: Robot, number: int, first: int) -> Iterator[tuple[str, Scene]]:
    """Random moves with both ends inside, and as many with both at the edge of the workspace."""
    for scene in random_scenes(robot, PAYLOAD, number, first):
        yield "inside", scene
    rng, model = np.random.default_rng(first), DeltaModel(robot, PAYLOAD)
    yield from (("at the edge", scene) for scene in islice(_edge(robot, model, rng), number))


def _edge(robot: Robot, model: DeltaModel, rng: np.random.Generator) -> Iterator[Scene]:
    while True:
        points = points_in_workspace(model, rng, EDGE, MARGIN).tolist()
        for start, goal in zip(points[::2], points[1::2], strict=False):
            scene = Scene(robot=robot, payload=PAYLOAD, start=start, goal=goal)
            try:
                check_feasible(scene)
            except DeltaOptError:
                continue
            yield scene


def passage_of(name: str, stratum: str, scene: Scene) -> Passage | None:
    """Plan a move, and look at its bars; None if there is no plan."""
    try:
        motion = deltaopt.plan(scene).trajectory
    except DeltaOptError:
        return None
    tilt, forces = _along(motion)
    level = np.abs(forces.mean(axis=2)).max()
    return Passage(
        name,
        stratum,
        float(min(tilt[0], tilt[-1])),
        float(tilt.min()),
        float(np.abs(forces).max()),
        float(np.abs(forces).max() / level),
        bool(deltaopt.verify(scene, motion).ok),
    )


def _along(motion: Trajectory) -> tuple[Array, Array]:
    """Distances from tilting, N, and forces of the bars, N × 3 × 2, N, along a motion."""
    instant = motion(np.linspace(0, motion.duration, INSTANTS))
    model = delta_model(motion.model.robot, PAYLOAD)
    tilt = distances(model, instant.x)[:, 1]
    return tilt, bar_forces(model, instant.x, instant.v, instant.a)


def approach_of(name: str, robot: Robot, rng: np.random.Generator) -> Approach:
    """Go through it on a straight line, as far from all other singularities as there is one among
    lines between random places.

    Raises ValueError if none leads through.
    """
    model = DeltaModel(robot, PAYLOAD)
    before, beyond = _line_through(model, rng)
    points = np.array([_at(model, before, beyond, distance) for distance in DISTANCES])
    rest = np.zeros_like(points)
    torques = np.abs(model.inverse_dynamics(points, rest, rest)).max(axis=1)
    forces = np.abs(bar_forces(model, points, rest, rest)).max(axis=(1, 2))
    return Approach(name, torques, forces)


def _line_through(model: DeltaModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """A place at more than the first of ``DISTANCES`` and one beyond the tilt, 3 each, m."""
    x, tilt = _workspace(model, 20_000, rng)
    near, far = x[tilt > DISTANCES[0]], x[tilt < 0]
    number = min(len(near), len(far), LINES)
    pairs = (rng.choice(each, number, replace=False) for each in (near, far))
    before, beyond = np.array(list(pairs))
    lines = before + np.linspace(0, 1, 51)[:, None, None] * (beyond - before)
    points = lines.reshape(-1, 3)
    serial = evaluate_rows(model.functions.serial_distances, points, parameters=model.parameters)[0]
    closes = (serial > OTHERS**2).all(axis=1)
    nearest = np.zeros(len(points))
    parallel = distances(model, points[closes])[:, 0]
    nearest[closes] = np.minimum(np.sqrt(serial[closes].min(axis=1)), parallel)
    clear = nearest.reshape(len(lines), -1).min(axis=0)
    if not clear.max(initial=0.0) > 0:
        raise ValueError(f"{model.robot.name}: no straight line leads through the tilt")
    best = int(np.argmax(clear))
    return before[best], beyond[best]


def _at(model: DeltaModel, before: Array, beyond: Array, distance: float) -> Array:
    """The place on a line at this distance from tilting, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        here = before + middle * (beyond - before)
        low, high = (
            (middle, high) if distances(model, here[None])[0, 1] > distance else (low, middle)
        )
    return before + low * (beyond - before)


def measure(
    progress: Callable[[float, str], None],
    robots: Sequence[Path],
    moves: int,
    points: int,
    first: int,
) -> Tilt:
    """Look at all robots: ``points`` random places, ``moves`` of each kind."""
    places, passages, approaches = [], [], []
    for i, file in enumerate(robots):
        robot, rng = deltaopt.load_robot(file), np.random.default_rng(first)
        places.append(place_of(file.stem, robot, points, rng))
        approaches.append(approach_of(file.stem, robot, rng))
        for k, (stratum, scene) in enumerate(scenes(robot, moves, first)):
            progress((i + k / (2 * moves)) / len(robots), f"{file.stem}, {stratum}")
            passages.append(passage_of(file.stem, stratum, scene))
    progress(1.0, "done")
    return Tilt(places, [p for p in passages if p is not None], approaches)


def table_of(found: Tilt) -> str:
    """Return three tables: where it is, how near plans come, and the way into it."""
    where = [("robot", "places", "beyond", f"nearer than {NEAR:g}", "beyond, of those held")]
    where += [
        (p.robot, f"{p.points:,}", f"{p.beyond:.1%}", f"{p.near:.1%}", f"{p.held_beyond:.1%}")
        for p in found.places
    ]
    head = ("robot", "moves", "plans", "verified", f"nearer than {NEAR:g}", "beyond", "least ε")
    plans = [(*head, "bars unequal: median", "largest", "largest force, N")]
    for robot, stratum in dict.fromkeys((p.robot, p.stratum) for p in found.passages):
        own = [p for p in found.passages if (p.robot, p.stratum) == (robot, stratum)]
        unequal, through = [p.unequal for p in own], any(p.least < 0 for p in own)
        plans.append(
            (
                robot,
                stratum,
                str(len(own)),
                str(sum(p.verified for p in own)),
                str(sum(p.least < NEAR for p in own)),
                str(sum(p.least < 0 for p in own)),
                f"{min(p.least for p in own):.3f}",
                f"{np.median(unequal):.1f}",
                "∞" if through else f"{max(unequal):.0f}",
                "∞" if through else f"{max(p.force for p in own):.0f}",
            )
        )
    ways = [("ε", *(f"{a.robot}: torque, N·m; bar, N" for a in found.approaches))]
    for k, distance in enumerate(DISTANCES):
        pairs = (f"{a.torques[k]:.2f}; {a.forces[k]:.4g}" for a in found.approaches)
        ways.append((f"{distance:.1e}", *pairs))
    return "\n\n".join(table(rows) for rows in (where, plans, ways))


def power(distance: Array, values: Array) -> float:
    """Return the power of ε that values follow near it, from the last three."""
    return float(np.polyfit(np.log(distance[-3:]), np.log(values[-3:]), 1)[0])


def verdict(found: Tilt) -> str:
    """Say what models of a level platform miss."""
    beyond = sum(p.least < 0 for p in found.passages)
    passed = sum(p.least < 0 and p.verified for p in found.passages)
    powers = (
        (a.robot, power(DISTANCES, a.torques), power(DISTANCES, a.forces)) for a in found.approaches
    )
    slopes = "; ".join(f"{r} torque ε^{round(t, 1) + 0:g}, bars ε^{f:.1f}" for r, t, f in powers)
    shares = ", ".join(f"{p.robot} {p.beyond:.1%}" for p in found.places)
    return paragraph(
        f"Of the places that chains and torques allow, beyond the tilt lie: {shares}.",
        f"Of {len(found.passages)} plans {beyond} lead through it; {passed} of these are verified.",
        f"On the way there grow: {slopes}.",
    )


def csv_of(found: Tilt) -> str:
    """Return one line a plan."""
    return csv(
        "robot,stratum,ends,least,force_N,unequal,verified",
        (
            (p.robot, p.stratum, repr(p.ends), repr(p.least), p.force, p.unequal, p.verified)
            for p in found.passages
        ),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--moves", type=one_or_more, default=25, metavar="N", help="of each kind (25)"
    )
    parser.add_argument(
        "--points", type=large_number, default=200_000, metavar="N", help="random places (200000)"
    )
    parser.add_argument("--seed", type=seed, default=1, metavar="N", help="of all (1)")
    add_directory(parser, "tilt")
    parser.set_defaults(robots=ROBOTS)


def run(arguments: argparse.Namespace) -> int:
    from deltaopt.files.atomic_write import atomic_write
    from studies.plots.tilt import draw

    a = arguments
    found = measure(ProgressBar(), a.robots, a.moves, a.points, a.seed)
    print(table_of(found), verdict(found), sep="\n\n")
    with atomic_write(a.directory / "tilt.csv") as temporary:
        temporary.write_text(csv_of(found), encoding="utf-8")
    draw(found, a.directory / "tilt.png")
    return 0
