"""Check a scene or a robot, and say what of it is modelled and what is not.

The first line says whether the scene can be done, and what that rests on: a motion that keeps all
limits, the straight line if it does, else one that is planned to within 10 %. Neither is verified,
which `deltaopt plan` does. What cannot be done is refused in a sentence: the platform cannot be at
an end or leave it, the motors cannot hold it there. Where no motion is found it is not known.

Then the limits are listed, the bodies to keep out of, and the baseline: the straight line by a
quintic law (10 u³ - 15 u⁴ + 6 u⁵ of the line at the share u of the duration), slowed until it keeps
the limits, and the same line timed optimally.

Where the robot names its motor and gear, every step from their catalogues to the arm is printed,
which of them sets each limit, and what the baseline asks of them. With a robot file that is all.
Of a cycle each leg is checked by itself; with --json each is a line.

With --terms the scene is planned without each term of its robot in turn: what a plan without the
term gains or loses, by how much it exceeds a limit on the robot that has the term, and how far its
torques miss the goal there in open loop. What does nothing need not be modelled.

Exit code: 0 the scene can be done; 1 it cannot, or no motion is found; 2 bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np

from deltaopt.cli.arguments import WrongUsage, add_flag, add_json, add_output, output_directory
from deltaopt.cli.streams import new_files, print_json
from deltaopt.codegen.compile import describe
from deltaopt.curves.piecewise import Array
from deltaopt.errors import (
    NO_PLAN,
    RULED_OUT,
    DeltaOptError,
    EndMoves,
    NotConverged,
    if_possible,
    in_words,
)
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.files.tables import finite, text_table
from deltaopt.files.validated_record import PerMotor, per_motor
from deltaopt.files.yaml_file import read_yaml
from deltaopt.mechanisms.delta.mechanism import DeltaParameters
from deltaopt.output.in_words import beyond, duty_table
from deltaopt.planning.comparisons import timed_line
from deltaopt.planning.effort_planning import fastest
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.flat.method_source import source
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.report.modelled import not_modelled
from deltaopt.robot.catalogue import Reduction, reductions
from deltaopt.robot.drive import Drive, Friction
from deltaopt.robot.joints import controller_angles_in_words
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import load_robot
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.feasibility import are_surely_feasible, check_feasible, perhaps_meant
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_job
from deltaopt.scene.task import distance, ends_in_words
from deltaopt.scene.way import Rotation
from deltaopt.verify.measures import MeasuredMotion

_ORDERS = ("position", "velocity", "acceleration or torque", "rate of these")
_ROUGH = 0.1
"""Tolerance of a plan that shows that there is a motion: a coarse one keeps all limits too."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    words = "scene or robot file, such as problems/pick_and_place.yaml"
    parser.add_argument("scene", type=Path, metavar="FILE", help=words)
    words = (
        "plan the scene without each term of its robot in turn, rank the terms by what that "
        "does, and draw terms.png"
    )
    add_flag(parser, "--terms", words)
    add_output(parser)
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    if arguments.output is not None and not arguments.terms:
        raise WrongUsage("--output says where the chart of --terms goes; give both or neither")
    if arguments.terms and arguments.json:
        raise WrongUsage("--terms prints a table; it has no --json")
    if arguments.terms:
        return _terms(arguments)
    content = read_yaml(arguments.scene)
    if "drive" in content and "robot" not in content:
        robot = load_robot(arguments.scene)
        if arguments.json:
            print_json({"robot": robot.model_dump(mode="json", exclude_none=True)})
            return 0
        angles = [f"{'angles':<13}{told}" for told in controller_angles_in_words(robot.joints)]
        print("\n".join([f"{'robot':<13}{robot.name}", *angles, *drive_table(robot.drive)]))
        return 0
    job = load_job(arguments.scene)
    if isinstance(job, Scene):
        return _check(arguments, job, {})
    if job.on_belts:
        raise WrongUsage(
            f"{arguments.scene} is a cycle with a belt, whose legs are known when it is planned: "
            "run deltaopt plan"
        )
    for number, leg in enumerate(job.legs, 1):
        if not arguments.json:
            print(f"{'leg':<13}{number} of {len(job.legs)}")
        _check(arguments, leg, {"leg": number})
    return 0


def _check(arguments: argparse.Namespace, scene: Scene, which: dict[str, object]) -> int:
    """Print what there is to say of a scene; ``which``: leg of a cycle it is, for machines. Raises
    what ``_verdict`` raises."""
    try:
        verdict = _verdict(scene)
    except NO_PLAN as error:
        if not arguments.json:
            known = "not known" if isinstance(error, NotConverged) else "cannot be done"
            print(f"{'verdict':<13}{known}", flush=True)
        raise
    if arguments.json:
        print_json(which | _as_dict(arguments.scene, scene, verdict))
        return 0
    of_robot, of_task, *rest = _description(scene)
    angles = (("angles", told) for told in controller_angles_in_words(scene.robot.joints))
    for name, text in (("verdict", verdict), of_robot, *angles, of_task, *_bodies(scene), *rest):
        print(f"{name:<13}{text}")
    print("\n".join(["", *drive_table(scene.robot.drive), *_duty_of_baseline(scene)]))
    print(f"\n{limits_table(scene)}")
    return 0


def _verdict(scene: Scene) -> str:
    """That a scene can be done, and what that rests on.

    Raises Unreachable, Singular or Infeasible where it cannot, NotConverged where no motion is
    found.
    """
    check_feasible(scene)
    motion, what = None, "the straight line in {:.4g} s"
    if not (scene.via or scene.follows_path or scene.robot_keeps_clear):
        motion = if_possible((EndMoves, *RULED_OUT), baseline, scene)
    if motion is None:
        motion = plan(scene, tolerance=_ROUGH).trajectory
        what = "a motion of {:.4g} s that was planned"
    told = f"can be done{beyond(MeasuredMotion(scene, motion).distances())}"
    return f"{told}: {what.format(motion.duration)} keeps all limits"


def _bodies(scene: Scene) -> Iterator[tuple[str, str]]:
    """A line on each body: its key, kind, size and place, and whether z up was meant."""
    alone = scene.model_copy(update={"keep_out": None})
    for index, body in enumerate(scene.keep_out or ()):
        centre = body.shape.centre
        surely = are_surely_feasible(alone, np.array([centre]))[0]
        meant = "" if surely else perhaps_meant(alone, centre)
        yield f"keep_out[{index}]", f"{body.in_words}{meant}"


def _as_dict(file: Path, scene: Scene, verdict: str) -> dict[str, object]:
    """What is printed of a scene, for machines."""
    limits = limits_of(scene)
    constraints, (lower, upper) = limits.constraints, limits.bounds
    return {
        "file": str(file),
        "verdict": verdict,
        "description": dict(_description(scene)),
        "bodies": dict(_bodies(scene)),
        "limits": [
            {
                "limit": limit.name,
                "subject": limit.subject,
                "unit": limit.unit,
                "lower": list(map(finite, lower[own].tolist())),
                "upper": list(map(finite, upper[own].tolist())),
                "order": limit.order,
                "promised": limit.promised,
            }
            for limit, own in zip(constraints.limits, constraints.slices, strict=True)
        ],
        "scene": scene.model_dump(mode="json", exclude_none=True),
    }


def _terms(arguments: argparse.Namespace) -> int:
    """Rank the terms of a scene's robot, in a table and a chart."""
    from deltaopt.compare.model_terms import effects_of_terms, terms_table
    from deltaopt.plots.model_terms import draw_terms

    scene = load_job(arguments.scene)
    if isinstance(scene, Cycle):
        raise WrongUsage(f"--terms is for single motions; {arguments.scene} is a cycle")
    check_feasible(scene)
    directory, chart = output_directory(arguments), "terms.png"
    effects = effects_of_terms(scene, ProgressBar())
    print("\n".join(terms_table(effects)))
    with new_files(directory, chart) as folder:
        title = f"{scene.robot.name}: planned without a term, run with all"
        draw_terms(folder / chart, title, effects)
    return 0


def drive_table(drive: Drive) -> list[str]:
    """Lines on a drive at its arm, with every step from the catalogues of motor, brake and gear."""
    if drive.motor is None:
        given = (
            ("torque", drive.torque, "N·m"),
            ("RMS torque", drive.rms_torque, "N·m"),
            ("speed", drive.speed, "rad/s"),
            ("inertia", drive.inertia, "kg·m²"),
        )
        lines = [f"  {name:<14}{_each(n)} {unit}" for name, n, unit in given if n is not None]
    else:
        found = reductions(drive.motor, drive.brake, drive.gear).values()
        lines = [line for each in found for line in _steps(each)]
    if drive.gear is not None and drive.gear.nominal_torque is not None:
        nominal = f"{drive.gear.nominal_torque:g} N·m, for the cubic mean weighted with speed"
        lines.append(f"  {'gear, nominal':<14}{nominal}")
    if drive.torque_curve is not None:
        points = (f"{torque:.5g} N·m at {speed:.5g} rad/s" for speed, torque in drive.torque_curve)
        lines.append(f"  {'torque curve':<14}{', '.join(points)}")
    if drive.friction is not None:
        lines.append(f"  {'friction':<14}{_friction(drive.friction)}")
    return ["drive, at the arm", *lines]


def _steps(found: Reduction) -> list[str]:
    """Lines on a quantity at the arm: what it is, which part sets it, and how each part counts."""
    if len(found.parts) == 1:
        (only,) = found.parts
        how = f"{only.calculation}, {only.part}"
        return [f"  {found.name:<14}{found.value:.5g} {found.unit} = {how}"]
    setting = "most of it is the" if found.total else "set by the"
    head = f"  {found.name:<14}{found.value:.5g} {found.unit}, {setting} {found.set_by.part}"
    width = max(len(part.part) for part in found.parts)
    return [
        head,
        *(
            f"  {'':<14}  {part.part:<{width}}  {part.calculation} = {part.value:.5g}"
            for part in found.parts
        ),
    ]


def _friction(friction: Friction) -> str:
    terms = []
    if friction.viscous is not None:
        terms.append(f"{friction.viscous:g} N·m·s/rad · θ̇")
    if friction.coulomb is not None:
        terms.append(f"{friction.coulomb:g} N·m · tanh(θ̇ / ({friction.speed:g} rad/s))")
    return " + ".join(terms)


def _each(limit: PerMotor) -> str:
    """One number, or that of each motor, as text."""
    each = per_motor(limit)
    return ", ".join(f"{value:g}" for value in (each if len(set(each)) > 1 else each[:1]))


def _duty_of_baseline(scene: Scene) -> list[str]:
    """What the baseline asks of motors that are rated for an RMS torque; nothing of others."""
    if scene.robot.rms_torque is None:
        return []
    line = if_possible((EndMoves, *RULED_OUT), baseline, scene)
    if line is None:
        return []  # the description says why there is no baseline
    return ["", "the baseline:", *duty_table(MeasuredMotion(scene, line).duty())]


def _description(scene: Scene) -> list[tuple[str, str]]:
    """The lines of the description, each a name and a text."""
    model, task = delta_model(scene.robot, scene.payload), scene.task
    mechanism, parameters = model.functions.mechanism, model.numbers
    coordinates, constraints = mechanism.q.numel(), mechanism.mu.numel()
    ends = ends_in_words(task)
    if not task.moves_at_ends:
        ends += f", {distance(task):.4g} m apart"
    return [
        ("robot", scene.robot.name),
        ("task", f"{task.description}: {ends}"),
        ("objective", str(scene.objective)),
        ("coordinates", f"{coordinates}: x, y, z of the platform, three angles of each chain"),
        ("constraints", f"{constraints}: loop closure, eq. (50)-(52)"),
        ("freedom", f"{coordinates - constraints} degrees, {mechanism.controls.numel()} motors"),
        ("bodies", f"{len(mechanism.bodies)}: {_masses(parameters, scene.least_payload)}"),
        ("inertia", _inertias(parameters)),
        ("gravity", _gravity(parameters)),
        ("machine code", describe(lambda: default_method(scene))),
        ("left out", ", ".join(not_modelled(scene))),
        *([("rotation", _rotation(scene.rotation))] if scene.rotation else []),
        ("baseline", _baseline(scene)),
    ]


def default_method(scene: Scene) -> str:
    """C source of the method that plans a scene by default."""
    problem = problem_of(scene)
    equations = point_equations(problem.model.functions, problem.limits.constraints)
    cost = fastest(problem)
    return source(equations.point_problem(cost), len(LINEAR.points))


def limits_table(scene: Scene) -> str:
    """A table of the limits of a scene: unit, bounds, order, and whether slowing down helps."""
    limits = limits_of(scene)
    constraints, (lower, upper) = limits.constraints, limits.bounds
    heads = ("limit", "of each", "unit", "bound", "order", "slowing helps", "")
    rows = [
        (
            limit.name,
            limit.subject,
            limit.unit,
            bounds_in_words(lower[own], upper[own]),
            f"{limit.order} ({_ORDERS[limit.order]})",
            "yes" if constraints.slowing_exponents[own].any() else "no",
            "" if limit.promised else "a margin of the planner's, not verified",
        )
        for limit, own in zip(constraints.limits, constraints.slices, strict=True)
    ]
    return "\n".join(text_table([heads, *rows]))


def bounds_in_words(lower: Array, upper: Array) -> str:
    """Bounds as text: ± 10, -1 to 1.5, at most 5, at least 0.01; several numbers if they differ."""
    used = np.isfinite(lower) | np.isfinite(upper)  # rows of fewer bodies than there may be
    lower, upper = lower[used], upper[used]
    size = [f"{value:g}" for value in dict.fromkeys(np.where(np.isfinite(upper), upper, lower))]
    each = ", ".join(size)
    if np.isfinite(lower).all() and np.isfinite(upper).all():
        if (lower == -upper).all():
            return f"± {each}"
        pairs = dict.fromkeys(zip(lower.tolist(), upper.tolist(), strict=True))
        return ", ".join(f"{least:g} to {most:g}" for least, most in pairs)
    return f"at most {each}" if np.isfinite(upper).all() else f"at least {each}"


def _masses(p: DeltaParameters, least_payload: float | None) -> str:
    least = "" if least_payload is None else f"{least_payload:g} to "
    moved = f"platform {p.m1:g} kg, payload {least}{p.m2:g} kg"
    return f"{moved}, 3 arms {p.m3:g} kg, 3 pairs of bars {p.m4:g} kg"


def _inertias(p: DeltaParameters) -> str:
    """Moments of inertia about the centres of mass, as text."""
    axes = (p.I41, p.I43) if p.I42 is None else (p.I41, p.I42, p.I43)
    bars = ", ".join(f"{moment:.4g}" for moment in axes)
    return f"arm {p.I33:.4g} kg·m²; bars {bars} kg·m²"


def _gravity(p: DeltaParameters) -> str:
    """The acceleration of gravity, as text."""
    if p.gravity is None:
        return "none"
    if p.g_y is None and p.g_z is None:
        return f"{p.g:g} m/s² downward (+x)"
    return f"{in_words(np.array(ca.DM(p.gravity)).ravel())} m/s² in the base's frame"


def _rotation(rotation: Rotation) -> str:
    return f"{rotation.angle:.4g} rad in {rotation.duration:.6f} s, the least that a motion takes"


def _baseline(scene: Scene) -> str:
    """The durations of the straight line, by a quintic law and, for time alone, as timed best."""
    try:
        quintic = f"straight line by a quintic law in {baseline(scene).duration:.6f} s"
        if not isinstance(scene.objective, Time):
            return quintic
        return f"{quintic}, timed optimally in {timed_line(scene).duration:.6f} s"
    except DeltaOptError as error:
        return f"none: {error}"
