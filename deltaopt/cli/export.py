"""Write a robot's model for other programs.

deltaopt export c ROBOT       kinematics and dynamics in C, for a controller; with a test program
deltaopt export c PLAN        the same, the plan's motion, and what plays it
deltaopt export mjcf ROBOT    bodies, joints and motors in MuJoCo's format, for a simulation
deltaopt export table PLAN    angles, speeds and accelerations of the motors, for a controller
deltaopt export ros2 PLAN     the same as a JointTrajectory of ROS 2, in YAML or in a bag
deltaopt export cam PLAN      the same as cams of a PLC (TwinCAT, CODESYS): quintic polynomials
deltaopt export schema        the JSON schema of plan.json, which holds the exact polynomials

PLAN is a folder that "deltaopt plan" wrote. A controller moves between the rows of a table by
polynomials of its own: cubic ones from angles and speeds, or quintic ones from accelerations too.
What that asks of the motors is computed and printed. Rows at the plan's own knots keep its limits
nearly to the last digit; rows at equal steps hide where torques jump.

Exit code: 0 written; 1 no table can be made; 2 bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from deltaopt.cli.arguments import folder, kilograms, positive
from deltaopt.cli.streams import present, print_written
from deltaopt.files.atomic_write import require_replaceable
from deltaopt.files.output_folder import all_or_none
from deltaopt.output.cam_tables import CamPieces, Cams, write_cams
from deltaopt.output.joint_table import (
    Cubic,
    Cycles,
    Interpolation,
    JointTable,
    OwnKnots,
    Quintic,
    Rows,
    checked_table,
    table_within_limits,
)
from deltaopt.output.saved_plan import SavedPlan, load_plan
from deltaopt.output.table_files import (
    DEGREES,
    RADIANS,
    of_controller,
    write_ros2_bag,
    write_ros2_yaml,
    write_table,
)
from deltaopt.robot.robot import load_robot

HELP = "write a plan for a controller, or a robot's model in C or for MuJoCo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    targets = parser.add_subparsers(title="targets", metavar="TARGET", required=True)
    c = targets.add_parser(
        "c", help="delta.h, delta.c and test_delta.c, of a plan plan.h and plan.c too: plain C99"
    )
    c.add_argument("of", type=Path, metavar="ROBOT|PLAN", help="robot file, or folder of a plan")
    c.add_argument(
        "-o", "--output", type=folder, default=Path("out/c"), metavar="DIR", help="default: out/c"
    )
    c.set_defaults(target=_c)
    mjcf = targets.add_parser("mjcf", help="one file in MuJoCo's format, without Coulomb friction")
    mjcf.add_argument("robot", type=Path, metavar="ROBOT", help="robot file")
    mjcf.add_argument("--payload", type=kilograms, metavar="KG", help="at the tool (default: none)")
    _add_file(mjcf, Path("out/robot.xml"))
    mjcf.set_defaults(target=_mjcf)
    table = targets.add_parser("table", help="a CSV file of motor angles over time")
    _add_table(table, Path("out/table.csv"), "FILE")
    _add_controller(table)
    _add_unit(table)
    table.set_defaults(target=_table)
    cam = targets.add_parser("cam", help="cams for TwinCAT and CODESYS, and their polynomials")
    _add_table(cam, Path("out/cam"), "DIR")
    _add_unit(cam)
    cam.add_argument(
        "--master-speed",
        type=positive,
        default=1.0,
        metavar="UNITS/S",
        help="of the master axis, its units per second (default: 1, so that its position is the "
        "time in s)",
    )
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
    ros2.add_argument(
        "--topic", default="/joint_trajectory", help="in a bag (default: %(default)s)"
    )
    ros2.set_defaults(target=_ros2)

    schema = targets.add_parser("schema", help="the JSON schema of plan.json")
    _add_file(schema, Path("out/plan.schema.json"))
    schema.set_defaults(target=_schema)


def _add_file(parser: argparse.ArgumentParser, output: Path) -> None:
    parser.add_argument(
        "-o", "--output", type=Path, default=output, metavar="FILE", help=f"default: {output}"
    )


def _add_table(parser: argparse.ArgumentParser, output: Path, kind: str) -> None:
    """Add what all tables of a plan have."""
    parser.add_argument("plan", type=Path, metavar="PLAN", help="folder of a plan")
    parser.add_argument(
        "--cycle",
        type=_rows,
        default=OwnKnots(),
        metavar="TIME",
        help='time between rows, such as 1ms; or "own-knots" (default)',
    )
    parser.add_argument(
        "--keep-limits", action="store_true", help="slow the motion until no limit is exceeded"
    )
    parser.add_argument(
        "--slower",
        type=positive,
        default=1.0,
        metavar="FACTOR",
        help="the plan's path so many times as slow, 3 for a first run (default: 1)",
    )
    parser.add_argument(
        "-o", "--output", type=folder, default=output, metavar=kind, help=f"default: {output}"
    )


def _add_controller(parser: argparse.ArgumentParser) -> None:
    """Add how a controller interpolates."""
    parser.add_argument(
        "--controller",
        choices=("cubic", "quintic"),
        default="quintic",
        help="how the controller interpolates (default: %(default)s)",
    )


def _add_unit(parser: argparse.ArgumentParser) -> None:
    """Add the unit of angles."""
    parser.add_argument(
        "--unit", choices=UNITS, default="rad", help="of angles (default: %(default)s)"
    )


INTERPOLATIONS: dict[str, Interpolation] = {
    each.name: each for each in (Cubic(), Quintic(), CamPieces())
}
UNITS = {"rad": RADIANS, "deg": DEGREES}


def _rows(text: str) -> Rows:
    """Where a table has rows, for argparse: own-knots, or a time with a unit."""
    if text == "own-knots":
        return OwnKnots()
    number = text.removesuffix("s").rstrip()
    scale = {"m": 1e-3, "µ": 1e-6, "u": 1e-6}.get(number[-1:], 1.0)
    try:
        cycle = float(number.rstrip("mµu")) * scale
    except ValueError:
        cycle = 0.0
    if not (text.endswith("s") and 1e-6 <= cycle <= 10):
        expected = "own-knots or a time from 1us to 10s, such as 1ms"
        raise argparse.ArgumentTypeError(f"{text!r} is not {expected}")
    return Cycles(cycle)


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.target(arguments))


def _c(arguments: argparse.Namespace) -> int:
    from deltaopt.output.controller_c import export_c, export_plan_c

    folder = arguments.output
    before = present(folder)
    if _is_plan(arguments.of):
        print_written(export_plan_c(load_plan(arguments.of).trajectory, folder), before)
    else:
        print_written(export_c(load_robot(arguments.of), folder), before)
    return 0


def _is_plan(file: Path) -> bool:
    """Whether a file is a plan's rather than a robot's."""
    return file.is_dir() or file.suffix == ".json"


def _mjcf(arguments: argparse.Namespace) -> int:
    from deltaopt.output.mjcf import mjcf

    text = mjcf(load_robot(arguments.robot), arguments.payload)
    return _write(arguments.output, lambda file: _write_text(file, text))


def _schema(arguments: argparse.Namespace) -> int:
    from deltaopt.output.plan_files import schema

    return _write(arguments.output, lambda file: _write_text(file, schema()))


def _write(file: Path, write: Callable[[Path], object]) -> int:
    """Write one file, whole or not at all, and say so. Raises OSError, which names it."""
    require_replaceable(file)
    before = present(file.parent)
    with all_or_none(file.parent) as folder:
        write(folder / file.name)
    print_written([file], before)
    return 0


def _write_text(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8")


def _table(arguments: argparse.Namespace) -> int:
    table, unit = _controllers_table(arguments), UNITS[arguments.unit]
    return _write(arguments.output, lambda file: write_table(file, table, unit))


def _cam(arguments: argparse.Namespace) -> int:
    plan, folder = _slower_plan(arguments), arguments.output
    before = present(folder)
    table = of_controller(_checked(plan, arguments), plan.scene.robot)
    cams = Cams.of(table, UNITS[arguments.unit], arguments.master_speed)
    way = f"{cams.master[-1]:.6g} units of the master axis"
    print(f"{len(cams.master)} points of each cam, over {way}")
    print_written(write_cams(folder, cams, plan.scene.robot.name), before)
    return 0


def _ros2(arguments: argparse.Namespace) -> int:
    table, joints = _controllers_table(arguments), tuple(arguments.joints)
    output: Path = arguments.output
    if output.suffix in (".yaml", ".yml"):
        return _write(output, lambda file: write_ros2_yaml(file, table, joints))
    before = present(output)
    print_written(write_ros2_bag(output, table, joints, arguments.topic), before)
    return 0


def _controllers_table(arguments: argparse.Namespace) -> JointTable:
    """The table of a saved plan in its controller's angles."""
    plan = _slower_plan(arguments)
    return of_controller(_checked(plan, arguments), plan.scene.robot)


def _slower_plan(arguments: argparse.Namespace) -> SavedPlan:
    """The saved plan, so many times as slow as is asked for."""
    plan = load_plan(arguments.plan)
    return replace(plan, trajectory=plan.trajectory.slowed(arguments.slower))


def _checked(plan: SavedPlan, arguments: argparse.Namespace) -> JointTable:
    """The table, after saying what its interpolation asks for, and the remedy."""
    make = table_within_limits if arguments.keep_limits else checked_table
    found = make(plan.scene, plan.trajectory, arguments.cycle, INTERPOLATIONS[arguments.controller])
    demand, duration = found.demand, found.table.t[-1] - found.table.t[0]
    slowed = found.slowed * arguments.slower
    print(f"{len(found.table.t)} rows, {duration:.6g} s, {slowed:.6g} times the plan's duration")
    most = f"{demand.share:.6g} of what {demand.subject}'s {demand.limit} may be"
    print(f"{found.interpolation.name} interpolation asks for {most}, at {demand.t:.6g} s")
    if not plan.scene.task.is_at_rest and slowed != 1:
        print(
            "an end moves, and slowed the motion meets it too late and too slowly: plan with "
            "tighter limits instead"
        )
    if not demand.kept:
        print(_remedy(plan, arguments))
    return found.table


def _remedy(plan: SavedPlan, arguments: argparse.Namespace) -> str:
    """What helps against a table that asks for too much."""
    kept = table_within_limits(
        plan.scene, plan.trajectory, arguments.cycle, INTERPOLATIONS[arguments.controller]
    )
    slower = (
        f"--keep-limits slows the plan by {100 * (kept.slowed - 1):.2g} %, and no limit is exceeded"
    )
    if isinstance(arguments.cycle, OwnKnots):
        return f"remedy: {slower}"
    best = INTERPOLATIONS["cam"] if arguments.controller == "cam" else Quintic()
    own = checked_table(plan.scene, plan.trajectory, OwnKnots(), best)
    how = "" if arguments.controller == best.name else f"--controller {best.name} "
    knots = f"{how}--cycle own-knots asks for {own.demand.share:.6g}"
    return f"remedy: {knots}, with {len(own.table.t)} rows; or {slower}"
