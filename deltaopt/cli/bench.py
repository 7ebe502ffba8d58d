"""Measure what is claimed of plans.

deltaopt bench random      plan and verify random moves of robots
deltaopt bench gap         hold the gap that plans estimate against the true one
deltaopt bench tolerances  measure what a gap costs, on meshes and by switch resolution
deltaopt bench agreement   reference durations by transcriptions, shooting, forward dynamics
deltaopt bench objectives  least effort, and time with effort, by polynomials of three degrees
deltaopt bench plan        how long plans take, and where the time goes
deltaopt bench scaling     how time grows with the number of intervals
deltaopt bench start       from import to the first plan: cold, warm, without a compiler
deltaopt bench solver      the same problem with other solvers and settings
deltaopt bench settings    the planner's settings held against others
deltaopt bench near        what the plan of a neighbouring move is worth, and to which solver
deltaopt bench inverse     exported C beside Pinocchio and MuJoCo, where installed
deltaopt bench peers       plans beside rockit's, TOPP-RA's and Ruckig's, where installed
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.bench.any_move import Outcome, random_plans
from deltaopt.bench.peers import PEERS
from deltaopt.cli.arguments import add_scenes, load_fastest, positive
from deltaopt.cli.progress import ProgressBar
from deltaopt.errors import MissingPackage
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene, load_scene
from studies.gap import TOLERANCES, GapStudy, gap_study
from studies.tolerances import csv, table, tolerance_study

HELP = "measure what is claimed of plans: how many succeed, how good their gaps are"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    random = studies.add_parser(
        "random", help="plan and verify random moves: how many succeed", description=_random.__doc__
    )
    random.add_argument("robots", nargs="+", type=Path, metavar="ROBOT", help="robot files")
    random.add_argument("--number", type=int, default=200, metavar="N", help="moves per robot")
    random.add_argument("--payload", type=positive, default=1.0, metavar="KG", help="payload, kg")
    random.add_argument("--seed", type=int, default=1, help="of the random numbers")
    random.add_argument(
        "--tolerance",
        type=positive,
        default=1e-3,
        metavar="GAP",
        help="of the optimality gap; below 1e-4 by switch resolution (default: 1e-3)",
    )
    random.set_defaults(study=_random)
    gap = studies.add_parser(
        "gap", help="hold estimated gaps against true ones", description=_gap.__doc__
    )
    add_scenes(gap)
    gap.set_defaults(study=_gap)
    agree = studies.add_parser(
        "agreement", help="do other methods find the same", description=_agreement.__doc__
    )
    add_scenes(agree)
    agree.set_defaults(study=_agreement)
    objectives = studies.add_parser(
        "objectives", help="what less effort costs", description=_objectives.__doc__
    )
    add_scenes(objectives)
    objectives.set_defaults(study=_objectives)
    tolerances = studies.add_parser(
        "tolerances", help="what a gap costs", description=_tolerances.__doc__
    )
    add_scenes(tolerances)
    tolerances.add_argument(
        "-o",
        dest="directory",
        type=Path,
        metavar="DIR",
        default=Path("out/tolerances"),
        help="where resolution.png and resolution.csv go (default: out/tolerances)",
    )
    tolerances.set_defaults(study=_tolerances)

    _add_robot_study(studies, "plan", _plan, number=200)
    _add_robot_study(studies, "scaling", _scaling, number=5)
    _add_robot_study(studies, "solver", _solver, number=20)
    _add_robot_study(studies, "settings", _settings, number=100)
    _add_robot_study(studies, "near", _near, number=20)
    _add_robot_study(studies, "inverse", _inverse, number=2000)
    _add_robot_study(studies, "peers", _peers, number=20)
    start = studies.add_parser("start", help=_start.__doc__, description=_start.__doc__)
    add_scenes(start)
    start.set_defaults(study=_start)


Study = Callable[[argparse.Namespace], int]


def _add_robot_study(studies: Any, name: str, study: Study, number: int) -> None:
    parser = studies.add_parser(name, help=study.__doc__, description=study.__doc__)
    parser.add_argument("robots", nargs="+", type=Path, metavar="ROBOT", help="robot files")
    parser.add_argument(
        "--number", type=int, default=number, metavar="N", help=f"of moves or calls ({number})"
    )
    parser.add_argument("--payload", type=positive, default=1.0, metavar="KG", help="payload, kg")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers")
    parser.set_defaults(study=study)


def _plan(arguments: argparse.Namespace) -> int:
    """How long plans take, dense checks included, and where the time goes."""
    from deltaopt.bench.plan_timing import plan_report, timed_plans

    good, number = True, arguments.number
    for robot in map(load_robot, arguments.robots):
        bar, name = ProgressBar(), robot.name
        planner = Planner(robot, arguments.payload)
        results = timed_plans(
            planner,
            number,
            arguments.seed,
            references=min(20, number // 10),
            told=partial(_advance, bar, number, name),
        )
        print(plan_report(name, results))
        good = good and all(r.ok for r in results)
    return 0 if good else 1


def _advance(bar: ProgressBar, number: int, name: str, done: int) -> None:
    bar(done / number, name)


def _scaling(arguments: argparse.Namespace) -> int:
    """How the time of an iteration grows with the number of intervals."""
    from deltaopt.bench.plan_timing import scaling

    for robot in map(load_robot, arguments.robots):
        found = scaling(robot, arguments.payload, arguments.seed, arguments.number)
        print(f"{robot.name}: time of an iteration grows as N^{found.exponent:.2f}")
        for intervals, milliseconds in zip(found.intervals, found.milliseconds, strict=True):
            print(f"  {intervals:4d} intervals {milliseconds:8.3f} ms")
    return 0


def _solver(arguments: argparse.Namespace) -> int:
    """The flat problem on one mesh by other solvers and with other settings."""
    from studies.solvers import compare_solvers, left_out, solver_report

    for robot in map(load_robot, arguments.robots):
        told = partial(_advance, ProgressBar(), arguments.number, robot.name)
        trials = compare_solvers(
            robot, arguments.payload, arguments.number, arguments.seed, 20, told
        )
        print(f"{robot.name}, 20 intervals, {arguments.number} moves\n{solver_report(trials)}")
    for sentence in left_out("fatrop"):
        print(sentence)
    return 0


def _settings(arguments: argparse.Namespace) -> int:
    """First meshes and beginnings of the interior-point method around those of the planner."""
    from studies.settings import compare_settings, settings_report

    number = arguments.number
    for robot in map(load_robot, arguments.robots):
        told = partial(_advance, ProgressBar(), number, robot.name)
        runs = compare_settings(robot, arguments.payload, number, arguments.seed, told)
        print(f"{robot.name}, {number} moves\n{settings_report(runs)}")
    return 0


def _near(arguments: argparse.Namespace) -> int:
    """Plans and solvers from the solution of a move whose ends are nearby."""
    from studies.near import SHARES, gain_report, near_report, planner_near, solvers_near
    from studies.solvers import left_out

    number, seed = arguments.number, arguments.seed
    for robot in map(load_robot, arguments.robots):
        planner = Planner(robot, arguments.payload)
        for share in SHARES:
            told = partial(_advance, ProgressBar(), 10 * number, robot.name)
            gains = planner_near(planner, 10 * number, seed, share, told)
            told = partial(_advance, ProgressBar(), number, robot.name)
            trials = solvers_near(robot, arguments.payload, number, seed, 20, share, told)
            print(f"{robot.name}, ends moved by {share:.0%} of the way\n{gain_report(gains)}")
            print(f"  one solve on 20 intervals, {number} moves:\n{near_report(trials)}")
    for sentence in left_out("fatrop", "hpipm", "piqp"):
        print(sentence)
    return 0


def _inverse(arguments: argparse.Namespace) -> int:
    """Exported C beside Pinocchio and MuJoCo, where these are installed."""
    from deltaopt.bench.plan_timing import exported_nanoseconds

    for robot in map(load_robot, arguments.robots):
        inverse, forward = exported_nanoseconds(robot)
        print(f"{robot.name}: inverse dynamics {inverse:.0f} ns, forward dynamics {forward:.0f} ns")
        for name, measure in PEERS.items():
            try:
                peer = 1e9 * measure(robot, arguments.payload, arguments.number)
            except MissingPackage as error:
                print(f"  {error}")
                continue
            print(f"  {name}: {peer:.0f} ns, {peer / inverse:.0f} times as long")
    return 0


def _peers(arguments: argparse.Namespace) -> int:
    """Plans beside the motions of TOPP-RA on given paths and of Ruckig between motor angles, and,
    of a quarter of the moves, beside rockit's with Ipopt of equal optimality gap; what is
    installed of these."""
    from deltaopt.bench.fixed_paths import fixed_path_comparison
    from deltaopt.bench.peers import rockit_comparison

    payload, number, seed = arguments.payload, arguments.number, arguments.seed
    for robot in map(load_robot, arguments.robots):
        told = partial(_advance, ProgressBar(), number, robot.name)
        print(fixed_path_comparison(robot, payload, number, seed, told))
        try:
            print(rockit_comparison(robot, payload, max(1, number // 4), seed))
        except MissingPackage as error:
            print(f"  {error}")
    return 0


def _start(arguments: argparse.Namespace) -> int:
    """Seconds from import to a verified plan: cold, warm, without a compiler."""
    from deltaopt.bench.start import first_plan, plan_without_compiler, warm_plan

    for file in arguments.scenes:
        check_feasible(load_scene(file))  # said here, not by the processes that plan it
    for scene in arguments.scenes:
        cold, warm, plain = first_plan(scene), warm_plan(scene), plan_without_compiler(scene)
        print(f"{scene.stem}: first plan ever {cold:.2f} s, cache warm {warm:.2f} s, ", end="")
        print(f"no compiler {plain:.2f} s")
    return 0


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.study(arguments))


def _random(arguments: argparse.Namespace) -> int:
    """Plan and verify seeded random moves within the workspace of each robot."""
    robots = [load_robot(file) for file in arguments.robots]
    good = True
    for robot in robots:
        outcomes = _with_progress(robot, arguments)
        failed = [o for o in outcomes if o.failures]
        good = good and not failed
        print(_summary(robot, outcomes))
        for outcome in failed:
            print(f"  {outcome.scene.start} -> {outcome.scene.goal}: {outcome.failures[0]}")
    return 0 if good else 1


def _with_progress(robot: Robot, arguments: argparse.Namespace) -> list[Outcome]:
    bar, number = ProgressBar(), arguments.number
    return random_plans(
        robot,
        arguments.payload,
        number,
        arguments.seed,
        arguments.tolerance,
        lambda done: bar(done / number, robot.name),
    )


def _summary(robot: Robot, outcomes: list[Outcome]) -> str:
    seconds = [o.seconds for o in outcomes]
    succeeded = sum(not o.failures for o in outcomes)
    gaps = [o.gap for o in outcomes if o.intervals]  # of the plans there are
    gap = f"{np.median(gaps):.1e}" if gaps else "unknown"
    return (
        f"{robot.name}: {succeeded} of {len(outcomes)} solved and verified; "
        f"planning median {np.median(seconds):.2f} s, 99 % {np.percentile(seconds, 99):.2f} s; "
        f"estimated gap median {gap}; planned {len(gaps)}, switches resolved "
        f"{sum(o.resolved for o in outcomes)}, certified {sum(o.certified for o in outcomes)}, "
        f"verified {sum(o.verified for o in outcomes)}{_held_against_meshes(outcomes)}"
    )


def _held_against_meshes(outcomes: list[Outcome]) -> str:
    both = [o.against for o in outcomes if o.against]
    if not both:
        return ""
    off = [each.differs for each in both if abs(each.differs) > each.told]
    slower, faster = [d for d in off if d > 0], [-d for d in off if d < 0]
    return (
        f"\n  {len(both)} planned on meshes alone too: these are slower by more than both gaps "
        f"tell in {len(faster)}, by {max(faster, default=0.0):.1e} at most, and faster in "
        f"{len(slower)}, by {max(slower, default=0.0):.1e} at most"
    )


def _gap(arguments: argparse.Namespace) -> int:
    """Plan each scene at tolerances from 1e-2 to 1e-4, and at 1e-5 for the truth."""
    scenes = {file.stem: load_fastest(file) for file in arguments.scenes}
    print("\n\n".join(_gap_table(name, _gap_of(name, scene)) for name, scene in scenes.items()))
    return 0


def _gap_of(name: str, scene: Scene) -> GapStudy:
    bar, steps = ProgressBar(), len(TOLERANCES) + 1
    return gap_study(scene, told=lambda done: bar(done / steps, name))


def _gap_table(name: str, study: GapStudy) -> str:
    """A plan a line, the reference in the last."""
    rows = [
        f"{plan.tolerance:>10.0e}{plan.intervals:>10}{plan.iterations:>11}"
        f"{plan.gap:>14.1e}{study.true_gap(plan):>12.1e}"
        for plan in study.plans
    ]
    reference = study.reference
    header = f"{'tolerance':>10}{'intervals':>10}{'iterations':>11}{'estimated gap':>14}"
    truth = (
        f"true: against {reference.duration:.7f} s, {reference.intervals} intervals, itself "
        f"estimated {reference.gap:.0e} above the optimum"
    )
    return "\n".join([name, f"{header}{'true gap':>12}", *rows, truth])


def _agreement(arguments: argparse.Namespace) -> int:
    """Plan each scene at 1e-8, and again by switch resolution with polynomials of two degrees, by
    shooting, and by forward dynamics on a uniform mesh and on one with knots at the switches."""
    from studies.agreement import agreement
    from studies.agreement import table as of_answers

    for file in arguments.scenes:
        bar = ProgressBar()
        study = agreement(load_fastest(file), told=partial(_advance_to, bar, file.stem))
        print(of_answers(file.stem, study), flush=True)
    return 0


def _objectives(arguments: argparse.Namespace) -> int:
    """Plan each scene for least effort in several durations and for time weighted with effort, by
    polynomials of three degrees."""
    from studies.objectives import objectives_study
    from studies.objectives import table as of_trials

    for file in arguments.scenes:
        bar = ProgressBar()
        study = objectives_study(load_scene(file), told=partial(_advance_to, bar, file.stem))
        print(of_trials(file.stem, study), flush=True)
    return 0


def _advance_to(bar: ProgressBar, name: str, done: float) -> None:
    bar(done, name)


def _tolerances(arguments: argparse.Namespace) -> int:
    """Plan each scene on uniform meshes, on refined ones and with its switches resolved, at
    tolerances from 1e-2 to 1e-8; processor time against the gap to the last of them."""
    from deltaopt.files.atomic_write import whole
    from studies.plots.tolerances import draw  # slow to import

    studies = {}
    for file in arguments.scenes:
        studies[file.stem] = tolerance_study(load_fastest(file), told=ProgressBar())
        print(table(file.stem, studies[file.stem]), end="\n\n", flush=True)
    ratios = [study.ratio(1e-6, to=1e-3) for study in studies.values()]
    print("1e-6 costs so many times what 1e-3 does:", ", ".join(f"{r:.1f}" for r in ratios))
    chart, numbers = (arguments.directory / f"resolution.{kind}" for kind in ("png", "csv"))
    with whole(numbers) as temporary:
        temporary.write_text(csv(studies), encoding="utf-8")
    draw(studies, chart)
    print(f"written: {chart}, {numbers}")
    return 0
