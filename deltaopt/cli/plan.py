"""Find the best motion of each scene, verify it, and write it down.

The motion begins and ends at rest and keeps the limits all the way; its path is free, unless the
scene gives it. The motion is then verified by code that shares the robot's model with the
planner but no method. DIR receives

  trajectory.csv   the motion for a controller: platform, motors, torques
  plan.json        duration, how it was found, all measures of the check, the scene
  plan.png         the robot, durations beside the straight line's, torques (not with --no-plot)
  limits.png       with --plot-limits: every limit over time, the path from two sides
  report.html      with --report: the robot in motion, all limits over time, one page for a browser

Several scenes are planned one after the other; each has a folder of its own.

Exit code: 0 done and verified; 1 a scene has no verified solution; 2 bad input.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from deltaopt.cli.arguments import (
    WrongUsage,
    add_json,
    add_scenes,
    first_intervals,
    folder,
    one_or_more,
    optimality_gap,
    positive,
    seed,
)
from deltaopt.cli.streams import present, print_json, print_written, say
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import DeltaOptError, SceneError
from deltaopt.files.output_folder import require_writable
from deltaopt.motion.active_limits import ActiveLimit, active_limits
from deltaopt.motion.certificate import MET
from deltaopt.motion.limit_sensitivity import as_dicts, limits_in_words
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.plan_files import (
    MOST_ROWS,
    RATE,
    Provenance,
    StraightLine,
    highest_rate,
    save,
    way_content,
)
from deltaopt.planning.comparisons import beside_free_path
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.first_motions.multistart import Optimum
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import Forward, Redundant
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
from deltaopt.planning.trajectory_optimiser import RESOLVED_BELOW
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene, load_scene
from deltaopt.verify.duty import Duty, exceeding
from deltaopt.verify.measures import Distance
from deltaopt.verify.verification import Check, Verification, verify

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
)
"""Options that say how to optimise; None where they are not given."""
HELP = "find the best motion of a scene, the fastest as a rule, and verify it"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=folder,
        metavar="DIR",
        help="directory to write to, made if need be; of several scenes the one that theirs are in "
        "(default: out/ and the scene's name, and baseline/ in it with --baseline)",
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
        help="first guesses, distinct ways and then random ones; the best is kept (default: 1)",
    )
    parser.add_argument(
        "--seed", type=seed, metavar="N", help="of the random first guesses (default: 1)"
    )
    parser.add_argument(
        "--rate",
        type=positive,
        default=RATE,
        metavar="HZ",
        help=f"instants per second in trajectory.csv (default: {RATE:g})",
    )


def run(arguments: argparse.Namespace) -> int:
    if arguments.verbose > 1:
        with _solver_heard():
            return _run(arguments)
    return _run(arguments)


@contextmanager
def _solver_heard() -> Iterator[None]:
    """Let what solvers say of their iterations be heard meanwhile."""
    log = logging.getLogger("deltaopt.planning")
    log.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        log.setLevel(logging.NOTSET)


def _run(arguments: argparse.Namespace) -> int:
    name = arguments.formulation or "flat"
    formulation = FORMULATIONS[name](CLOSURES[arguments.closure or "knots"])
    _refuse_contradictions(arguments, name, formulation)
    folders = _folders(arguments)
    scenes = [load_scene(file) for file in folders]
    if any(scene.follows_path for scene in scenes):
        _refuse_free_paths(arguments)
    jobs = list(zip(folders.items(), scenes, strict=True))
    if len(jobs) == 1:
        return _plan(*jobs[0], formulation, arguments)
    codes = [_one_of_several(job, formulation, arguments) for job in jobs]
    return max(codes)


Job = tuple[tuple[Path, Path], Scene]
"""A scene's file, the directory to write to, and the scene."""


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


def _one_of_several(
    job: Job, formulation: ProblemFormulation, arguments: argparse.Namespace
) -> int:
    """Plan one of several scenes; if it has no solution, say so and let the others have theirs."""
    (file, directory), scene = job
    say(f"{file}:")
    try:
        return _plan((file, directory), scene, formulation, arguments)
    except SceneError:
        raise
    except DeltaOptError as error:
        say(f"deltaopt: {file}: {error}")
        return 1


def _plan(
    names: tuple[Path, Path],
    scene: Scene,
    formulation: ProblemFormulation,
    arguments: argparse.Namespace,
) -> int:
    """Plan one scene, print and write what was found, and return the exit code.

    ``names``: of the scene's file, and of the directory to write to.
    """
    file, directory = names
    check_feasible(scene)
    require_writable(directory)
    trajectory, solution = _solve(scene, formulation, arguments)
    _require_rows(trajectory, arguments.rate)
    verification = verify(scene, trajectory)
    active = active_limits(problem_of(scene), trajectory)
    before = present(directory)
    files = save(
        directory,
        scene,
        trajectory,
        verification,
        solution,
        arguments.rate,
        chart=not arguments.no_plot,
        limits=arguments.plot_limits,
        report=arguments.report,
    )
    if arguments.json:
        print_json(_as_dict(file, scene, verification, solution, active, files))
    else:
        if isinstance(solution, Plan):
            _print_optima(solution)
            _print_ways(solution)
            _print_gap(solution)
            _print_cost_of_path(solution)
        if len(solution.phases) > 1:
            print(f"phases: {', '.join(f'{each:.6f}' for each in solution.phases)} s")
        resolved = solution.tolerance is not None and solution.tolerance <= RESOLVED_BELOW
        print(table(verification, certified=resolved))
        print("\n".join(active_limits_table(active, solution)))
        print(lower_bound_line(solution.lower_bound, trajectory))
        print_written(files, before)
    for failure in verification.failures():
        print(f"deltaopt: verification failed: {failure}", file=sys.stderr)
    return 0 if verification.ok else 1


def _as_dict(
    file: Path,
    scene: Scene,
    verification: Verification,
    solution: Provenance,
    active: Sequence[ActiveLimit],
    files: Sequence[Path],
) -> dict[str, object]:
    """What is printed of a plan, for machines."""
    return {
        "scene": str(file),
        "ok": verification.ok,
        "duration": verification.duration,
        "objective": str(scene.objective),
        "gap": solution.gap,
        "tolerance": solution.tolerance,
        "optima": [
            {"duration": each.duration, "cost": each.cost, "starts": each.starts}
            for each in solution.optima
        ],
        "ways": [way_content(each) for each in solution.ways],
        "active_limits": as_dicts(active, solution.sensitivities),
        "verification": verification.as_dict(),
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


def _refuse_free_paths(arguments: argparse.Namespace) -> None:
    """Raise WrongUsage for options that have no effect where the scene gives the path."""
    given = [name for name in PLANNING if getattr(arguments, name) is not None]
    given += ["baseline"] if arguments.baseline else []
    useless = [name for name in given if name != "tolerance"]
    if useless:
        raise WrongUsage(f"--{useless[0]} is for free paths; the scene gives its path")


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
) -> tuple[Trajectory, Provenance]:
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
        progress=lambda text: print(text, file=sys.stderr, flush=True),
    )
    if arguments.verbose:
        print("what was attempted:", *found.journal, sep="\n  ", file=sys.stderr)
    found = beside_free_path(found)
    return found.trajectory, found


def _print_cost_of_path(found: Plan) -> None:
    """Print how much longer the motion takes than one on a free path, where the path is given."""
    free = found.free_duration
    if free is not None:
        print(
            f"on the given path {found.duration:.6f} s, on a free path {free:.6f} s: the path "
            f"costs {found.duration / free - 1:.1%}"
        )


def _print_optima(found: Plan) -> None:
    """Print the distinct local minima, if there was more than one start."""
    for i, optimum in enumerate(found.optima, 1):
        x, y, z = optimum.halfway
        print(
            f"local optimum {i}: {_outcome(found.scene, optimum)} from {optimum.starts} starts, "
            f"halfway at ({x:.4f}, {y:.4f}, {z:.4f}) m"
        )


def _print_ways(found: Plan) -> None:
    """Print the ways past bodies, the one that is taken first."""
    for i, way in enumerate(found.ways):
        about = "" if way.is_planned else "about "
        taken = "way taken: " if i == 0 else "another way: "
        print(f"{taken}{way.name}, {about}{way.duration:.{6 if way.is_planned else 3}f} s")


def _outcome(scene: Scene, optimum: Optimum) -> str:
    """The duration of a local minimum, and its cost if the objective is not time."""
    if isinstance(scene.objective, Time):
        return f"{optimum.duration:.6f} s"
    return f"{optimum.cost:.6g} {scene.objective.unit} in {optimum.duration:.6f} s"


def _print_gap(found: Plan) -> None:
    """Print the cost, the estimated optimality gap and the certificate of a plan."""
    if isinstance(found.scene.objective, Time):
        print(f"estimated to be at most {found.gap:.1e} longer than the optimum", end="")
    else:
        print(f"{found.scene.objective}: {found.cost:.9g} {found.scene.objective.unit}")
        print(f"estimated to be at most {found.gap:.1e} above the least", end="")
    print("" if found.within_tolerance else f", which is not the {found.tolerance:g} asked for")
    if found.certificate:
        met = f"satisfies Pontryagin's condition to {found.certificate.residual:.0e}"
        near = "no motion near it is faster; one far from it may be"
        print(f"{met}: {near}" if found.resolved else f"{met} on its mesh")


def table(verification: Verification, *, certified: bool = False) -> str:
    """A table of the duration and of all measures of a verification beside their bounds.

    ``certified``: whether Pontryagin's condition was asked for, by a tolerance for which switches
    are resolved. If so the table says too where it is not met.
    """
    rows = [("measure", "value", "at most", "unit", ""), *map(_row, verification.checks())]
    width = 1 + max(len(name) for name, *_ in rows)
    lines = (
        f"{name:<{width}}{value:>10}{bound:>9}  {unit:<13}{ok}".rstrip()
        for name, value, bound, unit, ok in rows
    )
    total = f"duration {verification.duration:.6f} s, effort {verification.effort:.6g} N²m²s"
    remarks = (
        _long(verification)
        + singularities_table(verification.distances)
        + _optimality(verification, certified)
    )
    motors = [] if verification.duty is None else duty_table(verification.duty)
    return "\n".join([total, *lines, *motors, *remarks])


def lower_bound_line(bound: float, trajectory: Trajectory) -> str:
    """A line that says what no motion of the scene undercuts, on whatever path: ``bound``, s."""
    if not bound:
        return "lower bound for every path: none is known (an end moves, or a term of the robot)"
    share = bound / trajectory.duration
    return f"lower bound for every path: {bound:.6f} s, {share:.2f} of the duration (proven)"


def duty_table(duty: Duty) -> list[str]:
    """Lines on the duty of each motor: RMS torque, mechanical work, power, speed."""
    marks = {
        "  rated torque": exceeding(duty.above_rated).upper(),
        "  nominal torque": exceeding(duty.above_nominal).upper(),
    }
    rows: list[tuple[str, str, Sequence[float | None]]] = [
        ("RMS torque", "N·m", [each.rms_torque for each in duty.motors]),
        ("  rated torque", "N·m", duty.rated_torque or ()),
        ("RMS torque at the motor", "N·m", [each.motor_rms_torque for each in duty.motors]),
        ("cubic mean of the gear's torque", "N·m", [each.gear_torque for each in duty.motors]),
        ("  nominal torque", "N·m", [duty.nominal_torque] * 3),
        ("work done", "J", [each.work_done for each in duty.motors]),
        ("work absorbed", "J", [each.work_absorbed for each in duty.motors]),
        ("peak power", "W", [each.peak_power for each in duty.motors]),
        ("largest speed", "rad/s", [each.largest_speed for each in duty.motors]),
    ]
    done = sum(each.work_done for each in duty.motors)
    absorbed = sum(each.work_absorbed for each in duty.motors)
    return [
        f"{'duty of the motors, at the arm':<34}{'1':>10}{'2':>10}{'3':>10}",
        *(
            f"  {name:<32}{''.join(f'{v:>10.4g}' for v in values if v is not None)}  {unit:<7}"
            f"{marks.get(name, '')}".rstrip()
            for name, unit, values in rows
            if any(value is not None for value in values)
        ),
        f"  together: peak power {duty.peak_power:.4g} W, work done {done:.4g} J, "
        f"absorbed {absorbed:.4g} J",
    ]


def _long(verification: Verification) -> list[str]:
    """A line for a motion so long that without feedback its torques need not lead to the goal."""
    away, grown = verification.arrival_distance, verification.amplification
    if verification.judges_arrival:
        return []
    led = "" if away is None else f" (integrated to 12 digits they end {away:.1e} m from it)"
    return [
        f"without feedback a deviation grows {grown:.0e} times, and so torques alone do not lead "
        f"to the goal{led}: judged in pieces"
    ]


def singularities_table(distances: Sequence[Distance]) -> list[str]:
    """Lines that say how near the motion comes to each kind of singularity.

    There is no bound on these distances. Torques, which are bounded, grow near a singularity, but
    for the tilt of the platform, of which they know nothing: a motion beyond it is marked, and
    ``limits.tilt_singularity`` keeps motions from it.
    """
    lines = [
        f"  {each.name}: {each.formula} = {each.least:.2g}, {_where(each)}"
        + (", PASSED: the motors do not hold the robot there" if each.least <= 0 else "")
        for each in distances
    ]
    return ["least distance to singularities, 0 in one and 1 at best:", *lines] if lines else []


def _where(distance: Distance) -> str:
    """Of which chain, if it is of one, and when: "chain 2 at t = 0.1 s"."""
    when = f"at t = {distance.t:.6f} s"
    return when if distance.subject == "robot" else f"{distance.subject} {when}"


def active_limits_table(active: Sequence[ActiveLimit], solution: Provenance) -> list[str]:
    """Lines that say in words what limits a motion: which motor's what, how much of the time, and
    what more of it would save."""
    told = limits_in_words(active, solution.sensitivities)
    lines = [f"  {sentence}" for sentence in told]
    return ["what limits the motion:", *lines] if lines else ["no limit is reached"]


def _optimality(verification: Verification, certified: bool) -> list[str]:
    """A line that says how well the motion meets Pontryagin's condition, if it does or is to.

    There is no bound on it, for as a rule only motions with resolved switches meet it.
    """
    spread, violation = verification.hamiltonian_spread, verification.sign_violation
    if spread is None or violation is None:
        return []
    met = max(spread, violation) < MET
    if not (met or certified):
        return []
    verdict = "; a local statement" if met else f": not met, which would be {MET:g}"
    return [
        f"Pontryagin's condition, by costates fitted to the motion: Hamiltonian constant to "
        f"{spread:.1e}, signs of torques right to {violation:.1e}{verdict}"
    ]


def _row(check: Check) -> tuple[str, str, str, str, str]:
    bound = check.bound
    name = bound.measure.replace("_", " ")
    ok = "ok" if check.ok else "FAILED"
    return name, f"{check.value:.1e}", f"{bound.at_most:.0e}", bound.unit, ok
