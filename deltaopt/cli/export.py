"""Write a robot's model for other programs.

deltaopt export c ROBOT       kinematics and dynamics in C, for a controller; with a test program
deltaopt export c PLAN        the same, the plan's motion, and what plays it
deltaopt export mjcf ROBOT    bodies, joints and motors in MuJoCo's format, for a simulation
deltaopt export table PLAN    angles, speeds and accelerations of the motors, for a controller
deltaopt export ros2 PLAN     the same as a JointTrajectory of ROS 2, in YAML or in a bag
deltaopt export cam PLAN      the same as cams of a PLC (TwinCAT, CODESYS): quintic polynomials
deltaopt export schema        the JSON schema of plan.json, which holds the exact polynomials

PLAN is a folder that "deltaopt plan" wrote; tables of a cycle have all of its legs and the waits
between them. A controller moves between the rows of a table by polynomials of its own: cubic ones
from angles and speeds, or quintic ones from accelerations too. What that asks of the motors is
computed and printed. Rows at the plan's own knots keep its limits nearly to the last digit; rows at
equal steps hide where torques jump.

What is written keeps every limit: a motion is slowed by a thousandth at most for that, or nothing
is written and the remedies are named, each with its price. --keep-limits pays any price, --anyway
none: what is then beyond a limit stands in the head of the file, as does what verification finds
wrong with the plan.

Exit code: 0 written; 1 beyond a limit, nothing written; 2 bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from math import inf, isfinite
from pathlib import Path

from deltaopt.cli.arguments import WrongUsage, add_output, kilograms, positive
from deltaopt.cli.streams import present, print_written
from deltaopt.errors import DeltaOptError, Infeasible, if_possible
from deltaopt.files.atomic_write import require_replaceable, write_text
from deltaopt.files.output_folder import all_or_none
from deltaopt.files.units import DURATION, Misread
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.cam_tables import CAM, Cams, write_cams
from deltaopt.output.cycle_files import load_legs, told_of_period
from deltaopt.output.in_words import percent
from deltaopt.output.joint_table import (
    CUBIC,
    QUINTIC,
    CheckedTable,
    JointTable,
    Rows,
    checked_table,
    table_within_limits,
)
from deltaopt.output.saved_plan import SavedPlan, load_plan, record_differences
from deltaopt.output.table_files import (
    UNITS,
    of_controller,
    write_ros2_bag,
    write_ros2_yaml,
    write_table,
)
from deltaopt.robot.robot import Robot, as_delta, load_robot
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify


def add_arguments(parser: argparse.ArgumentParser) -> None:
    targets = parser.add_subparsers(title="targets", metavar="TARGET", required=True)
    c = targets.add_parser(
        "c", help="delta.h, delta.c and test_delta.c, of a plan plan.h and plan.c too: plain C99"
    )
    c.add_argument("of", type=Path, metavar="ROBOT|PLAN", help="robot file, or folder of a plan")
    _add_speed(c)
    add_output(c, Path("out/c"))
    c.set_defaults(target=_c)
    mjcf = targets.add_parser("mjcf", help="one file in MuJoCo's format, without Coulomb friction")
    mjcf.add_argument("robot", type=Path, metavar="ROBOT", help="robot file")
    mjcf.add_argument("--payload", type=kilograms, metavar="KG", help="at the tool (default: none)")
    add_output(mjcf, Path("out/robot.xml"), "FILE")
    mjcf.set_defaults(target=_mjcf)
    table = targets.add_parser("table", help="a CSV file of motor angles over time")
    _add_table(table, Path("out/table.csv"), "FILE")
    _add_controller(table)
    _add_unit(table)
    table.set_defaults(target=_table)
    cam = targets.add_parser("cam", help="cams for TwinCAT and CODESYS, and their polynomials")
    _add_table(cam, Path("out/cam"), "DIR")
    _add_unit(cam)
    words = (
        "of the master axis, its units per second (default: 1, so that its position is the "
        "time in s)"
    )
    cam.add_argument("--master-speed", type=positive, default=1.0, metavar="UNITS/S", help=words)
    cam.set_defaults(target=_cam, controller="cam")
    ros2 = targets.add_parser("ros2", help="trajectory_msgs/JointTrajectory")
    _add_table(ros2, Path("out/joint_trajectory.yaml"), "FILE.yaml|DIR")
    _add_controller(ros2)
    ros2.add_argument(
        "--joints",
        nargs=3,
        default=("motor1", "motor2", "motor3"),
        metavar="NAME",
        help="names of the three joints (default: motor1 motor2 motor3)",
    )
    words = "in a bag (default: %(default)s)"
    ros2.add_argument("--topic", default="/joint_trajectory", help=words)
    ros2.set_defaults(target=_ros2)

    schema = targets.add_parser("schema", help="the JSON schema of plan.json")
    add_output(schema, Path("out/plan.schema.json"), "FILE")
    schema.set_defaults(target=_schema)


def _add_table(parser: argparse.ArgumentParser, output: Path, kind: str) -> None:
    """Add what all tables of a plan have."""
    parser.add_argument("plan", type=Path, metavar="PLAN", help="folder of a plan")
    words = 'time between rows, such as 1ms; or "own-knots" (default)'
    parser.add_argument("--cycle", type=_rows, default=Rows(), metavar="TIME", help=words)
    _add_speed(parser)
    add_output(parser, output, kind)


def _add_speed(parser: argparse.ArgumentParser) -> None:
    """Add how slow a plan is to be, and what to do about limits."""
    either = parser.add_mutually_exclusive_group()
    words = (
        "slow a plan until no limit is exceeded, however much that takes (default: by a "
        "thousandth at most, otherwise nothing is written)"
    )
    either.add_argument("--keep-limits", action="store_true", help=words)
    words = "write a plan although it is beyond a limit or not verified; the file's head says so"
    either.add_argument("--anyway", action="store_true", help=words)
    words = "the plan's path so many times as slow, 3 for a first run (default: 1)"
    parser.add_argument("--slower", type=_slower, default=1.0, metavar="FACTOR", help=words)


def _add_controller(parser: argparse.ArgumentParser) -> None:
    """Add how a controller interpolates."""
    words = "how the controller interpolates (default: %(default)s)"
    parser.add_argument("--controller", choices=("cubic", "quintic"), default="quintic", help=words)


def _add_unit(parser: argparse.ArgumentParser) -> None:
    """Add the unit of angles."""
    words = "of angles (default: %(default)s)"
    parser.add_argument("--unit", choices=UNITS, default="rad", help=words)


INTERPOLATIONS = {each.name: each for each in (CUBIC, QUINTIC, CAM)}
_UNASKED = 1e-3
"""Share by which a motion is slowed without being asked, so that it keeps its limits: as much as a
plan may be longer than the optimum by default."""
_LATE = (
    "an end moves, and slowed the motion meets it too late or too slowly: plan with tighter "
    "limits instead"
)


class BeyondLimits(DeltaOptError):
    """A plan, or its table, asks for more than its limits, and nobody has insisted."""


def _rows(text: str) -> Rows:
    """Where a table has rows, for argparse: own-knots, or a time with a unit."""
    if text == "own-knots":
        return Rows()
    try:
        cycle = positive(str(DURATION.in_si(text)))
    except (Misread, argparse.ArgumentTypeError):
        cycle = 0.0
    if not (text.endswith("s") and 1e-6 <= cycle <= 10):
        expected = "own-knots or a time from 1us to 10s, such as 1ms"
        raise argparse.ArgumentTypeError(f"{text!r} is not {expected}")
    return Rows(cycle)


def _slower(text: str) -> float:
    """How many times as slow, for argparse: less would be a motion that nothing has verified."""
    factor = positive(text)
    if factor < 1:
        raise argparse.ArgumentTypeError(f"{text!r} would be faster than the plan: give 1 or more")
    return factor


def run(arguments: argparse.Namespace) -> int:
    output: Path = arguments.output
    before = present(output) or present(output.parent)
    print_written(arguments.target(arguments), before)
    return 0


def _c(arguments: argparse.Namespace) -> list[Path]:
    from deltaopt.output.controller_c import export_c, export_plan_c

    if arguments.of.is_dir() or arguments.of.suffix == ".json":
        plan = load_plan(arguments.of)
        in_time = not plan.scene.task.is_at_rest
        trajectory, remarks = _verified(plan, arguments.of, arguments, in_time)
        return export_plan_c(trajectory, arguments.output, remarks)
    if arguments.keep_limits or arguments.anyway or arguments.slower != 1:
        raise WrongUsage("--keep-limits, --anyway and --slower are for a PLAN, which moves")
    return export_c(load_robot(arguments.of), arguments.output)


def _mjcf(arguments: argparse.Namespace) -> list[Path]:
    from deltaopt.output.mjcf import mjcf

    return _text(arguments, mjcf(load_robot(arguments.robot), arguments.payload))


def _schema(arguments: argparse.Namespace) -> list[Path]:
    from deltaopt.output.plan_files import schema

    return _text(arguments, schema())


def _text(arguments: argparse.Namespace, text: str) -> list[Path]:
    return _one(arguments.output, lambda file: write_text(file, text))


def _table(arguments: argparse.Namespace) -> list[Path]:
    table, _ = _controllers_table(arguments)
    return _one(arguments.output, lambda file: write_table(file, table, arguments.unit))


def _one(file: Path, write: Callable[[Path], object]) -> list[Path]:
    """Write one file, whole or not at all. Raises OSError, which names it."""
    require_replaceable(file)
    with all_or_none(file.parent) as folder:
        write(folder / file.name)
    return [file]


def _cam(arguments: argparse.Namespace) -> list[Path]:
    table, robot = _controllers_table(arguments)
    cams = Cams(table, arguments.unit, arguments.master_speed)
    way = f"{cams.master[-1]:.6g} units of the master axis"
    print(f"{len(cams.master)} points of each cam, over {way}")
    return write_cams(arguments.output, cams, robot.name)


def _ros2(arguments: argparse.Namespace) -> list[Path]:
    (table, _), joints = _controllers_table(arguments), tuple(arguments.joints)
    output: Path = arguments.output
    if output.suffix in (".yaml", ".yml"):
        return _one(output, lambda file: write_ros2_yaml(file, table, joints))
    return write_ros2_bag(output, table, joints, arguments.topic)


def _controllers_table(arguments: argparse.Namespace) -> tuple[JointTable, Robot]:
    """The table of a saved plan or cycle in its controller's angles, with remarks on what is wrong,
    after saying what it asks for; and the robot. Raises BeyondLimits."""
    tables, how = list[JointTable](), INTERPOLATIONS[arguments.controller]
    legs, is_late = load_legs(arguments.plan), False
    in_time = not all(plan.scene.task.is_at_rest for _, plan, _ in legs)
    for folder, plan, wait in legs:
        if len(legs) > 1:
            print(f"{folder.name}:")
        tables.append(_checked(plan, folder, arguments, _rows_after(tables, arguments), in_time))
        is_late = is_late or tables[-1].duration > plan.duration * (1 + 1e-12)
        if is_late and not plan.scene.task.is_at_rest:
            print(_LATE)
            tables[-1] = replace(tables[-1], remarks=(*tables[-1].remarks, _LATE))
        if wait is not None:
            found = checked_table(plan.scene, wait, _rows_after(tables, arguments), how)
            if not (found.demand.kept or arguments.anyway):
                raise _refusal(f"the wait after {folder.name}: {found.sentence}", [])
            tables.append(found.table)
    table, robot = JointTable.one_after_the_other(tables), as_delta(legs[0][1].scene.robot)
    for sentence in told_of_period(arguments.plan, float(table.t[-1])) if len(legs) > 1 else ():
        print(sentence)
    remarks = tuple(dict.fromkeys(remark for each in tables for remark in each.remarks))
    return of_controller(replace(table, remarks=remarks), robot), robot


def _rows_after(tables: list[JointTable], arguments: argparse.Namespace) -> Rows:
    """Where the table of a motion has rows that follows others: at equal steps the last row of the
    one before is its first, for a controller takes one row at each. Cams tell of two."""
    rows: Rows = arguments.cycle
    if rows.cycle is None or arguments.controller == CAM.name or not tables:
        return rows
    return replace(rows, begins=tuple(tables[-1].ddtheta[-1].tolist()))


def _checked(
    plan: SavedPlan, file: Path, arguments: argparse.Namespace, rows: Rows, in_time: bool
) -> JointTable:
    """The table of a saved plan with remarks on what is wrong, after saying what it asks for.
    ``in_time``: whether it, or another leg of its cycle, is to meet an end that moves.
    Raises BeyondLimits."""
    trajectory, remarks = _verified(plan, file, arguments, in_time)
    given = plan.scene, trajectory, rows, INTERPOLATIONS[arguments.controller]
    found = checked_table(*given)
    if not (found.demand.kept or arguments.anyway):
        kept = table_within_limits(*given, in_time)
        if not _may_slow(in_time, arguments, kept.slowed / found.slowed - 1):
            raise _refusal(found.sentence, _remedies(plan.scene, trajectory, kept, in_time))
        found = kept
    duration, slowed = found.table.duration, found.table.duration / plan.duration
    print(f"{len(found.table.t)} rows, {duration:.6g} s, {slowed:.6g} times the plan's duration")
    print(found.sentence)
    if not found.demand.kept:
        remarks.append(found.sentence)
    return replace(found.table, remarks=tuple(remarks))


def _verified(
    plan: SavedPlan, file: Path, arguments: argparse.Namespace, in_time: bool
) -> tuple[Trajectory, list[str]]:
    """The motion of a saved plan so many times as slow as is asked for, and what is wrong with it:
    of what slowing cures only with --anyway. Raises BeyondLimits."""
    found = verify(plan.scene, plan.trajectory)
    edited = record_differences(plan, found.ok)
    remarks, slower, needed = [*found.failures(), *edited], arguments.slower, 0.0
    if remarks:
        beyond = {check.measure for check in found.checks() if not check.ok}
        cured = found.safe_duration if beyond <= set(found.excesses) and not edited else None
        needed = (cured or inf) / plan.duration
    if needed > slower and not arguments.anyway:
        if not _may_slow(in_time, arguments, needed / slower - 1):
            price = [f"--keep-limits ({percent(needed - 1)} slower)"]
            raise _refusal(f"{file}: {'; '.join(remarks)}", price if isfinite(needed) else [])
        slower = needed
    return plan.trajectory.slowed(slower), remarks if needed > slower else []


def _may_slow(in_time: bool, arguments: argparse.Namespace, extra: float) -> bool:
    """Whether a motion may be slowed by a share ``extra`` to keep its limits: not unasked by more
    than ``_UNASKED``, nor at all where it is to be ``in_time``."""
    return isfinite(extra) and (arguments.keep_limits or extra <= (0.0 if in_time else _UNASKED))


def _refusal(asks: str, remedies: list[str]) -> BeyondLimits:
    advice = f"; remedies, the cheapest first: {', '.join(remedies)}" if remedies else ""
    insist = "--anyway writes it, with this in the file's head"
    return BeyondLimits(f"{asks}; nothing is written{advice}; {insist}")


def _remedies(scene: Scene, trajectory: Trajectory, kept: CheckedTable, in_time: bool) -> list[str]:
    """Tables that keep the limits and cost no more than ``kept``, with their prices."""
    of_plc = kept.interpolation.name == "cam"
    tried = [
        if_possible((Infeasible,), table_within_limits, scene, trajectory, rows, how, in_time)
        for rows in dict.fromkeys((Rows(), kept.rows))
        for how in INTERPOLATIONS.values()
        if (how.name == "cam") == of_plc
    ]
    found = [each for each in tried if each is not None and each.slowed <= kept.slowed]
    found = sorted(found, key=lambda each: each.slowed)
    return [
        ("" if of_plc else f"--controller {each.interpolation.name} ")
        + f"--cycle {each.rows.name} --keep-limits "
        f"({len(each.table.t)} rows, {percent(each.slowed - 1)} slower)"
        for each in found
    ] + [_LATE] * in_time
