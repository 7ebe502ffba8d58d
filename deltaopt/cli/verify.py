"""Verify a saved plan again, or measure a table that someone else made.

PLAN is a folder that "deltaopt plan" wrote, or its plan.json: the motion is verified as when it was
planned, or with --scene against a scene file. What plan.json says, and in a folder trajectory.csv,
must be as they were written and as the motion is. Of a cycle's folder all legs are verified, that
they follow one another, and the RMS torques.

TABLE.csv has a header with t (s) and theta1, theta2, theta3 (rad, or --unit deg) or x, y, z (m), at
any rate, with rates (dtheta1, vx) and accelerations (ddtheta1, ax) if they are known; names that
end in _deg, as theta1_deg, are of columns in degrees. It is
interpolated as a controller does, and measured: limits, duty of the motors, singularities. No scene
file is needed, only a robot.

With --with mujoco a plan's torques, and nothing else, drive the robot in MuJoCo, for ever shorter
steps: where do they lead, and does that converge to the goal?

Exit code: 0 it keeps every limit, and a plan arrives (in MuJoCo too) and its files agree, and the
speeds of a table are those of its angles or positions; 1 not so; 2 bad input.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from deltaopt.cli.arguments import WrongUsage, add_flag, add_json, kilograms
from deltaopt.cli.streams import print_json, say, say_failures
from deltaopt.errors import DeltaOptError, Singular, Unreachable, in_words, installed
from deltaopt.output.cycle_files import RECORD as CYCLE
from deltaopt.output.cycle_files import load_legs, verified_again
from deltaopt.output.foreign_table import ANGLES, ForeignTable, UnreadableTable, read_foreign_table
from deltaopt.output.in_words import duty_table, singularities_table, table
from deltaopt.output.mujoco_replay import MujocoReplay, replay_in_mujoco
from deltaopt.output.plan_files import RECORD, TABLE
from deltaopt.output.saved_plan import SavedPlan, load_plan, record_differences, table_difference
from deltaopt.output.table_files import UNITS
from deltaopt.robot.joints import Joints
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import load_robot
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.bounds import EXCESS
from deltaopt.verify.measures import Excess, MeasuredMotion
from deltaopt.verify.verification import Verification, verify


class NotMeasured(DeltaOptError):
    """A motion cannot be measured at all on a robot."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    words = "folder of a plan or of a cycle, or a table"
    parser.add_argument("motion", type=Path, metavar="PLAN|TABLE.csv", help=words)
    words = "hold a plan against this scene file (default: the scene in plan.json)"
    parser.add_argument("--scene", type=Path, metavar="SCENE", help=words)
    parser.add_argument("--robot", type=Path, metavar="ROBOT", help="robot file of a table")
    words = "of a table (default: none)"
    parser.add_argument("--payload", type=kilograms, metavar="KG", help=words)
    parser.add_argument("--unit", choices=UNITS, help="of angles in a table (default: rad)")
    words = (
        "how the controller interpolates a table: cubic from its rates, quintic from its "
        "accelerations too (default: from all that it has)"
    )
    parser.add_argument("--controller", choices=("cubic", "quintic"), help=words)
    add_json(parser)
    words = (
        "replay a plan's torques in another program too, which needs the extra mujoco: "
        "pip install -e '.[mujoco]' in the clone"
    )
    parser.add_argument("--with", dest="other", choices=("mujoco",), help=words)
    words = "a table's angles have the zero and sign of the robot's controller"
    add_flag(parser, "--controller-angles", words)


def run(arguments: argparse.Namespace) -> int:
    if arguments.motion.suffix.lower() == ".csv":
        return _measure(arguments)
    for name in ("robot", "payload", "unit", "controller", "controller_angles"):
        if getattr(arguments, name):
            option = f"--{name.replace('_', '-')}"
            raise WrongUsage(f"{option} is for a TABLE.csv; a saved plan has its own")
    if (arguments.motion / CYCLE).is_file():
        return _cycle(arguments)
    if arguments.other:
        installed("mujoco", "mujoco")
    saved = load_plan(arguments.motion)
    scene = load_scene(arguments.scene) if arguments.scene else saved.scene
    found = verify(scene, saved.trajectory)
    keys = [key for key, given in saved.scene if given != getattr(scene, key)]
    if keys and found.obstacles and not arguments.json:
        off = f"{', '.join(keys)} differ from those of {arguments.scene}"
        raise NotMeasured(f"{arguments.motion}: {off}; {'; '.join(found.obstacles)}")
    differences = _differences(arguments.motion, saved, None if arguments.scene else found.ok)
    replay = replay_in_mujoco(saved.trajectory) if arguments.other else None
    if arguments.json:
        told = {"plan": str(arguments.motion), **found.as_dict(), "differences": differences}
        told["ok"] = found.ok and not differences
        if replay is not None:
            told["mujoco"] = {
                **asdict(replay),
                "order": replay.order,
                "converges": replay.converges,
            }
        print_json(told)
    else:
        print(table(found, asked_for=saved.record.get("tolerance")))
        if replay is not None:
            print("\n".join(replay_lines(replay, found)))
    code = say_failures(found.failures())
    for difference in differences:
        say(f"deltaopt: {difference}")
    if replay is not None and found.judges_arrival and not replay.converges:
        code = say_failures(["in MuJoCo the torques do not lead to the goal"])
    return max(code, bool(differences))


def _cycle(arguments: argparse.Namespace) -> int:
    """Verify a saved cycle: its legs, that they join, its RMS torques, and its files."""
    if arguments.scene or arguments.other:
        raise WrongUsage("--scene and --with are for a plan, as each leg of a cycle is one")
    legs = load_legs(arguments.motion)
    found, differences = verified_again(arguments.motion, legs)
    for (folder, saved, _), leg in zip(legs, found.legs, strict=True):
        differences += _differences(folder, saved, leg.ok)
    torques = {"rms_torque": found.rms_torque, "rms_limits": found.rms_limits}
    if arguments.json:
        judged = {"ok": found.ok and not differences, "failures": found.failures()}
        told = {"cycle": str(arguments.motion), **judged, "period": found.period, **torques}
        print_json({**told, "differences": differences})
    else:
        print(f"{len(legs)} legs, a period of {found.period:.6g} s")
        for name, each in torques.items():
            print(f"  {name}: {'none' if each is None else f'{in_words(each)} N·m'}")
    code = say_failures(found.failures())
    for difference in differences:
        say(f"deltaopt: {difference}")
    return max(code, bool(differences))


def _differences(motion: Path, saved: SavedPlan, ok: bool | None) -> list[str]:
    """Where a plan's files do not agree with its motion; ``ok``: what its verification gives."""
    record = motion / RECORD if motion.is_dir() else motion
    sentences = [f"{record}: {each}" for each in record_differences(saved, ok)]
    if motion.is_dir():
        off = table_difference(motion / TABLE, saved.trajectory)
        sentences += [f"{motion / TABLE}: {off}"] if off else []
    return sentences


def replay_lines(replay: MujocoReplay, found: Verification) -> list[str]:
    """Lines that say where the torques led in MuJoCo, step by step, and whether to the goal."""
    lines = [
        f"  steps of {1e6 * step:.3g} µs: {1e3 * miss:.3g} mm from the goal"
        for step, miss in zip(replay.steps, replay.misses, strict=True)
    ]
    falls = f"the miss falls with the step (as its power {replay.order:.2f})"
    verdict = f"{falls}: it converges to the goal" if replay.converges else "it does not converge"
    if not (replay.converges or found.judges_arrival):
        verdict += ", as is to be expected: without feedback deviations grow too much (see above)"
    return ["the torques alone, replayed in MuJoCo:", *lines, f"  {verdict}"]


def _measure(arguments: argparse.Namespace) -> int:
    """Measure a table against the limits of its robot."""
    if arguments.scene:
        raise WrongUsage("--scene is for a saved plan; a TABLE.csv needs the robot it is for")
    if arguments.other:
        raise WrongUsage("--with is for a saved plan, which has torques; a TABLE.csv has none")
    if arguments.robot is None:
        raise WrongUsage("a TABLE.csv needs the robot it is for: --robot ROBOT")
    robot = load_robot(arguments.robot)
    rows = _rows(arguments, robot.joints or Joints())
    contradiction = rows.contradiction()
    doubts = [*filter(None, (contradiction, rows.missing_rows()))]
    for doubt in doubts:
        say(f"{arguments.motion}: {doubt}")
    try:
        trajectory = rows.trajectory(delta_model(robot, arguments.payload))
        ends = trajectory.path_inside([0.0, 1.0])[0]
        trajectory.model.inverse_kinematics(ends)
    except (Unreachable, Singular) as error:
        raise NotMeasured(f"{arguments.motion}: {error}") from None
    away = ends[np.linalg.norm(ends - ends[0], axis=1).argmax()]
    if not (away != ends[0]).any():
        raise UnreadableTable(f"{arguments.motion}: nothing moves in it")
    if cut := rows.cut_off():
        say(f"{arguments.motion}: {cut}")
        doubts.append(cut)
    scene = Scene(robot=robot, payload=arguments.payload, start=tuple(ends[0]), goal=tuple(away))
    motion = MeasuredMotion(scene, trajectory)
    excesses = list(motion.excesses().values())
    what = "motor angles" if rows.quantity == ANGLES else "positions"
    ok = contradiction is None and all(excess.value <= EXCESS for excess in excesses)
    if arguments.json:
        print_json(
            {
                "table": str(arguments.motion),
                "ok": ok,
                "doubts": doubts,
                "duration": trajectory.duration,
                "rows": len(rows.t),
                "interpolation": rows.interpolation,
                "limits": [asdict(excess) for excess in excesses],
                "duty": motion.duty().as_dict(),
                "singularities": [asdict(each) for each in motion.distances()],
            }
        )
        return int(not ok)
    print(
        f"{len(rows.t)} rows of {what} over {trajectory.duration:.6g} s, interpolation: "
        f"{rows.interpolation}"
    )
    for excess in excesses:
        print(f"  {_sentence(excess)}")
    print("\n".join([*duty_table(motion.duty()), *singularities_table(motion.distances())]))
    return int(not ok)


def _rows(arguments: argparse.Namespace, joints: Joints) -> ForeignTable:
    rows = read_foreign_table(arguments.motion)
    if rows.unused:
        say(f"columns that are not used: {', '.join(rows.unused)}")
    if arguments.controller == "cubic":
        rows = replace(rows, accelerations=None)
    if arguments.controller == "quintic" and rows.accelerations is None:
        raise WrongUsage(f"--controller is quintic, but {arguments.motion} has no accelerations")
    own = rows.quantity == ANGLES and (joints.zero, joints.sign) != (None, None)
    if own and not arguments.controller_angles:
        say(
            "angles are taken as the model's; with --controller-angles as the controller's, which "
            "have the zero and sign of the robot's joints"
        )
    if rows.unit and arguments.unit not in (None, rows.unit):
        raise WrongUsage(
            f"--unit is {arguments.unit}, but columns of {arguments.motion} are in deg"
        )
    per_radian = UNITS[arguments.unit or rows.unit or "rad"]
    found = rows.in_model(per_radian, joints if arguments.controller_angles else Joints())
    if problem := found.implausible():
        expected = "--unit deg is for degrees" if rows.quantity == ANGLES else "are they in mm?"
        raise UnreadableTable(f"{arguments.motion}, {problem}; {expected}")
    return found


def _sentence(excess: Excess) -> str:
    """How near a limit is, in words."""
    share, amount = f"{100 * abs(excess.value):.3g} %", f"{abs(excess.amount):.4g} {excess.unit}"
    side, of = ("beyond", "too much") if excess.value > EXCESS else ("within", "of it is left")
    where = f"{excess.subject} at t = {excess.t:.6g} s"
    return f"{excess.limit}: {amount} {side} its limit ({share} {of}), {where}"
