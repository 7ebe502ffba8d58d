"""A scene: which robot is to move what, from where to where, within which limits.

It says what is wanted; how it is computed is a setting of the planner.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from deltaopt.errors import SceneError
from deltaopt.files.validated_record import Number, PerMotor, Positive, Record, Vector3, per_motor
from deltaopt.files.yaml_file import read_yaml
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.objective import EXPECTED, Objective, Time, content_of, objective_in

_ROBOT_FILE = "the path of a robot file, relative to the scene file"


class Limits(Record):
    """Limits at the arm that tighten the drive's: ``torque`` (N·m) and ``speed`` (rad/s)."""

    torque: PerMotor | None = Field(
        default=None, description="one torque in N·m, greater than 0, or three"
    )
    speed: PerMotor | None = Field(
        default=None, description="one angular speed in rad/s, greater than 0, or three"
    )


class Scene(Record):
    """A motion to plan: the platform's centre from ``start`` to ``goal`` (m, x down, at rest).

    ``payload`` m₂ is in kg; None means there is none in the model.
    """

    robot: Robot = Field(description=_ROBOT_FILE)
    payload: Positive | None = Field(default=None, description="a mass in kg, greater than 0")
    start: tuple[Number, Number, Number] = Field(description="three coordinates [x, y, z] in m")
    goal: tuple[Number, Number, Number] = Field(description="three coordinates [x, y, z] in m")
    limits: Limits | None = Field(
        default=None, description="a mapping with the keys torque, speed or both"
    )
    objective: Objective = Field(default=Time(), description=EXPECTED)

    @property
    def torque_limits(self) -> Vector3:
        """Largest torque of each motor at its arm in this scene, N·m."""
        if self.limits is None or self.limits.torque is None:
            return self.robot.torque_limits
        return per_motor(self.limits.torque)

    @property
    def speed_limits(self) -> Vector3 | None:
        """Largest speed of each arm in this scene, rad/s; None if there is no limit."""
        if self.limits is None or self.limits.speed is None:
            return self.robot.speed_limits
        return per_motor(self.limits.speed)

    @model_validator(mode="before")
    @classmethod
    def _read_objective(cls, content: Any) -> Any:
        return objective_in(content) if isinstance(content, dict) else content

    @model_serializer(mode="wrap")
    def _write_objective(self, rest: SerializerFunctionWrapHandler) -> dict[str, object]:
        return {**rest(self), **content_of(self.objective)}

    @classmethod
    def _keys(cls) -> list[str]:
        return [*super()._keys(), "duration"]

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if self.start == self.goal:
            raise SceneError(None, "goal", self.goal, "a point in m other than start")
        return self

    @model_validator(mode="after")
    def _limits_tighten_the_drive(self) -> Self:
        if self.limits is not None:
            _check_within(self.robot.torque_limits, self.limits.torque, "limits.torque", "N·m")
            _check_within(self.robot.speed_limits, self.limits.speed, "limits.speed", "rad/s")
        return self


def _check_within(
    drive: Vector3 | None, limit: float | Vector3 | None, key: str, unit: str
) -> None:
    if drive is None or limit is None:
        return
    if any(ours > its for ours, its in zip(per_motor(limit), drive, strict=True)):
        most = f"{drive[0]:g}" if len(set(drive)) == 1 else ", ".join(f"{d:g}" for d in drive)
        raise SceneError(None, key, limit, f"at most what the drive gives, {most} {unit}")


def load_scene(path: str | Path) -> Scene:
    """Read a scene file and its robot's; raise a `SceneError` if either cannot be used."""
    file = Path(path)
    content = read_yaml(file)
    if "robot" in content:
        content["robot"] = load_robot(_robot_file(file, content["robot"]))
    return Scene.from_content(content, file)


def _robot_file(scene_file: Path, value: object) -> Path:
    if isinstance(value, str) and os.path.isfile(scene_file.parent / value):
        return scene_file.parent / value
    problem = f"is {value!r}, which is no file" if isinstance(value, str) else ""
    raise SceneError(scene_file, "robot", value, _ROBOT_FILE, problem)
