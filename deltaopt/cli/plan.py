"""Find the best motion of each scene, verify it, and write it down.

Five lines are printed: whether it is verified, duration and parts per minute; how near the best it
is; how it compares with the straight line, or with the rounded path over bodies; what limits it;
the files. With --details all else: every measure, the duty of the motors, singularities.

The motion keeps the limits all the way; its path is free, unless the scene gives it. It is then
verified by code that shares the robot's model with the planner but no method. DIR receives

  trajectory.csv   the motion for a controller: platform, motors, torques
  plan.json        duration, how it was found, all measures of the check, the scene
  plan.png         the robot, durations beside the straight line's, torques (not with --no-plot)
  limits.png       with --plot-limits: every limit over time, the path from two sides
  report.html      with --report: the robot in motion, all limits over time, one page for a browser

What an earlier plan or cycle wrote to DIR is removed; all other files stay.
Several scenes are planned one after the other; each has a folder of its own. Where a scene's file
has the key cycle, DIR receives trajectory.csv of a whole period, cycle.json, cycle.png, and a
folder of each leg, limits.png in it.

Exit code: 0 done and verified; 1 a scene has no verified solution; 2 bad input.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import Any

from deltaopt.cli.arguments import (
    WrongUsage,
    add_flag,
    add_json,
    add_output,
    first_intervals,
    one_or_more,
    optimality_gap,
    output_folders,
    positive,
    seed,
)
from deltaopt.cli.streams import (
    present,
    print_json,
    print_written,
    say,
    say_failures,
    told_meanwhile,
)
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import DeltaOptError, SceneError
from deltaopt.files.output_folder import require_writable
from deltaopt.files.yaml_file import placed_in
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.cycle_files import content_of_cycle, details_of_cycle, told_of_cycle, verified
from deltaopt.output.facts import facts
from deltaopt.output.in_words import details, surprises, told, verdict
from deltaopt.output.plan_files import MOST_ROWS, RATE, highest_rate, summary
from deltaopt.planning.comparisons import beside_free_path
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.formulations.choice import Flat, Forward, ProblemFormulation, Redundant
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    LoopClosure,
    Projection,
)
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt, Solver
from deltaopt.planning.nlp.transcription import TRANSCRIPTIONS
from deltaopt.planning.plan import Plan, plan_as_it_is
from deltaopt.planning.planner import Planner, plan
from deltaopt.report.folders import Drawn, save, save_cycle
from deltaopt.scene.cycle import Cycle, there_and_back
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_job
from deltaopt.sensitivity.sensitivity import Sensitivity, for_machines, told_of_sensitivity

FORMULATIONS: dict[str, Callable[[LoopClosure], ProblemFormulation]] = {
    "flat": lambda closure: Flat(),
    "explicit": lambda closure: Redundant(Explicit(), closure),
    "multiplier": lambda closure: Redundant(Multiplier(), closure),
    "forward": lambda closure: Forward(),
}
CLOSURES: dict[str, LoopClosure] = {
    "knots": KnotConstraints(),
    "projection": Projection(),
    "baumgarte": Baumgarte(),
    "acceleration": AccelerationLevel(),
}
SOLVERS: dict[str, Solver] = {each.name: each for each in (InteriorPoint(), Ipopt())}
RESEARCH = ("intervals", "formulation", "solver", "closure", "transcription")
PLANNING = ("tolerance", *RESEARCH, "starts", "seed", "exhaustive")
"""Options that say how to optimise; None where they are not given."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE", help="scene files")
    add_output(
        parser,
        words="directory to write to, made if need be; of several scenes the one that theirs are "
        "in (default: out/ and the scene's name, and baseline/ in it with --baseline)",
    )
    add_flag(parser, "--no-plot", "draw no plan.png, which is faster")
    add_flag(parser, "--plot-limits", "draw limits.png: every limit over time")
    add_flag(parser, "--report", "write report.html: the robot moves on it")
    add_json(parser, " (of several scenes one a line)")
    words = "print every measure, the duty of the motors, singularities and a lower bound too"
    add_flag(parser, "--details", words)
    words = (
        "print to stderr what is attempted and what comes of it; twice: and every iteration "
        "of the solver"
    )
    parser.add_argument("-v", "--verbose", action="count", default=0, help=words)
    words = "no optimisation: the straight line by a quintic law, slowed until it keeps limits"
    add_flag(parser, "--baseline", words)
    words = (
        "relative optimality gap: how much longer than the optimum the motion may take, or "
        "how much more it may cost (default: 1e-3; at least 1e-9)"
    )
    parser.add_argument("--tolerance", type=optimality_gap, metavar="GAP", help=words)
    words = "first guesses: the usual one, then other ways and random ones; the best is kept"
    parser.add_argument("--starts", type=one_or_more, metavar="N", help=words)
    words = "for how long other ways and random first guesses are looked at; the best is kept"
    parser.add_argument("--exhaustive", type=positive, metavar="SECONDS", help=words)
    words = "of the random first guesses (default: 1)"
    parser.add_argument("--seed", type=seed, metavar="N", help=words)
    words = "say how the duration depends on every number of scene and robot"
    parser.add_argument("--sensitivity", action="store_true", default=None, help=words)
    words = (
        "there and back with the payload both ways, without a pause, as fast as the motors' "
        "rated torques allow for ever"
    )
    add_flag(parser, "--rated", words)
    words = f"instants per second in trajectory.csv (default: {RATE:g})"
    parser.add_argument("--rate", type=positive, default=RATE, metavar="HZ", help=words)
    research = parser.add_argument_group("research", "how a free motion is posed and solved")
    words = f"intervals of the first mesh (default: {Planner.intervals})"
    research.add_argument("--intervals", type=first_intervals, metavar="N", help=words)
    words = "coordinates and dynamics of the optimisation (default: flat)"
    research.add_argument("--formulation", choices=FORMULATIONS, help=words)
    words = (
        "interior-point: deltaopt's own, in compiled C, for the flat formulation; ipopt: for "
        "all (default: the first that the formulation has)"
    )
    research.add_argument("--solver", choices=SOLVERS, help=words)
    words = "how explicit and multiplier keep the loops closed (default: knots)"
    research.add_argument("--closure", choices=CLOSURES, help=words)
    words = "acceleration in each interval (default: linear; quadratic where effort counts)"
    research.add_argument("--transcription", choices=TRANSCRIPTIONS, help=words)


def run(arguments: argparse.Namespace) -> int:
    solvers = logging.getLogger("deltaopt.planning")
    solvers.setLevel(logging.DEBUG if arguments.verbose > 1 else logging.NOTSET)
    try:
        return _run(arguments)
    finally:
        solvers.setLevel(logging.NOTSET)


def _run(arguments: argparse.Namespace) -> int:
    _refuse_contradictions(arguments)
    folders = output_folders(arguments)
    scenes = [_load(file, arguments.rated) for file in folders]
    if any(isinstance(scene, Scene) and scene.follows_path for scene in scenes):
        free = ("baseline", "sensitivity")
        _refuse(arguments, free, "is for free paths; the scene gives its path")
    if any(isinstance(scene, Cycle) for scene in scenes):
        _refuse(arguments, ("baseline",), "is for single motions; a cycle does not have it")
    codes = []
    for (file, directory), scene in zip(folders.items(), scenes, strict=True):
        if len(folders) > 1:
            say(f"{file}:")
        try:
            if isinstance(scene, Cycle):
                codes.append(_plan_cycle(file, directory, scene, arguments))
            else:
                codes.append(_plan(file, directory, scene, arguments))
        except DeltaOptError as error:
            if len(folders) == 1 or isinstance(error, SceneError):
                raise
            say(f"deltaopt: {file}: {error}")  # and the others have their solutions
            codes.append(1)
    return max(codes)


def _load(file: Path, is_rated: bool) -> Scene | Cycle:
    """The scene or the cycle of a file; with ``is_rated`` there and back of a scene. Raises
    SceneError, also where the robot does not say what its motors are rated for."""
    job = load_job(file)
    if isinstance(job, Cycle) or not is_rated:
        return job
    if job.robot.rms_torque is None:
        expected = "drive.rms_torque or a motor's rated_torque in its file, for --rated"
        raise SceneError(file, "robot", None, expected, "does not say what motors are rated for")
    with placed_in(file):
        return there_and_back(job)


def _plan(file: Path, directory: Path, scene: Scene, arguments: argparse.Namespace) -> int:
    """Plan the scene of a file, print what was found, write it into a directory, and return the
    exit code."""
    check_feasible(scene)
    require_writable(directory)
    found = _solve(scene, arguments)
    _require_rows(found.trajectory, arguments.rate)
    known = facts(found)
    before = present(directory)
    files = save(directory, known, arguments.rate, _drawn(arguments))
    if arguments.json:
        printed = {"scene": str(file), **summary(known), "files": list(map(str, files))}
        print_json(printed | for_machines(_sensitivities(found, arguments)))
    else:
        more = details(known) if arguments.details else surprises(known)
        print(*told(known), *more, sep="\n", flush=True)
        print_written(files, before)
        _print_sensitivities(found, arguments)
    return say_failures(known.verification.failures())


def _plan_cycle(file: Path, directory: Path, cycle: Cycle, arguments: argparse.Namespace) -> int:
    """Plan the cycle of a file, print what was found, write it into a directory, and return the
    exit code."""
    require_writable(directory)
    with told_meanwhile(arguments.verbose > 0) as progress:
        found = plan_cycle(cycle, **_given(arguments, "tolerance"), progress=progress)
    verification, before = verified(found), present(directory)
    files = save_cycle(directory, found, verification, arguments.rate, _drawn(arguments))
    if arguments.json:
        record = {"scene": str(file), **content_of_cycle(found, verification)}
        record["files"] = list(map(str, files))
        print_json(record | for_machines(_sensitivities(found, arguments)))
    else:
        more = details_of_cycle(found, verification) if arguments.details else ()
        print(f"{verdict(verification)}: ", end="")
        print(*told_of_cycle(found, verification), *more, sep="\n", flush=True)
        print_written(files, before)
        _print_sensitivities(found, arguments)
    return say_failures(verification.failures())


def _drawn(arguments: argparse.Namespace) -> Drawn:
    """What is drawn of plans and of cycles."""
    return Drawn(not arguments.no_plot, arguments.plot_limits, arguments.report)


def _sensitivities(found: Plan | CyclePlan, arguments: argparse.Namespace) -> Sequence[Sensitivity]:
    """How the duration depends on every number, where that is asked for."""
    return tuple(found.sensitivity()) if arguments.sensitivity else ()


def _print_sensitivities(found: Plan | CyclePlan, arguments: argparse.Namespace) -> None:
    """Print them in words, where they are asked for."""
    if arguments.sensitivity:
        print(*told_of_sensitivity(_sensitivities(found, arguments)), sep="\n")


def _formulation(arguments: argparse.Namespace) -> ProblemFormulation:
    """The formulation that is asked for."""
    return FORMULATIONS[arguments.formulation or "flat"](CLOSURES[arguments.closure or "knots"])


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    """Raise WrongUsage where an option would have no effect beside another one."""
    name, formulation = arguments.formulation or "flat", _formulation(arguments)
    for option in _given(arguments, *PLANNING, "sensitivity") if arguments.baseline else ():
        raise WrongUsage(f"--{option} is for a plan, which --baseline does not make")
    possible = [solver.name for solver in (each() for each in formulation.solvers)]
    if arguments.solver and arguments.solver not in possible:
        raise WrongUsage(
            f"--solver is {arguments.solver}; with --formulation {name} it may be "
            f"{' or '.join(possible)}"
        )
    if arguments.closure and not isinstance(formulation, Redundant):
        raise WrongUsage(
            f"--closure is {arguments.closure}; with --formulation {name} no loops can drift "
            "open, only with explicit and multiplier"
        )


def _refuse(arguments: argparse.Namespace, others: Sequence[str], why: str) -> None:
    """Raise WrongUsage for options that say how to optimise, but for the tolerance, and others."""
    for name, value in _given(arguments, *PLANNING, *others).items():
        if name != "tolerance" and value is not False:
            raise WrongUsage(f"--{name.replace('_', '-')} {why}")


def _require_rows(trajectory: Trajectory, rate: float) -> None:
    """Raise WrongUsage if a motion has too many instants at a rate (Hz)."""
    most = highest_rate(trajectory)
    if rate > most:
        raise WrongUsage(
            f"--rate is {rate:g} Hz; the motion takes {trajectory.duration:.6g} s and "
            f"trajectory.csv has at most {MOST_ROWS} rows: {0.99 * most:.3g} Hz would do"
        )


def _solve(scene: Scene, arguments: argparse.Namespace) -> Plan:
    if arguments.baseline:
        return plan_as_it_is(scene, baseline(scene), inf, None, "straight line", "closed form")
    with told_meanwhile(arguments.verbose > 0) as progress:
        found = plan(
            scene,
            **_given(arguments, "tolerance", "intervals", "starts", "seed", "exhaustive"),
            formulation=None if scene.follows_path else _formulation(arguments),
            transcription=TRANSCRIPTIONS.get(arguments.transcription),
            solver=SOLVERS.get(arguments.solver),
            progress=progress,
        )
    return beside_free_path(found)


def _given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """The options of these names that are given."""
    values = {name: getattr(arguments, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}
