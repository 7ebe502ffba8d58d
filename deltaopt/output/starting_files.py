"""A robot file and a scene file to start from, with every key there is and what it means.

Keys and comments are taken from the records that read the files, so that they cannot differ; only
the example values stand here. A key that is not needed is commented out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

from deltaopt.errors import DeltaOptError
from deltaopt.files.output_folder import write_texts
from deltaopt.files.validated_record import Record
from deltaopt.robot.robot import Robot
from deltaopt.scene.objective import EXPECTED_DURATION
from deltaopt.scene.scene import Scene

ROBOT_FILE, SCENE_FILE = "robot.yaml", "scene.yaml"

ROBOT = {
    "name": "my Delta",
    "base_radius": "225 mm",
    "platform_radius": "75 mm",
    "upper_arm.length": "315 mm",
    "upper_arm.mass": "1.2 kg",
    "forearm.length": "825 mm",
    "forearm.mass": "0.5 kg",
    "platform.mass": "0.8 kg",
    "drive.torque": "65 N*m",
    "drive.speed": "300 deg/s",
}
"""Values of the keys that a new robot file has, by their place: a robot of the size of the Hornet
565, with assumed masses."""
ROBOT_EXTRAS = {
    "source": "data sheet of ..., masses estimated",
    "upper_arm.inertia": "0.01 kg*m^2",
    "upper_arm.centre": "[150 mm, 0 mm]",
    "upper_arm.radius": "30 mm",
    "forearm.inertia": "[0.0284, 0.0, 0.0284]",
    "forearm.radius": "25 mm",
    "elbow.mass": "0.1 kg",
    "platform.pins": "50 g",
    "tool.offset": "[120 mm, 0 mm, 0 mm]",
    "tool.mass": "0.25 kg",
    "tool.radius": "30 mm",
    "tool.shapes": "[{capsule: {from: [0, 0, 0], to: [-0.1, 0, 0], radius: 0.02}}]",
    "drive.inertia": "0.02 kg*m^2",
    "drive.friction.viscous": "0.3 N*m*s/rad",
    "drive.friction.coulomb": "2 N*m",
    "drive.friction.speed": "0.05 rad/s",
    "drive.torque_curve": "[[0 deg/s, 65 N*m], [150 deg/s, 65 N*m], [300 deg/s, 40 N*m]]",
    "drive.torque_rate": "5000 N*m/s",
    "drive.rms_torque": "25 N*m",
    "drive.motor.peak_torque": "3.82 N*m",
    "drive.motor.rated_torque": "1.27 N*m",
    "drive.motor.max_speed": "6000 rpm",
    "drive.motor.inertia": "0.28 kg*cm^2",
    "drive.motor.curve": "[[0 rpm, 3.82 N*m], [3500 rpm, 3.82 N*m], [6000 rpm, 1.9 N*m]]",
    "drive.brake.inertia": "0.05 kg*cm^2",
    "drive.gear.ratio": "20",
    "drive.gear.efficiency": "94 %",
    "drive.gear.inertia": "0.12 kg*cm^2",
    "drive.gear.peak_torque": "65 N*m",
    "drive.gear.nominal_torque": "35 N*m",
    "drive.gear.input_speed": "6000 rpm",
    "gravity": "9.81 m/s^2",
    "joints.zero": "0 deg",
    "joints.sign": "1",
    "joints.arm": "[-60 deg, 90 deg]",
    "joints.ball": "55 deg",
    "workspace.depth": "[0.5 m, 1.0 m]",
    "workspace.radius": "0.5 m",
}
"""Examples of the keys that a robot need not have. With ``motor`` the drive's own numbers go."""
SCENE = {
    "robot": ROBOT_FILE,
    "payload": "1 kg",
    "start": "[800 mm, -150 mm, 0 mm]",
    "goal": "[800 mm, 150 mm, 0 mm]",
}
"""Values of the keys that a new scene file has."""
SCENE_EXTRAS = {
    "limits.torque": "85 %",
    "limits.speed": "250 deg/s",
    "limits.acceleration": "120 m/s^2",
    "limits.platform_speed": "5 m/s",
    "limits.specific_force": "80 m/s^2",
    "limits.torque_rate": "5000 N*m/s",
    "limits.jerk": "3000 m/s^3",
    "limits.joint_jerk": "20000 rad/s^3",
    "limits.parallel_singularity": "0.1",
    "limits.tilt_singularity": "0.1",
    "via": "[[780 mm, 0 mm, 30 mm]]",
    "approach.start.height": "25 mm",
    "approach.start.radius": "10 mm",
    "approach.goal.height": "25 mm",
    "approach.goal.radius": "10 mm",
    "rotation.angle": "90 deg",
    "rotation.speed": "2000 deg/s",
    "rotation.acceleration": "20000 deg/s^2",
    "path": "line",
    "tube": "5 mm",
    "objective": "time",
    "keep_out": "[{box: {from: [0.7, -0.02, -0.3], to: [1.2, 0.02, 0.3]}}]",
    "clearance": "2 mm",
    "robot_keeps_clear": "true",
    "duration": "0.5 s",
    **{key: value for key, value in ROBOT_EXTRAS.items() if key.startswith("tool.")},
}
"""Examples of the keys that a scene need not have."""

_ABOUT_ROBOTS = """\
# A Delta robot. Radii of base and platform are from their centre to the joints.
# Numbers are in SI units (m, kg, s, N, rad) or text with a unit, such as 350 mm or 4500 rpm.
# What stands behind a # is not read: remove the # before a key to use it, of a key within another
# one both. What is not named is not modelled.
# The base's frame: x points DOWN, y to motor 1; motors 2 and 3 follow at 120 and 240 degrees.
# Angles of the arms: 0 is level, positive is up.
"""
_ABOUT_SCENES = """\
# A move from rest to rest: which robot takes what from where to where.
# Points are [x, y, z] in the base's frame, where x points DOWN, so that a larger x is lower.
"""
CELL = """\
# A cycle: parts from a belt, over a wall and into a box, again and again; deltaopt plan finds the
# most parts a minute at which no motor gets too warm.
# Points are [x, y, z] in the base's frame, where x points DOWN, so that a larger x is lower.

robot: robot.yaml
start: [780 mm, 150 mm, -40 mm]          # above the first place in the box: the cycle ends there
clearance: 2 mm
tool: {radius: 15 mm}                    # what keeps clear, about the tool's point
limits: {rms_torque: 25 N*m}             # over a period; or drive.rms_torque of the robot
keep_out:                                # there all the time; a leg may have more of its own
  - box: {from: [770 mm, -10 mm, -400 mm], to: [1.2, 10 mm, 400 mm]}

cycle:                                   # legs: goal, what is carried there, and a wait
  # Where the part is when the cycle starts, and how fast the belt moves it on; 40 ms to grip
  - {goal: {at: [820 mm, -150 mm, -60 mm], belt: [0, 0, 300 mm/s]}, dwell: 40 ms}
  # With the part, which sticks out beyond the tool, to the second place; 30 ms to let go
  - {goal: [780 mm, 150 mm, 40 mm], payload: 0.5 kg, dwell: 30 ms, tool: {radius: 25 mm}}
  - {goal: {at: [820 mm, -150 mm, -220 mm], belt: [0, 0, 300 mm/s]}, dwell: 40 ms}
  - {goal: [780 mm, 150 mm, -40 mm], payload: 0.5 kg, dwell: 30 ms, tool: {radius: 25 mm}}
# period: 0.9 s                          # if it is given: the least heat in it
"""
"""A scene file of a packaging cell, with a cycle."""
_BESIDE: dict[str, tuple[Any, str]] = {
    "duration": (None, f"{EXPECTED_DURATION}: of a motion of least effort, jerk or torque rates"),
    "tool": (Robot.model_fields["tool"].annotation, "instead of the robot's"),
}
"""Types and meanings of the keys of a scene that its record takes apart before it reads them."""
_NO_KEYS = ("least_payload", "planned_links")
"""Fields of a scene that no file gives."""
_FILES = ("robot",)
"""Keys of a scene whose values are files."""


class FilesExist(DeltaOptError):
    """A file that would be made is there already."""


def write_starting_files(directory: Path, scene: str | None = None) -> list[Path]:
    """Write robot.yaml and scene.yaml into a directory, made if need be; returns their paths.

    ``scene``: the text of scene.yaml, by default that of a single motion with every key.

    Raises FilesExist where one of them exists, for somebody may have written in it, and OSError
    where they cannot be written.
    """
    texts = {ROBOT_FILE: robot_text(), SCENE_FILE: scene or scene_text()}
    for name in texts:
        if (directory / name).exists():
            raise FilesExist(
                f"{directory / name} exists and is not overwritten; name another folder"
            )
    return write_texts(directory, texts)


def robot_text() -> str:
    """A robot file with every key."""
    return _ABOUT_ROBOTS + "\n" + "\n".join(_lines(Robot, ROBOT, ROBOT_EXTRAS)) + "\n"


def scene_text() -> str:
    """A scene file with every key."""
    return _ABOUT_SCENES + "\n" + "\n".join(_lines(Scene, SCENE, SCENE_EXTRAS)) + "\n"


@dataclass(frozen=True)
class Key:
    """A key of a file: its ``name``, what it may be, the ``inner`` record that stands under it if
    it is a mapping of keys of its own, its ``default`` and whether it is ``required``."""

    name: str
    expected: str
    inner: type[Record] | None
    default: object
    required: bool


def keys_of(record: type[Record]) -> Iterator[Key]:
    """The keys that a file may have where it describes such a record, in their order."""
    for name, field in record.model_fields.items():
        if record is Scene and name in _NO_KEYS:
            continue
        inner = None if name in _FILES else _record_in(field.annotation)
        required = field.is_required()
        default = None if required else field.default
        yield Key(name, str(field.description), inner, default, required)
    if record is Scene:
        for name, (annotation, expected) in _BESIDE.items():
            yield Key(name, expected, _record_in(annotation), None, False)


def _lines(
    record: type[Record], used: Mapping[str, str], extras: Mapping[str, str], inside: str = ""
) -> Iterator[str]:
    """The lines of a record's keys, those of records in it indented."""
    for key in keys_of(record):
        place = f"{inside}{key.name}"
        is_used = any(each == place or each.startswith(f"{place}.") for each in used)
        mark = "  " * inside.count(".") + ("" if is_used else "#")
        if key.inner is None or place in used:
            value = used.get(place) or extras.get(place, "")
            yield f"{mark}{key.name}: {value}  # {key.expected}"
            continue
        about = f"  # {key.expected}" if place in _BESIDE else ""
        yield f"{mark}{key.name}:{about}"
        yield from _lines(key.inner, used, extras, f"{place}.")


def _record_in(annotation: Any) -> type[Record] | None:
    """The record that a field's type is, or may be; None for other types, and for those that are
    one of several records and told apart by what stands there."""
    found = _records_in(annotation)
    return found[0] if len(found) == 1 else None


def _records_in(annotation: Any) -> list[type[Record]]:
    if get_origin(annotation) is tuple:  # a list of records is written as a whole
        return []
    if isinstance(annotation, type) and issubclass(annotation, Record):
        return [annotation]
    return [record for each in get_args(annotation) for record in _records_in(each)]
