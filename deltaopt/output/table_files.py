"""Joint tables as files: CSV, and ROS 2's JointTrajectory as YAML or in a bag.

Angles, speeds and accelerations in them are the controller's: its zero and sign for each motor.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import installed
from deltaopt.files.atomic_write import atomic_write, write_text
from deltaopt.files.csv_table import write_csv
from deltaopt.files.output_folder import all_or_none
from deltaopt.output.joint_table import JointTable
from deltaopt.robot.joints import Joints
from deltaopt.robot.robot import Robot

COLUMNS = ("t", *(name + motor for name in ("theta", "dtheta", "ddtheta") for motor in "123"))
MESSAGE = "trajectory_msgs/msg/JointTrajectory"
_NANO = 1_000_000_000
_BAG_VERSION = 9
"""Of the bag's metadata, as ROS 2 Humble and later read it."""


UNITS = {"rad": 1.0, "deg": 180 / pi}
"""How many of each unit that angles in a table may have are a radian, by its name."""


def of_controller(table: JointTable, robot: Robot) -> JointTable:
    """A table of the model's angles in those of a robot's controller, rad."""
    joints = robot.joints or Joints()
    return replace(
        table,
        theta=joints.angle_to_controller(table.theta),
        dtheta=joints.rate_to_controller(table.dtheta),
        ddtheta=joints.rate_to_controller(table.ddtheta),
    )


def write_table(file: Path, table: JointTable, unit: str) -> None:
    """Write the rows of a table as CSV with ``COLUMNS``: s, the unit, and the unit by s and s².
    Names of columns of angles end in the unit where it is not rad, as ``theta1_deg``."""
    angles = UNITS[unit] * np.hstack([table.theta, table.dtheta, table.ddtheta])
    rows = np.hstack([table.t[:, None], angles]).tolist()
    ending = "" if unit == "rad" else f"_{unit}"
    write_csv(file, ("t", *(name + ending for name in COLUMNS[1:])), rows, table.remarks)


def write_ros2_yaml(file: Path, table: JointTable, names: tuple[str, str, str]) -> None:
    """Write a table as a JointTrajectory in YAML, as ``ros2 topic pub`` reads it.

    ``names``: of the joints. Times are whole nanoseconds; where accelerations jump, the second of
    two points is a nanosecond later, since times must increase.
    """
    lines = [f"# {remark}" for remark in table.remarks]
    lines.append("header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}")
    quoted = ("'" + name.replace("'", "''") + "'" for name in names)
    lines.append(f"joint_names: [{', '.join(quoted)}]")
    lines.append("points:")
    for (seconds, rest), positions, velocities, accelerations in _points(table):
        lines.append(f"- positions: {positions.tolist()}")
        lines.append(f"  velocities: {velocities.tolist()}")
        lines.append(f"  accelerations: {accelerations.tolist()}")
        lines.append(f"  time_from_start: {{sec: {seconds}, nanosec: {rest}}}")
    write_text(file, "\n".join(lines) + "\n")


def write_ros2_bag(
    directory: Path, table: JointTable, names: tuple[str, str, str], topic: str
) -> list[Path]:
    """Write a table as one JointTrajectory message in a bag (a folder with an MCAP file), without
    ROS, and return the paths of its files. Remarks are its custom data.

    Raises MissingPackage if the package rosbags is not installed.
    """
    installed("rosbags", "ros2")
    bags, typing = import_module("rosbags.rosbag2"), import_module("rosbags.typesys")
    store = typing.get_typestore(typing.Stores.ROS2_HUMBLE)
    message = _message(store.types, table, names)
    with tempfile.TemporaryDirectory() as elsewhere, all_or_none(directory) as folder:
        bag, plugin = Path(elsewhere) / directory.name, bags.StoragePlugin.MCAP
        with bags.Writer(bag, version=_BAG_VERSION, storage_plugin=plugin) as writer:
            for number, remark in enumerate(table.remarks, 1):
                writer.set_custom_data(f"remark {number}", remark)
            connection = writer.add_connection(topic, MESSAGE, typestore=store)
            writer.write(connection, 0, store.serialize_cdr(message, MESSAGE))
        files = sorted(bag.iterdir())
        for file in files:
            with atomic_write(folder / file.name) as temporary:
                shutil.copyfile(file, temporary)
    return [directory / file.name for file in files]


def _message(types: Any, table: JointTable, names: tuple[str, str, str]) -> Any:
    """The message of a table, made of a type store's types."""
    time, duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    one = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    points = [
        one(
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
            effort=np.zeros(0),
            time_from_start=duration(*since),
        )
        for since, positions, velocities, accelerations in _points(table)
    ]
    header = types["std_msgs/msg/Header"](stamp=time(sec=0, nanosec=0), frame_id="")
    return types[MESSAGE](header=header, joint_names=list(names), points=points)


def _points(table: JointTable) -> Iterator[tuple[tuple[int, int], Array, Array, Array]]:
    """The points of a JointTrajectory: time from the start (s and ns), positions, velocities and
    accelerations, (3,) each."""
    last, columns = -1, (table.theta, table.dtheta, table.ddtheta)
    for t, *row in zip(table.t - table.t[0], *columns, strict=True):
        last = max(round(t * _NANO), last + 1)
        yield divmod(last, _NANO), *row
