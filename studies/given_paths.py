"""Given paths: deltaopt beside TOPP-RA on random paths.

Both are given the same compiled coefficients of the same path, TOPP-RA at both ends of each of its
intervals. A motion of TOPP-RA has constant s̈
between points of its grid; like ours it is slowed until it keeps every limit between them too, so
that durations can be compared. The reference is ours to 1e-4, about 1e-5 off as a rule. TOPP-RA's
grid is the coarsest of some whose motion is then within the tolerance of the reference, which is
known here and nowhere else; and, for comparison, the coarsest whose duration is within it as it
stands, whatever limits it exceeds between points. Its time is that of its solver alone on that
grid; ours is given for the sweeps on all meshes, and for the whole plan.

With --work, the same for one scene on all grids and at several tolerances of ours. Where the path
is a straight line and torques alone are limited the reference is one that knows no mesh: the
largest acceleration and the largest deceleration, integrated to 12 digits, with their switch
resolved. Otherwise it is our plan to 1e-7. The work that is counted is intervals swept, on all
meshes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError, installed
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.planning.path.path_mesh import MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import PathRows
from deltaopt.planning.path.sweep import Speeds
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.task import OnPath
from studies.bench.random_scenes import random_scenes
from studies.problems import ORSINO, add_robots
from studies.timed import timed
from tests.oracles.path_arcs import two_arcs

HELP = "given paths: beside TOPP-RA on random paths"
SMALL = {"robots": (ORSINO,), "number": 2, "grids": (50, 100)}
_REFERENCE = 1e-4
_FINEST, _TOLERANCES = 1e-7, (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
_NONE, _MOST = 1e-13, 1e4
"""Of coefficients, below which they are none; of b, m²/s², where TOPP-RA's solver wants a bound."""
_BLENDS = (0.1, 0.5)
"""Of the longest possible blends, where those of random paths are drawn from."""


@dataclass(frozen=True)
class Outcome:
    """Of one path: gap to the reference and processor seconds of the solver; of ours, those of the
    whole plan too. ``intervals``: of the last mesh or grid; ``swept``: of all. Not a number where
    there was no motion."""

    gap: float
    solver: float
    plan: float
    intervals: int
    swept: int

    @classmethod
    def none(cls) -> Outcome:
        return cls(np.nan, np.nan, np.nan, 0, 0)


def random_paths(
    robot: deltaopt.Robot, payload: float | None, number: int, seed: int
) -> Iterator[deltaopt.Scene]:
    """Random moves on lines, through corners and on pick-and-place paths by turns, of which some
    lead out of the workspace."""
    rng = np.random.default_rng(seed)
    for i, scene in enumerate(random_scenes(robot, payload, number, seed)):
        start, goal = np.array(scene.start), np.array(scene.goal)
        way = float(np.linalg.norm(goal - start))
        path: deltaopt.Line | deltaopt.Corners | deltaopt.PickAndPlace = deltaopt.Line()
        if i % 3 == 1:
            shares = np.sort(rng.uniform(0.15, 0.85, size=rng.integers(1, 4)))
            points = start + shares[:, None] * (goal - start)
            points += 0.2 * way * rng.uniform(-1, 1, size=points.shape)
            shortest = np.linalg.norm(np.diff([start, *points, goal], axis=0), axis=1).min()
            blend = float(rng.uniform(*_BLENDS) * shortest)
            path = deltaopt.Corners.model_validate({"points": points.tolist(), "blend": blend})
        elif i % 3 == 2:
            height = float(rng.uniform(0.05, 0.3) * way)
            across = float(np.linalg.norm((goal - start)[1:]))
            blend = float(rng.uniform(*_BLENDS) * min(height, across))
            path = deltaopt.PickAndPlace(height=height, blend=blend)
        yield scene.model_copy(update={"path": path})


def ours(scene: deltaopt.Scene, best: float, tolerance: float) -> Outcome:
    """Our plan, the quickest of five, and on each mesh the quickest sweep: its time is wall time,
    which others disturb."""
    planner = deltaopt.Planner(scene.robot, scene.payload, scene.limits, tolerance)
    sweeps, seconds = [], []
    for _ in range(5):
        begin = process_time()
        try:
            plan = planner.plan_scene(scene)
        except DeltaOptError:
            return Outcome.none()
        seconds.append(process_time() - begin)
        sweeps.append([each.spent.algebra for each in plan.meshes])
    swept = sum(each.intervals for each in plan.meshes)
    quickest = float(np.min(sweeps, axis=0).sum())
    return Outcome(plan.duration / best - 1, quickest, min(seconds), plan.intervals, swept)


def toppra_motion(scene: deltaopt.Scene, mesh: PathMesh) -> tuple[MeshMotion | None, float]:
    """TOPP-RA's motion on a grid, None where it finds none, and the seconds of its solver."""
    toppra = installed("toppra", "bench")
    toppra.setup_logging("ERROR")
    base: Any = toppra.constraint.LinearConstraint
    rows = PathRows.of(scene)
    ends = mesh.ends
    n = len(ends.x)
    found = rows.tangents(ends, (np.ones(n), np.zeros(n)), (np.ones(n), np.zeros(n)))
    alpha, beta, rest = found.alpha, found.beta, 1 - found.high
    of_speed = np.abs(alpha).max(axis=0) < _NONE  # rows that bound b alone, which it takes apart
    with np.errstate(divide="ignore"):
        most = ((1 - rest) / np.abs(beta))[:, of_speed].min(axis=1, initial=_MOST)
    most = np.minimum(np.append(most[::2], np.inf), np.append(np.inf, most[1::2]))
    alpha, beta, rest = (each[:, np.logical_not(of_speed)] for each in (alpha, beta, rest))
    alpha[1::2] += 2 * mesh.h[:, None] * beta[1::2]  # where an interval ends, of its b and u
    alpha, beta, rest = (
        np.vstack([np.hstack([each[::2], each[1::2]]), np.tile(each[-1], 2)])
        for each in (alpha, beta, rest)
    )
    m = alpha.shape[1]

    class Limits(base):  # type: ignore[misc]
        def compute_constraint_params(self, path: Any, gridpoints: Array) -> Any:
            F, g = np.vstack([np.eye(m), -np.eye(m)]), np.ones(2 * m)
            bounds = np.column_stack([np.zeros(len(gridpoints)), most])
            return alpha, beta, rest, F, g, None, bounds

    class Grid:
        dof = 3
        path_interval = mesh.nodes[[0, -1]]

    limits = Limits()
    limits.identical = True
    algorithm = toppra.algorithm.TOPPRA(
        [limits], Grid(), gridpoints=mesh.nodes, solver_wrapper="seidel"
    )
    (_, rates, *_), seconds = timed(lambda: algorithm.compute_parameterization(0.0, 0.0))
    if rates is None or not np.isfinite(rates).all():
        return None, seconds
    b = np.asarray(rates, dtype=float) ** 2
    u = np.repeat(np.diff(b) / (2 * mesh.h), 2).reshape(-1, 2)
    return MeshMotion.of(mesh, Speeds(b, u)), seconds


def toppra_outcomes(
    scene: deltaopt.Scene, task: OnPath, best: float, tolerance: float, grids: tuple[int, ...]
) -> tuple[Outcome, Outcome]:
    """TOPP-RA on the coarsest of some grids whose motion is within the tolerance, slowed and as it
    stands; on the finest if none is."""
    slowed = standing = Outcome.none()
    model = delta_model(scene.robot, scene.payload)
    for number in grids:
        begin, end = task.path.knots[[0, -1]].tolist()
        mesh = PathMesh.of(task.path, np.linspace(begin, end, number + 1))
        motion, seconds = toppra_motion(scene, mesh)
        if motion is None or motion.stops.any():
            continue
        if not standing.intervals or abs(standing.gap) > tolerance:
            gap = motion.duration / best - 1
            standing = Outcome(gap, seconds, np.nan, len(mesh.h), len(mesh.h))
        trajectory = deltaopt.Trajectory(motion.position, model)
        safe = trajectory.duration * safe_factor(problem_of(scene), trajectory)
        slowed = Outcome(safe / best - 1, seconds, np.nan, len(mesh.h), len(mesh.h))
        if slowed.gap <= tolerance:
            break
    return slowed, standing


def _reference(scene: deltaopt.Scene) -> float:
    return deltaopt.plan(scene, tolerance=_REFERENCE).duration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robots(parser)
    parser.add_argument("--work", type=Path, metavar="SCENE", help="work and precision on its path")
    parser.add_argument("--number", type=int, default=1000, help="random paths (default: 1000)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")
    parser.add_argument("--tolerance", type=float, default=1e-3, help="default: 1e-3")
    parser.add_argument(
        "--grids",
        type=int,
        nargs="+",
        default=(50, 100, 200, 400, 800, 1600, 3200),
        help="intervals of TOPP-RA's grids (default: 50 to 3200)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print both side by side for every robot, or for one scene. Raises MissingPackage."""
    installed("toppra", "bench")
    if arguments.work:
        found = work_and_precision(deltaopt.load_scene(arguments.work), tuple(arguments.grids))
        print("\n".join(_table(found)))
        return 0
    for file in arguments.robots:
        robot = deltaopt.load_robot(file)
        print(_compared(robot, arguments), flush=True)
    return 0


@dataclass(frozen=True)
class WorkAndPrecision:
    """What accuracy costs on one path. ``reference``: the duration that gaps are to, s;
    ``switched``: whether it knows no mesh. ``own``: ours by tolerance; ``slowed``, ``standing``:
    TOPP-RA's."""

    reference: float
    switched: bool
    own: dict[float, Outcome]
    slowed: list[Outcome]
    standing: list[Outcome]


def work_and_precision(scene: deltaopt.Scene, grids: tuple[int, ...]) -> WorkAndPrecision:
    """On the path of a scene, or its straight line where it has none."""
    if scene.path is None:
        scene = scene.model_copy(update={"path": deltaopt.Line()})
    task = scene.task
    assert isinstance(task, OnPath)
    best = deltaopt.plan(scene, tolerance=_FINEST).duration
    switched = isinstance(scene.path, deltaopt.Line) and [
        limit.name for limit in limits_of(scene).constraints.limits if limit.promised
    ] == ["torque"]
    if switched:
        best = two_arcs(scene, best)
    tolerances = _TOLERANCES if switched else _TOLERANCES[:-1]
    own = {tolerance: ours(scene, best, tolerance) for tolerance in tolerances}
    pairs = [toppra_outcomes(scene, task, best, 0.0, (number,)) for number in grids]
    slowed, standing = (list(each) for each in zip(*pairs, strict=True))
    return WorkAndPrecision(best, switched, own, slowed, standing)


def _table(found: WorkAndPrecision) -> Iterator[str]:
    how = "switch resolved" if found.switched else f"ours to {_FINEST:g}"
    yield f"reference {found.reference:.9f} s, {how}"
    yield "| method | intervals | swept | gap, slowed | gap as it stands | solver | plan |"
    yield "|---|---|---|---|---|---|---|"
    for tolerance, each in found.own.items():
        times = f"{1e3 * each.solver:.2f} ms | {1e3 * each.plan:.1f} ms"
        sizes = f"{each.intervals} | {each.swept}"
        yield f"| ours, {tolerance:g} | {sizes} | {each.gap:.1e} | | {times} |"
    for slowed, standing in zip(found.slowed, found.standing, strict=True):
        gaps = f"{slowed.gap:.1e} | {standing.gap:.1e}"
        sizes = f"{slowed.intervals} | {slowed.swept}"
        yield f"| TOPP-RA | {sizes} | {gaps} | {1e3 * slowed.solver:.2f} ms | |"


def _compared(robot: deltaopt.Robot, arguments: argparse.Namespace) -> str:
    found: list[tuple[Outcome, Outcome, Outcome]] = []
    neither = 0
    for scene in random_paths(robot, 1.0, 4 * arguments.number, arguments.seed):
        if len(found) == arguments.number:
            break
        three = _outcomes(scene, arguments.tolerance, tuple(arguments.grids))
        if three is None:
            neither += 1
        else:
            found.append(three)
    lines = [f"{robot.name}: {len(found)} paths feasible by either, {neither} by neither"]
    own, slowed, standing = (list(each) for each in zip(*found, strict=True))
    for name, outcomes in (
        ("ours", own),
        ("TOPP-RA, slowed", slowed),
        ("TOPP-RA as it stands", standing),
    ):
        lines.append(f"  {name}: {_summary(outcomes, arguments.tolerance)}")
        if outcomes is not own:
            ratios = [b.solver / a.solver for a, b in zip(own, outcomes, strict=True)]
            lines[-1] += f"; solver over our sweeps, median {np.nanmedian(ratios):.1f}"
    return "\n".join(lines)


def _outcomes(
    scene: deltaopt.Scene, tolerance: float, grids: tuple[int, ...]
) -> tuple[Outcome, Outcome, Outcome] | None:
    """Ours and TOPP-RA's, slowed and as it stands; None where neither finds a motion."""
    task = scene.task
    assert isinstance(task, OnPath)
    try:
        best = _reference(scene)
    except DeltaOptError:
        best = np.nan
    try:
        slowed, standing = toppra_outcomes(scene, task, best, tolerance, grids)
    except DeltaOptError:  # the path leaves the workspace
        return None
    own = ours(scene, best, tolerance)
    return (own, slowed, standing) if own.intervals or slowed.intervals else None


def _summary(outcomes: list[Outcome], tolerance: float) -> str:
    there = [each for each in outcomes if each.intervals]
    within = sum(abs(each.gap) <= tolerance for each in there)
    parts = [f"found {len(there)} of {len(outcomes)}, {within} within {tolerance:g}"]
    for name in ("gap", "solver", "plan", "intervals"):
        values = np.array([getattr(each, name) for each in there], dtype=float)
        if np.isfinite(values).any():
            unit, scale = (" ms", 1e3) if name in ("solver", "plan") else ("", 1.0)
            median, most = np.nanpercentile(values, [50, 99]) * scale
            parts.append(f"{name} median {median:.2g}{unit}, 99 % {most:.2g}{unit}")
    return "; ".join(parts)
