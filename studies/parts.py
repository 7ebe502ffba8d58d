"""Parts a minute that motors survive: the cycle over the wall by what motors are rated for.

There with 1 kg and back without, 25 mm over a wall and without a pause, as fast as motors allow
whose RMS torque may be a share of their peak: by the planned cycle, and by what a controller
drives, the lowest rounded path that clears the wall, by a trapezoid of speed and timed optimally,
both legs slowed alike until the motors stay as cool.

``--random N`` plans so many random cycles instead, of two to eight legs.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import exp, log
from pathlib import Path
from time import process_time

import numpy as np

import deltaopt
from deltaopt import Cycle, Scene
from deltaopt.curves.halving import bisected_number
from deltaopt.curves.piecewise import Array
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.running_cost import squared_torques
from deltaopt.output.cycle_files import verified
from deltaopt.planning.comparisons import rounded_path_over
from deltaopt.plots.colours import LINE_COLOURS
from deltaopt.plots.style import figure, name_lines, without_box
from deltaopt.robot.model import delta_model
from studies.bench.random_scenes import points_in_workspace
from studies.cycle import DEPTHS, USUAL_DEPTH, by_law, over_wall, sampled_law
from studies.kept_rows import read_rows, rewrite_rows
from studies.problems import INDUSTRIAL, PROBLEMS, add_directory, add_drawn_again

Rate = Callable[[Array], float]
"""Parts a minute by what the RMS of each motor's torque may be, (3,), N·m."""
SHARES = (0.25, 1 / 3, 0.45, 0.6, 0.8, 1.0)
"""Rated torques over peaks; motors of Deltas are rated for a third, about."""
SMALL = {"robots": (INDUSTRIAL,), "shares": (0.45,)}
_ROBOTS = ("hornet_565", "industrial", "industrial_drive", "industrial_limited", "orsino", "rl5")
_RANDOM = ("industrial", "orsino", "rl5", "hornet_565")
_HEAD = """\
| robot | rated / peak | trapezoid | timed | deltaopt | more than first | than second | gap |
|---|---|---|---|---|---|---|---|"""


@dataclass(frozen=True)
class Row:
    """Parts a minute of a robot whose motors are rated for a ``share`` of their peak: by a
    trapezoid, timed optimally and planned; and the plan's gap."""

    robot: str
    share: float
    trapezoid: float
    timed: float
    planned: float
    gap: float

    def __str__(self) -> str:
        rates = " | ".join(f"{each:.1f}" for each in (self.trapezoid, self.timed, self.planned))
        more = " | ".join(
            f"{100 * (self.planned / each - 1):.0f} %" for each in (self.trapezoid, self.timed)
        )
        return f"| {self.robot} | {self.share:.2f} | {rates} | {more} | {100 * self.gap:.2f} % |"


def legs_over_wall(robot: deltaopt.Robot, depth: float) -> tuple[Scene, Scene]:
    """There with 1 kg and back without."""
    there = over_wall(robot, depth)
    changed = {"start": there.goal, "goal": there.start, "payload": None}
    return there, there.model_copy(update=changed)


def on_path(scene: Scene) -> Scene:
    """A scene on the lowest rounded path over its wall."""
    path = rounded_path_over(scene)
    assert path is not None
    return scene.model_copy(update={"path": path})


def rate_of_trapezoids(legs: Sequence[Scene]) -> Rate:
    """Parts a minute where each leg is a trapezoid of speed, slowed."""
    models = [delta_model(leg.robot, leg.payload) for leg in legs]
    laws = [sampled_law(on_path(leg), "trapezoid") for leg in legs]
    fastest = [by_law(on_path(leg), "trapezoid") for leg in legs]

    def squares(slower: float) -> Array:
        found = np.zeros(3)
        for model, (x, v, a), duration in zip(models, laws, fastest, strict=True):
            T = slower * duration
            found += T * np.mean(model.inverse_dynamics(x, v / T, a / T**2) ** 2, axis=0)
        return found

    return lambda rms: _rate(sum(fastest), squares, rms)


def rate_of_timed(legs: Sequence[Scene]) -> Rate:
    """Parts a minute where each leg is timed optimally on its path and slowed."""
    motions = [deltaopt.plan(on_path(leg)).trajectory for leg in legs]

    def squares(slower: float) -> Array:
        each = [squared_torques(motion.slowed(slower)) for motion in motions]
        return np.asarray(np.sum(each, axis=0))

    return lambda rms: _rate(sum(each.duration for each in motions), squares, rms)


def _rate(fastest: float, squares: Callable[[float], Array], rms: Array) -> float:
    """Parts a minute of a cycle that takes ``fastest`` (s) at least, slowed until its ∫ τ² dt, by
    the factor of slowing, are those of RMS torques, (3,), N·m."""

    def is_kept(slower: float) -> bool:
        return bool((squares(slower) <= rms**2 * slower * fastest).all())

    if is_kept(1.0):
        return 60 / fastest
    slower = exp(bisected_number(lambda s: is_kept(exp(s)), 0.0, log(20.0), 25)[1])
    return 60 / (slower * fastest)


def rows(name: str, robot: deltaopt.Robot, shares: Sequence[float]) -> Iterator[Row]:
    """What a robot does by what its motors are rated for."""
    legs = legs_over_wall(robot, DEPTHS.get(name, USUAL_DEPTH))
    others = rate_of_trapezoids(legs), rate_of_timed(legs)
    for share in shares:
        rms = share * np.array(robot.torque_limits)
        a, b, c = rms.tolist()
        found = deltaopt.plan_cycle(Cycle(legs=legs, rms_torque=(a, b, c)))
        report = verified(found)
        assert report.ok, report.failures()
        trapezoid, timed = (rate(rms) for rate in others)
        yield Row(name, share, trapezoid, timed, found.parts_per_minute, found.gap)


def random_cycle(number: int, seed: int) -> Cycle:
    """A cycle of two to eight legs between random points, with and without payload, with dwells, as
    short as the motors allow."""
    rng = np.random.default_rng((seed, number))
    name = _RANDOM[number % len(_RANDOM)]
    robot = deltaopt.load_robot(PROBLEMS / "robots" / f"{name}.yaml")
    count = int(rng.integers(2, 9))
    places = points_in_workspace(delta_model(robot, 1.0), rng)[:count].tolist()
    masses = rng.choice([0.0, 0.5, 1.0], count).tolist()
    legs = [
        Scene(robot=robot, payload=mass or None, start=tuple(start), goal=tuple(goal))
        for start, goal, mass in zip(places, places[1:] + places[:1], masses, strict=True)
    ]
    a, b, c = (rng.uniform(0.25, 0.8) * np.array(robot.torque_limits)).tolist()
    dwells = rng.choice([0.0, 0.03, 0.1], count).tolist()
    return Cycle(legs=tuple(legs), dwells=tuple(dwells), rms_torque=(a, b, c))


def campaign(number: int, seed: int) -> int:
    """Plan random cycles, print what came of them, and return 1 where one was not verified."""
    progress, gaps, times, bad = ProgressBar().counting(number, "cycles"), [], [], 0
    for which in range(number):
        cycle = random_cycle(which, seed)
        try:
            begin = process_time()
            single = [deltaopt.plan(leg) for leg in cycle.legs]
            plain, begin = process_time() - begin, process_time()
            found = deltaopt.plan_cycle(cycle)
            times.append((process_time() - begin) / plain)
            report = verified(found)
            gaps.append(found.gap)
            if not report.ok or found.period < sum(each.duration for each in single):
                bad += 1
                print(f"cycle {which}: {report.failures()}")
        except DeltaOptError as error:
            bad += 1
            print(f"cycle {which}: {type(error).__name__}: {error}")
        progress(which + 1)
    if not gaps:
        return 1
    worst = ", ".join(f"{100 * q:.0f} %: {np.quantile(gaps, q):.1e}" for q in (0.5, 0.9, 1.0))
    took = ", ".join(f"{100 * q:.0f} %: {np.quantile(times, q):.1f}" for q in (0.5, 0.9, 1.0))
    print(f"{number - bad} of {number} cycles planned and verified; gaps at {worst}")
    print(f"processor time over that of single plans of the legs at {took}")
    return int(bad > 0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    files = [PROBLEMS / "robots" / f"{name}.yaml" for name in _ROBOTS]
    parser.add_argument("robots", nargs="*", type=Path, default=files, metavar="ROBOT")
    parser.add_argument("--random", type=int, default=0, metavar="N", help="random cycles instead")
    parser.add_argument("--seed", type=int, default=1, help="of random cycles")
    add_directory(parser, "parts")
    add_drawn_again(parser)
    parser.set_defaults(shares=SHARES)


def run(arguments: argparse.Namespace) -> int:
    if arguments.random:
        return campaign(arguments.random, arguments.seed)
    file = arguments.directory / "parts.csv"
    if not arguments.drawn_again:
        named = [(each.stem, deltaopt.load_robot(each)) for each in arguments.robots]
        found = (row for name, robot in named for row in rows(name, robot, arguments.shares))
        rewrite_rows(file, found)
    told = read_rows(file, Row)
    print(_HEAD, *told, sep="\n")
    draw(told, file.with_suffix(".png"))
    return 0


def draw(found: Sequence[Row], file: Path) -> None:
    """Draw how many more parts a minute plans move than the timed path, by what motors are rated
    for, a line for each robot."""
    with figure(file, 6.2, 3.2, title(found)) as page:
        axes = page.subplots()
        for name, colour in zip(
            dict.fromkeys(row.robot for row in found), LINE_COLOURS, strict=False
        ):
            own = [row for row in found if row.robot == name]
            more = [100 * (row.planned / row.timed - 1) for row in own]
            axes.plot([100 * row.share for row in own], more, "o-", color=colour, label=name)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("rated torque, % of its peak")
        axes.set_ylabel("more parts a minute, %")
        name_lines(axes, room=0.25)
        without_box(axes)


def title(found: Sequence[Row]) -> str:
    """The message: how many more parts a minute."""
    more = [100 * (row.planned / row.timed - 1) for row in found]
    return f"{min(more):.0f} to {max(more):.0f} % more parts a minute than the timed rounded path"
