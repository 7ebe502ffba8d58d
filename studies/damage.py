"""The verifier's own campaign: good motions, each damaged at random.

Motions of shipped scenes and of random moves of every kind and robot are planned. Each is then
damaged: in one coefficient, one knot, one number of its scene, in its order, or by a spike of a
width from a nanosecond on. Whether a damage is beyond what verification allows is decided by a
measure of this study's own: dense samples of every piece, with torques of another formulation. It
sees no more than samples show, so that a damage which it finds is one; near a bound, within a
factor, either answer is right.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import comb
from typing import Any

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.motion.trajectory import Trajectory, goal_of
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath
from deltaopt.verify.bounds import BOUNDS
from studies.bench.hard_moves import move
from studies.kept_rows import kept_rows
from studies.problems import PROBLEMS, add_directory, shipped_scenes

HELP = "damage good motions at random: does verification find all that is beyond its bounds?"
SMALL = {"number": 6}


_FRACTIONS = np.sort(np.append(np.linspace(0, 1, 120), (1 - np.cos(np.linspace(0, np.pi, 81))) / 2))
"""Of every piece, where a damaged motion is looked at."""
_EITHER = 3.0
"""Within this factor of a bound either answer is right: sums and norms are taken differently."""
_EXCESS = 1e-9
"""Of a limit: what verification allows."""
_TRIES = 30
"""Of random numbers of a scene, until changing one leaves a scene."""
_PLACES = 4001
"""Of a given path, joined by straight lines, from which a motion's distance is taken."""
_LOOP = deltaopt.Corners(points=((0.88, 0.1, 0.0), (0.88, 0.1, 0.1), (0.88, 0.0, 0.1)), blend=0.01)
"""Of a path that comes back to where it was at a right angle, m."""
_SHIPPED = 3
"""Every third motion is that of a shipped scene, the others are of random moves."""


@dataclass(frozen=True)
class Damaged:
    """A good motion and what verification said of it damaged.

    ``verdict``: "found", "harmless" (and verified), "missed", "refused" (though nothing was found
    to be beyond a bound), "near" a bound, "no plan". ``ratio``: the largest measure of this study's
    own, as a multiple of its bound.
    """

    number: int
    kind: str
    damage: str
    verdict: str
    ratio: float
    said: str


def case(number: int, first: int) -> tuple[str, Scene]:
    """The kind and the scene of a motion."""
    if number % _SHIPPED == 0:
        scenes = _shipped()
        return scenes[number // _SHIPPED % len(scenes)]
    found = move(first, number)
    return found.stratum, found.scene


@cache
def _shipped() -> list[tuple[str, Scene]]:
    """Of all folders, and one whose path crosses itself."""
    scenes = [(file.parent.name, deltaopt.load_scene(file)) for file in shipped_scenes()]
    given = deltaopt.load_scene(PROBLEMS / "paths" / "industrial_25_305_25.yaml")
    changes = {"start": (0.88, -0.1, 0.0), "goal": (0.88, 0.0, -0.1), "path": _LOOP}
    return [*scenes, ("crossing", given.model_copy(update=changes))]


Damage = Callable[[Scene, Trajectory, np.random.Generator], tuple[Scene, Trajectory]]


def _coefficient(
    scene: Scene, good: Trajectory, rng: np.random.Generator
) -> tuple[Scene, Trajectory]:
    """One coefficient by a share of the way, in the units of its piece."""
    position = good.position
    coefficients = position.coefficients.copy()
    place = tuple(int(each) for each in rng.integers(coefficients.shape))
    h = float(np.diff(position.knots)[place[0]])
    coefficients[place] += good.extent * _size(rng, -16, 0) / h ** place[1]
    return scene, replace(good, position=replace(position, coefficients=coefficients))


def _knot(scene: Scene, good: Trajectory, rng: np.random.Generator) -> tuple[Scene, Trajectory]:
    """One knot by a share of the interval before it."""
    knots = good.knots.copy()
    k = int(rng.integers(1, len(knots)))
    knots[k] += (knots[k] - knots[k - 1]) * _size(rng, -14, 0)
    return scene, replace(good, position=replace(good.position, knots=knots))


def _number(scene: Scene, good: Trajectory, rng: np.random.Generator) -> tuple[Scene, Trajectory]:
    """One number of the scene or its robot by a share of it."""
    for _ in range(_TRIES):
        content = scene.model_dump(exclude_none=True)
        numbers = list(_numbers(content))
        holder, key = numbers[int(rng.integers(len(numbers)))]
        change = 1 + _size(rng, -12, 0)
        if isinstance(holder[key], tuple):
            values = list(holder[key])
            values[int(rng.integers(len(values)))] *= change
            holder[key] = tuple(values)
        else:
            holder[key] *= change
        try:
            return Scene.model_validate(content), good
        except deltaopt.DeltaOptError:
            continue
    return scene, good


def _numbers(content: Any) -> Any:
    """Where the numbers of a mapping are: what holds them, and under which key."""
    for key, value in content.items() if isinstance(content, dict) else ():
        is_vector = isinstance(value, tuple) and all(isinstance(each, float) for each in value)
        if isinstance(value, float) or (is_vector and value):
            yield content, key
        elif isinstance(value, dict):
            yield from _numbers(value)
        elif isinstance(value, tuple | list):
            for each in value:
                yield from _numbers(each)


def _order(scene: Scene, good: Trajectory, rng: np.random.Generator) -> tuple[Scene, Trajectory]:
    """Two pieces exchanged, the motion backwards, or start and goal of the scene exchanged."""
    position, number = good.position, len(good.position.coefficients)
    which = int(rng.integers(3))
    if which == 0 and isinstance(scene.goal, tuple) and isinstance(scene.start, tuple):
        return scene.model_copy(update={"start": scene.goal, "goal": scene.start}), good
    order = np.arange(number)
    if which == 1:
        order = order[::-1]
    else:
        one, other = rng.integers(number, size=2)
        order[[one, other]] = order[[other, one]]
    knots = np.append(0.0, np.cumsum(np.diff(position.knots)[order]))
    changed = PiecewisePolynomial(knots, position.coefficients[order])
    return scene, replace(good, position=changed)


def _spike(scene: Scene, good: Trajectory, rng: np.random.Generator) -> tuple[Scene, Trajectory]:
    """A bump u⁴ (1 - u)⁴ of any width from a nanosecond on, in a piece cut about it."""
    position = good.position
    lengths = np.diff(position.knots)
    piece = int(rng.choice(len(lengths), p=lengths / lengths.sum()))
    width = float(min(10 ** rng.uniform(-9, -2), lengths[piece] / 2))
    begin = float(position.knots[piece] + rng.uniform(0.1, 0.4) * lengths[piece])
    along = rng.normal(size=3)
    acceleration = _size(rng, -6, 2) * good.extent / good.duration**2
    height = acceleration * width**2 / 40 * along / np.linalg.norm(along)
    after, rest = position.after(begin - position.knots[0]), position.after(begin + width)
    powers = position.coefficients.shape[1]
    middle = np.zeros((1, max(9, powers), 3))
    middle[:, :powers] = after.coefficients[:1]
    for j in range(5):
        middle[0, 4 + j] += 256 * comb(4, j) * (-1.0) ** j / width ** (4 + j) * height
    before = PiecewisePolynomial(
        np.append(position.knots[: piece + 1], begin), position.coefficients[: piece + 1]
    )
    spike = PiecewisePolynomial(np.array([0.0, width]), middle)
    return scene, replace(good, position=before.then(spike).then(rest))


DAMAGES: dict[str, Damage] = {
    "coefficient": _coefficient,
    "knot": _knot,
    "scene": _number,
    "order": _order,
    "spike": _spike,
}


def _size(rng: np.random.Generator, least: float, most: float) -> float:
    """A number of either sign between these powers of ten."""
    return float(rng.choice([-1, 1]) * 10 ** rng.uniform(least, most))


def ratios(scene: Scene, bad: Trajectory) -> dict[str, float]:
    """What dense samples show, as multiples of what verification allows, by measure; infinite
    where the robot cannot follow."""
    try:
        found = _excesses(scene, bad)
        model = DeltaModel(as_delta(scene.robot), scene.payload, deltaopt.virtual_work)
        x, v, a = bad.path_inside(_FRACTIONS)
        reported = bad.model.inverse_dynamics(x, v, a)
        modelled = model.inverse_dynamics(x, v, a)
    except (deltaopt.Unreachable, deltaopt.DeltaOptError):
        return {"reach": np.inf}
    sizes = _arm(scene), _way(scene, bad), bad.duration, np.inf
    allowed = {bound.measure: bound.of(*sizes).at_most for bound in BOUNDS}
    task, goal = scene.task, goal_of(problem_of(scene), bad)
    ends = np.array([bad.position.at(bad.knots[[0]])[0], bad.position.at(bad.knots[[-1]])[0]])
    jumps = bad.path_inside([0.0, 1.0])
    at_jumps = [np.linalg.norm(each[2::2] - each[1:-1:2], axis=1).sum() for each in jumps[:2]]
    measures = {
        "start_distance": np.linalg.norm(ends[0] - task.start.position),
        "goal_distance": np.linalg.norm(ends[1] - goal.position),
        "start_speed": np.linalg.norm(jumps[1][0] - task.start.velocity),
        "goal_speed": np.linalg.norm(jumps[1][-1] - goal.velocity),
        "position_jump": at_jumps[0],
        "velocity_jump": at_jumps[1],
    }
    if isinstance(task, OnPath):
        measures["path_distance"] = _off_path(task, x)
    given = scene.objective.given_duration
    if given is not None:
        measures["duration_error"] = abs(bad.duration - given)
    found |= {name: float(value) / allowed[name] for name, value in measures.items()}
    by_torque = np.abs(reported - modelled).max() / np.abs(modelled).max()
    return found | {"torques": float(by_torque) / 1e-9}


def _excesses(scene: Scene, bad: Trajectory) -> dict[str, float]:
    """Of the limits, also with the least payload."""
    found = dict[str, float]()
    scenes = [scene] if scene.least_payload is None else [scene, scene.with_least_payload]
    for each in scenes:
        for curves in limit_curves(problem_of(each), bad, _FRACTIONS):
            with np.errstate(invalid="ignore"):
                both = np.isfinite(curves.lower) & np.isfinite(curves.upper)
                half = (curves.upper - curves.lower) / 2
                scale = np.where(both, half, np.fmax(np.abs(curves.upper), 1e-3))
            scale = np.where(np.isfinite(scale), scale, 1.0)
            beyond = np.fmax(curves.values - curves.upper, curves.lower - curves.values) / scale
            name = curves.limit.name
            found[name] = max(found.get(name, -np.inf), float(beyond.max()) / _EXCESS)
    return found


def _off_path(task: OnPath, x: Array) -> float:
    """The largest distance of places from a path of straight lines, less what these are off it."""
    begin, end = task.path.knots[[0, -1]].tolist()
    s = np.linspace(begin, end, _PLACES)
    p, middles = task.path(s), task.path((s[1:] + s[:-1]) / 2)
    chord = np.linalg.norm((p[1:] + p[:-1]) / 2 - middles, axis=1).max()
    ways = np.diff(p, axis=0)
    worst = 0.0
    for place in x[:: max(1, len(x) // 2000)]:
        share = ((place - p[:-1]) * ways).sum(axis=1) / np.maximum((ways**2).sum(axis=1), 1e-300)
        near = p[:-1] + np.clip(share, 0, 1)[:, None] * ways
        worst = max(worst, float(np.linalg.norm(place - near, axis=1).min()))
    return max(0.0, worst - 2 * float(chord))


def _way(scene: Scene, bad: Trajectory) -> float:
    return float(
        np.linalg.norm(
            goal_of(problem_of(scene), bad).position - np.array(scene.task.start.position)
        )
    )


def _arm(scene: Scene) -> float:
    return float(as_delta(scene.robot).upper_arm.length)


def damaged(number: int, first: int) -> Damaged:
    """Plan a motion, damage it, and compare verification with what samples show."""
    kind, scene = case(number, first)
    name = list(DAMAGES)[number % len(DAMAGES)]
    rng = np.random.default_rng([first, number, 1])
    try:
        good = deltaopt.plan(scene)
    except deltaopt.DeltaOptError as error:
        return Damaged(number, kind, name, "no plan", 0.0, type(error).__name__)
    sound = deltaopt.verify(good.scene, good.trajectory)
    if not sound.ok:
        return Damaged(number, kind, "none", "refused", 0.0, "; ".join(sound.failures()))
    other, bad = DAMAGES[name](good.scene, good.trajectory, rng)
    report = deltaopt.verify(other, bad)
    shown = ratios(other, bad)
    worst = max(shown, key=lambda key: shown[key])
    ratio = shown[worst]
    verdict = _verdict(report.ok, ratio)
    said = worst if report.ok else f"{worst}; {report.failures()[0]}"
    return Damaged(number, kind, name, verdict, ratio, said)


def _verdict(is_ok: bool, ratio: float) -> str:
    if 1 / _EITHER < ratio < _EITHER:
        return "near"
    if ratio >= _EITHER:
        return "missed" if is_ok else "found"
    return "harmless" if is_ok else "refused"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=1000, help="of motions")
    parser.add_argument("--seed", type=seed, default=1, help="of moves and damages (default: 1)")
    add_directory(parser, "damage", "one CSV file with a row for each motion")


def run(arguments: argparse.Namespace) -> int:
    """Print how many damages of each kind were found, and every one that was not."""
    number, first = arguments.number, arguments.seed
    rows = kept_rows(
        arguments.directory / f"damage_{first}.csv",
        Damaged,
        range(number),
        lambda row: row.number,
        lambda i: damaged(i, first),
        ProgressBar().counting(number, "damaged"),
    )
    verdicts = ("found", "harmless", "near", "missed", "refused", "no plan")
    print(f"{'damage':12s}" + "".join(f"{each:>10s}" for each in verdicts))
    for name in ("none", *DAMAGES):
        counts = Counter(row.verdict for row in rows if row.damage == name)
        print(f"{name:12s}" + "".join(f"{counts[each]:10d}" for each in verdicts))
    total = Counter(row.verdict for row in rows)
    beyond = total["found"] + total["missed"]
    print(f"{total['found']} of {beyond} damages beyond a bound are found")
    wrong = [row for row in rows if row.verdict in ("missed", "refused")]
    for row in wrong:
        print(
            f"  {row.number} ({row.kind}, {row.damage}): {row.verdict}, {row.ratio:.2g}: {row.said}"
        )
    return 1 if any(row.verdict == "missed" or row.damage == "none" for row in wrong) else 0
