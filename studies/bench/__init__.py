"""Measure plans on this machine: how fast they are, and how many succeed.

bench plan ROBOT...    how long plans take, dense checks included
bench any ROBOT...     plan and verify random moves: how many succeed
bench any              the same for robots of all kinds, up to the edge of what is possible
bench peers ROBOT...   plans beside those of TOPP-RA, Ruckig and rockit, where installed
bench start SCENE...   from import to a verified plan: cold, warm, without a compiler

Without any of these words it is plan, of the two robots of the documented figures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deltaopt.cli.arguments import (
    folder,
    kilograms,
    large_number,
    one_or_more,
    optimality_gap,
    seed,
)
from deltaopt.errors import MissingPackage
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import load_robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene_file import load_scene
from studies.bench.any_move import random_plans, summary
from studies.problems import ROBOTS

SMALL = {"number": 2}

Benchmark = Callable[[argparse.Namespace], int]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(benchmark=_plan, robots=ROBOTS, number=1000, payload=1.0, seed=1)
    benchmarks = parser.add_subparsers(title="benchmarks", metavar="BENCHMARK")
    _add_robots(_add(benchmarks, "plan", _plan), number=200)
    _add_any(_add(benchmarks, "any", _any))
    _add_robots(_add(benchmarks, "peers", _peers), number=20)
    start = _add(benchmarks, "start", _start)
    start.add_argument("scenes", nargs="+", type=Path, metavar="SCENE", help="scene files")


def _add_any(parser: argparse.ArgumentParser) -> None:
    _add_robots(parser, number=200, least=0)
    parser.add_argument(
        "--tolerance",
        type=optimality_gap,
        default=1e-3,
        metavar="GAP",
        help="of the optimality gap; below 1e-4 by switch resolution (default: 1e-3)",
    )
    campaign = parser.add_argument_group("without a ROBOT")
    campaign.add_argument(
        "--workers", type=one_or_more, default=2, metavar="N", help="processes (default: 2)"
    )
    campaign.add_argument(
        "-o",
        "--output",
        type=folder,
        default=Path("out/campaign"),
        metavar="DIR",
        help="where results go, and a scene for each failure; what is there already is not planned "
        "again (default: out/campaign)",
    )


def _add_robots(parser: argparse.ArgumentParser, number: int, least: int = 1) -> None:
    """Add ROBOT..., and how random moves of them are drawn; ``number``: of moves by default.

    ``least``: of robot files; without any a command brings its own.
    """
    nargs, words = ("+", "robot files") if least else ("*", "robot files; none for all kinds")
    parser.add_argument("robots", nargs=nargs, type=Path, metavar="ROBOT", help=words)
    parser.add_argument(
        "--number",
        type=large_number,
        default=number,
        metavar="N",
        help=f"moves of each robot (default: {number})",
    )
    parser.add_argument(
        "--payload", type=kilograms, default=1.0, metavar="KG", help="payload, kg (default: 1)"
    )
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the random moves (default: 1)"
    )


def _add(benchmarks: Any, name: str, run: Benchmark) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = benchmarks.add_parser(
        name, help=run.__doc__, description=run.__doc__
    )
    parser.set_defaults(benchmark=run)
    return parser


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.benchmark(arguments))


def _plan(arguments: argparse.Namespace) -> int:
    """Measure how long plans take, dense checks included."""
    from studies.bench.plan_timing import plan_report, timed_plans

    good, number = True, arguments.number
    for robot in map(load_robot, arguments.robots):
        results = timed_plans(
            Planner(robot, arguments.payload),
            number,
            arguments.seed,
            references=min(20, number // 10),
            progress=ProgressBar().counting(2 * number, robot.name),
        )
        print(plan_report(robot.name, results))
        good = good and all(r.ok for r in results)
    return 0 if good else 1


def _any(arguments: argparse.Namespace) -> int:
    """Plan and verify seeded random moves within the workspace of each robot; without a robot,
    moves of robots of all kinds: inside the workspace, along its edge, with motors that hardly
    hold the robot, with friction, further limits, bodies in the way, moving ends, given paths."""
    if not arguments.robots:
        return _campaign(arguments)
    robots = [load_robot(file) for file in arguments.robots]
    good, number = True, arguments.number
    for robot in robots:
        planner = Planner(robot, arguments.payload, tolerance=arguments.tolerance)
        progress = ProgressBar().counting(number, robot.name)
        outcomes = random_plans(planner, number, arguments.seed, progress)
        failed = [o for o in outcomes if o.failures]
        good = good and not failed
        print(summary(robot.name, outcomes))
        for outcome in failed:
            print(f"  {outcome.scene.start} -> {outcome.scene.goal}: {outcome.failures[0]}")
    return 0 if good else 1


def _campaign(arguments: argparse.Namespace) -> int:
    """Plan and verify moves of robots of all kinds, which bring their own payloads."""
    from studies.bench.campaign import campaign, table, told

    rows = campaign(
        arguments.output,
        arguments.number,
        arguments.seed,
        arguments.workers,
        arguments.tolerance,
        ProgressBar().counting(arguments.number, "moves"),
    )
    print(table(rows))
    for line in told(rows):
        print(line)
    return 1 if any(row.failed for row in rows) else 0


def _peers(arguments: argparse.Namespace) -> int:
    """Hold plans against the motions of TOPP-RA on given paths and of Ruckig between motor
    angles, and a quarter of them against rockit's, with Ipopt, of equal optimality gap; what is
    not installed of these is named and left out."""
    from studies.bench.fixed_paths import fixed_path_comparison
    from studies.bench.peers import rockit_comparison

    payload, number, seed = arguments.payload, arguments.number, arguments.seed
    for robot in map(load_robot, arguments.robots):
        progress = ProgressBar().counting(number, robot.name)
        print(fixed_path_comparison(robot, payload, number, seed, progress))
        try:
            print(rockit_comparison(robot, payload, max(1, number // 4), seed))
        except MissingPackage as error:
            print(f"  {error}")
    return 0


def _start(arguments: argparse.Namespace) -> int:
    """Measure the processor's time from import to a verified plan, for the first plan and for later
    ones: with nothing compiled yet, with everything compiled, and without a compiler."""
    from studies.bench.start import CASES

    for file in arguments.scenes:
        check_feasible(load_scene(file))  # said here, not by the processes that plan it
    print(f"{'':<20}  {'to a verified plan':>18}  {'first plan':>10}  {'later plans':>11}")
    for scene in arguments.scenes:
        print(scene.stem)
        for name, measure in CASES.items():
            found = measure(scene)
            print(f"  {name:<20}{found.verified:>16.2f} s{found.first:>10.3f} s", end="")
            print(f"{1e3 * found.later:>10.1f} ms")
    return 0
