"""Find the best motion of each scene, verify it, and write it down.

The motion begins and ends at rest and keeps the limits all the way; its path is free, unless the
scene gives it. The motion is then verified by code that shares the robot's model with the
planner but no method. DIR receives

  trajectory.csv   the motion for a controller: platform, motors, torques
  plan.json        duration, how it was found, all measures of the check, the scene
  plan.png         the robot, durations beside the straight line's, torques (not with --no-plot)
  limits.png       with --plot-limits: every limit over time, the path from two sides
  report.html      with --report: the robot in motion, all limits over time, one page for a browser

Several scenes are planned one after the other; each has a folder of its own. Where a scene's file
has the key cycle, DIR receives trajectory.csv of a whole period, cycle.json, cycle.png, and a
folder of each leg.

Exit code: 0 done and verified; 1 a scene has no verified solution; 2 bad input.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from deltaopt.cli.arguments import (
    WrongUsage,
    add_json,
    add_output,
    first_intervals,
    one_or_more,
    optimality_gap,
    positive,
    seed,
)
from deltaopt.cli.streams import present, print_json, print_written, say, say_failures
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import DeltaOptError, SceneError
from deltaopt.files.output_folder import require_writable
from deltaopt.files.yaml_file import place_of
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.cycle_files import content_of_cycle, told_of_cycle, verified
from deltaopt.output.facts import Facts, StraightLine
from deltaopt.output.in_words import told
from deltaopt.output.plan_files import MOST_ROWS, RATE, content, highest_rate
from deltaopt.planning.comparisons import beside_free_path
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.formulations.choice import Flat, Forward, Redundant
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    LoopClosure,
    Projection,
)
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt, ProblemFormulation, Solver
from deltaopt.planning.nlp.transcription import TRANSCRIPTIONS
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner, plan
from deltaopt.report.cycle_folder import save_cycle
from deltaopt.report.plan_folder import save
from deltaopt.scene.cycle import Cycle, there_and_back
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import has_cycle, load_cycle, load_scene
from deltaopt.verify.verification import verify

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
PLANNING = (
    "tolerance",
    "intervals",
    "formulation",
    "solver",
    "closure",
    "transcription",
    "starts",
    "seed",
    "exhaustive",
)
"""Options that say how to optimise; None where they are not given."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE", help="scene files")
    add_output(
        parser,
        words="directory to write to, made if need be; of several scenes the one that theirs are "
        "in (default: out/ and the scene's name, and baseline/ in it with --baseline)",
    )
    parser.add_argument("--no-plot", action="store_true", help="draw no plan.png, which is faster")
    parser.add_argument(
        "--plot-limits", action="store_true", help="draw limits.png: every limit over time"
    )
    parser.add_argument(
        "--report", action="store_true", help="write report.html: the robot moves on it"
    )
    add_json(parser)
    parser.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="print to stderr what was attempted and what came of it; twice: and every iteration "
        "of the solver",
    )
    parser.add_argument(
        "--baseline",
        action="store_true",
        help="no optimisation: the straight line by a quintic law, slowed until it keeps the "
        "limits (in problems/pick_and_place.yaml 0.197 s; timed optimally the same line takes "
        "0.144 s)",
    )
    parser.add_argument(
        "--tolerance",
        type=optimality_gap,
        metavar="GAP",
        help="relative optimality gap: how much longer than the optimum the motion may take, or "
        "how much more it may cost (default: 1e-3; at least 1e-9)",
    )
    parser.add_argument(
        "--intervals",
        type=first_intervals,
        metavar="N",
        help=f"intervals of the first mesh (default: {Planner.intervals})",
    )
    parser.add_argument(
        "--formulation",
        choices=FORMULATIONS,
        help="coordinates and dynamics of the optimisation (default: flat)",
    )
    parser.add_argument(
        "--solver",
        choices=SOLVERS,
        help="interior-point: deltaopt's own, in compiled C, for the flat formulation; ipopt: for "
        "all (default: the first that the formulation has)",
    )
    parser.add_argument(
        "--closure",
        choices=CLOSURES,
        help="how explicit and multiplier keep the loops closed (default: knots)",
    )
    parser.add_argument(
        "--transcription",
        choices=TRANSCRIPTIONS,
        help="acceleration in each interval (default: linear; quadratic where effort counts)",
    )
    parser.add_argument(
        "--starts",
        type=one_or_more,
        metavar="N",
        help="first guesses: the usual one, then other ways and random ones; the best is kept",
    )
    parser.add_argument(
        "--exhaustive",
        type=positive,
        metavar="SECONDS",
        help="for how long other ways and random first guesses are looked at; the best is kept",
    )
    parser.add_argument(
        "--seed", type=seed, metavar="N", help="of the random first guesses (default: 1)"
    )
    parser.add_argument(
        "--rated",
        action="store_true",
        help="there and back without a pause, as fast as the motors' rated torques allow for ever",
    )
    parser.add_argument(
        "--rate",
        type=positive,
        default=RATE,
        metavar="HZ",
        help=f"instants per second in trajectory.csv (default: {RATE:g})",
    )


def run(arguments: argparse.Namespace) -> int:
    solvers = logging.getLogger("deltaopt.planning")
    solvers.setLevel(logging.DEBUG if arguments.verbose > 1 else logging.NOTSET)
    try:
        return _run(arguments)
    finally:
        solvers.setLevel(logging.NOTSET)


def _run(arguments: argparse.Namespace) -> int:
    name = arguments.formulation or "flat"
    formulation = FORMULATIONS[name](CLOSURES[arguments.closure or "knots"])
    _refuse_contradictions(arguments, name, formulation)
    folders = _folders(arguments)
    scenes = [_load(file, arguments.rated) for file in folders]
    if any(isinstance(scene, Scene) and scene.follows_path for scene in scenes):
        _refuse_beside(arguments, ("baseline",), "free paths; the scene gives its path")
    if any(isinstance(scene, Cycle) for scene in scenes):
        why = "single motions; a cycle does not have it"
        _refuse_beside(arguments, ("baseline", "plot_limits"), why)
    codes = []
    for (file, directory), scene in zip(folders.items(), scenes, strict=True):
        if len(folders) > 1:
            say(f"{file}:")
        try:
            if isinstance(scene, Cycle):
                codes.append(_plan_cycle(file, directory, scene, arguments))
            else:
                codes.append(_plan(file, directory, scene, formulation, arguments))
        except DeltaOptError as error:
            if len(folders) == 1 or isinstance(error, SceneError):
                raise
            say(f"deltaopt: {file}: {error}")  # and the others have their solutions
            codes.append(1)
    return max(codes)


def _load(file: Path, is_rated: bool) -> Scene | Cycle:
    """The scene or the cycle of a file; with ``is_rated`` there and back of a scene. Raises
    SceneError, also where the robot does not say what its motors are rated for."""
    if has_cycle(file):
        return load_cycle(file)
    scene = load_scene(file)
    if not is_rated:
        return scene
    if scene.robot.rms_torque is None:
        expected = "drive.rms_torque or a motor's rated_torque in its file, for --rated"
        raise SceneError(file, "robot", None, expected, "does not say what motors are rated for")
    try:
        return there_and_back(scene)
    except SceneError as error:
        raise error.inside(file=file, place=place_of(file, error.key)) from None


def _folders(arguments: argparse.Namespace) -> dict[Path, Path]:
    """The directory to write to of each scene's file, checked before any work.

    Raises WrongUsage where two scenes would share one, and OSError where one cannot be written to.
    """
    scenes: list[Path] = arguments.scenes
    output: Path | None = arguments.output
    found: dict[Path, Path] = {}
    for file in scenes:
        if output is None:
            directory = Path("out") / file.stem
            directory = directory / "baseline" if arguments.baseline else directory
        else:
            directory = output if len(scenes) == 1 else output / file.stem
        if directory in found.values():
            other = next(scene for scene, taken in found.items() if taken == directory)
            raise WrongUsage(
                f"{other} and {file} would both be written to {directory}: plan them one by one, "
                "with --output"
            )
        found[file] = directory
    return found


def _plan(
    file: Path,
    directory: Path,
    scene: Scene,
    formulation: ProblemFormulation,
    arguments: argparse.Namespace,
) -> int:
    """Plan the scene of a file, print what was found, write it into a directory, and return the
    exit code."""
    check_feasible(scene)
    require_writable(directory)
    trajectory, found = _solve(scene, formulation, arguments)
    _require_rows(trajectory, arguments.rate)
    facts = Facts(scene, trajectory, found, verify(scene, trajectory))
    before = present(directory)
    files = save(
        directory,
        facts,
        arguments.rate,
        chart=not arguments.no_plot,
        limits=arguments.plot_limits,
        report=arguments.report,
    )
    if arguments.json:
        print_json(_as_dict(file, facts, files))
    else:
        print("\n".join(told(facts)))
        print_written(files, before)
    return say_failures(facts.verification.failures())


def _plan_cycle(file: Path, directory: Path, cycle: Cycle, arguments: argparse.Namespace) -> int:
    """Plan the cycle of a file, print what was found, write it into a directory, and return the
    exit code."""
    require_writable(directory)
    found = plan_cycle(
        cycle,
        tolerance=arguments.tolerance or Planner.tolerance,
        progress=lambda text: print(text, file=sys.stderr, flush=True),
    )
    verification, before = verified(found), present(directory)
    drawn = {"chart": not arguments.no_plot, "report": arguments.report}
    files = save_cycle(directory, found, verification, arguments.rate, **drawn)
    if arguments.json:
        record = content_of_cycle(found, verification)
        print_json({"scene": str(file), **record, "files": [str(each) for each in files]})
    else:
        print("\n".join(told_of_cycle(found, verification)))
        print_written(files, before)
    return say_failures(verification.failures())


def _as_dict(file: Path, facts: Facts, files: Sequence[Path]) -> dict[str, object]:
    """What is printed of a plan, for machines: a part of plan.json."""
    record = content(facts)
    same = ("gap", "tolerance", "optima", "ways", "active_limits", "verification")
    return {
        "scene": str(file),
        "ok": facts.verification.ok,
        "duration": record["duration"],
        "objective": str(facts.scene.objective),
        **{name: record[name] for name in same},
        "files": [str(each) for each in files],
    }


def _refuse_contradictions(
    arguments: argparse.Namespace, name: str, formulation: ProblemFormulation
) -> None:
    """Raise WrongUsage where an option would have no effect beside another one.

    ``name``: of the formulation.
    """
    given = [option for option in PLANNING if getattr(arguments, option) is not None]
    if arguments.baseline and given:
        raise WrongUsage(f"--{given[0]} says how to optimise, which --baseline does not do")
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


def _refuse_beside(arguments: argparse.Namespace, drawn: tuple[str, ...], why: str) -> None:
    """Raise WrongUsage for options on how to optimise, and for some on what is ``drawn``, where
    the tolerance alone has an effect; ``why``: what such an option is for."""
    given = [name for name in PLANNING if getattr(arguments, name) is not None]
    given += [name.replace("_", "-") for name in drawn if getattr(arguments, name)]
    others = [name for name in given if name != "tolerance"]
    if others:
        raise WrongUsage(f"--{others[0]} is for {why}")


def _require_rows(trajectory: Trajectory, rate: float) -> None:
    """Raise WrongUsage if a motion has too many instants at a rate (Hz)."""
    most = highest_rate(trajectory)
    if rate > most:
        raise WrongUsage(
            f"--rate is {rate:g} Hz; the motion takes {trajectory.duration:.6g} s and "
            f"trajectory.csv has at most {MOST_ROWS} rows: {0.99 * most:.3g} Hz would do"
        )


def _solve(
    scene: Scene, formulation: ProblemFormulation, arguments: argparse.Namespace
) -> tuple[Trajectory, Plan | StraightLine]:
    if arguments.baseline:
        return baseline(scene), StraightLine(lower_bound(scene))
    found = plan(
        scene,
        tolerance=arguments.tolerance or Planner.tolerance,
        intervals=arguments.intervals or Planner.intervals,
        formulation=None if scene.follows_path else formulation,
        transcription=TRANSCRIPTIONS.get(arguments.transcription),
        solver=SOLVERS.get(arguments.solver),
        starts=arguments.starts or 1,
        seed=1 if arguments.seed is None else arguments.seed,
        exhaustive=arguments.exhaustive,
        progress=lambda text: print(text, file=sys.stderr, flush=True),
    )
    if arguments.verbose:
        print("what was attempted:", *found.journal, sep="\n  ", file=sys.stderr)
    found = beside_free_path(found)
    return found.trajectory, found
