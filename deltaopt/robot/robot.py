"""Robot files: the lengths, masses, inertias, drives and ranges of a Delta robot, in SI units.

A quantity that is None is absent from the model, except an inertia: then the link is a slender bar.
"""

from __future__ import annotations

from math import hypot
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, SerializeAsAny

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.units import GRAVITY, INERTIA, LENGTH, MASS, SMALL_MASS, WIDTH
from deltaopt.files.validated_record import (
    Name,
    NonNegative,
    Number,
    Positive,
    Record,
    Text,
    Triple,
    Vector3,
    optional,
)
from deltaopt.files.yaml_file import read_yaml
from deltaopt.robot.drive import Drive
from deltaopt.robot.joints import Joints
from deltaopt.robot.machine import Machine, Workspace
from deltaopt.robot.tool import Tool

_RADIUS = "a length in m, greater than 0: how far it reaches from its middle line"


class UpperArm(Record):
    """The upper arm, which a motor turns: ``length`` 2 a₂ in m, ``mass`` m₃ in kg.

    ``inertia``: I₃,₃ in kg·m², about an axis parallel to the motor's through the centre of mass;
    None for a slender bar. ``centre``: of mass, along the line from shaft to elbow and across it,
    m; across is positive where a positive turn of the arm moves it. None for the middle.
    ``radius``: of the capsule about the line from shaft to elbow that holds the arm, m: it keeps
    clear of bodies. None for a line.
    """

    length: Annotated[Positive, LENGTH]
    mass: Annotated[NonNegative, MASS]
    inertia: Annotated[NonNegative, INERTIA] | None = None
    centre: Annotated[tuple[Number, Number], LENGTH] | None = optional(
        "two lengths in m: along the line shaft-elbow, and across it"
    )
    radius: Annotated[Positive, WIDTH] | None = optional(_RADIUS)


class Elbow(Record):
    """What turns with the arm at its elbow, such as pins, as a point: ``mass`` in kg."""

    mass: Annotated[NonNegative, SMALL_MASS]


class Forearm(Record):
    """The forearm, a parallelogram of two bars: ``length`` 2 a₃ in m, ``mass`` m₄ of both in kg.

    ``inertia``: the principal moments (I₄,₁, I₄,₂, I₄,₃) of the pair about its centre of mass, in
    kg·m²; None for slender bars. ``radius``: of the capsule about the middle line of the pair that
    holds both, m: it keeps clear of bodies. None for a line.
    """

    length: Annotated[Positive, LENGTH]
    mass: Annotated[NonNegative, MASS] = Field(
        description="a mass in kg (of the pair of bars), at least 0"
    )
    inertia: Annotated[tuple[NonNegative, NonNegative, NonNegative], INERTIA] | None = optional(
        "three principal moments of inertia in kg·m², each at least 0"
    )
    radius: Annotated[Positive, WIDTH] | None = optional(_RADIUS)

    def require_consistent(self) -> None:
        # I₁ = Σ m (y² + z²) and so on: none exceeds the other two together.  For a slender bar
        # two are equal and the third is 0, so rounding must be allowed for.
        if self.inertia and 2 * max(self.inertia) > sum(self.inertia) * (1 + 1e-9):
            expected = "moments in kg·m² of which none exceeds the sum of the other two"
            raise SceneError(None, "inertia", self.inertia, expected)


class Platform(Record):
    """The moving platform: ``mass`` in kg, without tool and payload.

    ``pins``: a mass in kg for each chain, which the platform carries beside its own.
    """

    mass: Annotated[Positive, MASS]
    pins: Annotated[NonNegative, SMALL_MASS] | None = optional(
        "a mass in kg for each chain, at least 0"
    )


class Robot(Machine):
    """A Delta robot as its file describes it.

    ``base_radius``: a₁, from the base's centre to the motors' axes, m. ``platform_radius``: a₄,
    from the platform's centre to the forearms, m. ``gravity``: downward, m/s², or a vector in the
    base's frame. ``source``: where the numbers come from. ``joints``: the controller's zero and
    sign of each motor, and ranges of the joints. ``workspace``: where the tool's point may be.
    Raises SceneError for values that cannot be used.

    Examples:
        >>> robot = deltaopt.Robot(
        ...     name="my Delta",
        ...     base_radius="225 mm",
        ...     platform_radius="75 mm",
        ...     upper_arm={"length": "315 mm", "mass": 1.2},
        ...     forearm={"length": "825 mm", "mass": 0.5},
        ...     platform={"mass": 0.8},
        ...     drive={"torque": 65.0, "speed": "300 deg/s"},
        ... )
        >>> robot.upper_arm.length
        0.315
    """

    name: Name = Field(description="the robot's name, a line of at most 200 printable characters")
    source: Text | None = optional("a text that says where the numbers come from")
    base_radius: Annotated[NonNegative, LENGTH]
    platform_radius: Annotated[NonNegative, LENGTH]
    upper_arm: UpperArm = Field(description="a mapping with the keys length and mass")
    forearm: Forearm = Field(description="a mapping with the keys length and mass")
    elbow: Elbow | None = optional("a mapping with the key mass")
    platform: Platform = Field(description="a mapping with the key mass")
    tool: Tool | None = optional("a mapping with some of the keys offset, mass, radius, shapes")
    drive: Drive = Field(
        description="a mapping with the key torque (N·m) and, if speeds are limited, speed (rad/s)"
    )
    gravity: Annotated[NonNegative | Triple, GRAVITY] = Field(
        default=9.81,
        description="an acceleration in m/s², at least 0, downward, or a vector [x, y, z]",
    )
    joints: Joints | None = optional("a mapping with some of the keys zero, sign, arm, ball")
    workspace: Workspace | None = optional("a mapping with some of the keys depth, radius")

    def __repr__(self) -> str:
        arm, forearm = 1e3 * self.upper_arm.length, 1e3 * self.forearm.length
        return f"<Robot {self.name}: arms {arm:.6g} mm, forearms {forearm:.6g} mm>"

    __str__ = __repr__

    @property
    def gravity_vector(self) -> Vector3:
        """Acceleration of gravity in the base's frame, m/s²."""
        return self.gravity if isinstance(self.gravity, tuple) else (self.gravity, 0.0, 0.0)

    def link_radius(self, link: int) -> float:
        """How far a link reaches from its line, m: 0 for arm 1, 1 for forearm 1, and so on."""
        part = self.forearm if link % 2 else self.upper_arm
        return part.radius or 0.0

    @property
    def has_links(self) -> bool:
        """Arms and forearms are known as capsules."""
        return True

    @property
    def size(self) -> float:
        """The length of an upper arm, m."""
        return self.upper_arm.length

    @property
    def lever(self) -> float:
        """The length of an upper arm, m: how far an elbow moves for a radian."""
        return self.upper_arm.length

    @property
    def reach(self) -> float:
        """The length of a stretched chain, m."""
        return self.upper_arm.length + self.forearm.length

    @property
    def farthest(self) -> float:
        """A distance from the base's centre that the tool's point never exceeds, m."""
        chain = self.base_radius, self.upper_arm.length, self.forearm.length, self.platform_radius
        return sum(chain) + hypot(*self.tool_offset)

    @property
    def width(self) -> float:
        """How far the motors' axes are farther out than the forearms at the platform, m."""
        return abs(self.base_radius - self.platform_radius)

    @property
    def platform_mass(self) -> float:
        """Of the platform, without pins, tool and payload, kg."""
        return self.platform.mass

    def on_axis(self, depth: float) -> Array:
        """The tool's point, (3,), m, with the platform on the robot's axis, at a depth from 0
        (chains folded) to 1 (stretched)."""
        arm, bars = self.upper_arm.length, self.forearm.length
        offset = self.base_radius - self.platform_radius
        lengths = (max(reach**2 - offset**2, 0) ** 0.5 for reach in (bars - arm, bars + arm))
        folded, stretched = lengths
        return np.array([folded + depth * (stretched - folded), 0.0, 0.0]) + self.tool_offset

    def require_consistent(self) -> None:
        # Let the platform's centre be p and u_k its horizontal component along chain k's
        # azimuth.  In the arm's plane, the parallelogram's lower end is then u_k − d from the
        # motor's axis radially, d = base_radius − platform_radius.  If the chain closes, that
        # end is no farther than arm + forearm from the axis, so |u_k − d| ≤ arm + forearm.  The
        # azimuths are 120° apart, so Σ u_k = 0 and the mean over k gives |d| ≤ arm + forearm.
        # Conversely, if |d| ≤ arm + forearm, every chain closes at a point straight below the
        # base's centre: there u_k = 0, and the depth brings the distance √(d² + depth²) to
        # arm + forearm.  With equality all chains are stretched flat and this is the only
        # point, so a robot that moves needs "<".
        gap = abs(self.base_radius - self.platform_radius) - self.upper_arm.length
        if self.forearm.length <= gap:
            expected = (
                f"a length in m greater than {gap:.6g}, what base_radius {self.base_radius:g}, "
                f"platform_radius {self.platform_radius:g} and upper_arm.length "
                f"{self.upper_arm.length:g} leave to bridge"
            )
            raise SceneError(None, "forearm.length", self.forearm.length, expected)


def as_delta(robot: Machine) -> Robot:
    """The robot itself, for what knows Deltas alone, such as their links and their files.

    Raises SceneError for another robot.
    """
    if not isinstance(robot, Robot):
        expected = "a Delta robot, the only one that this is known for"
        raise SceneError(None, "robot", robot.name, expected)
    return robot


def load_robot(path: str | Path) -> Robot:
    """Read a robot file.

    Raises SceneError, naming file and key, if it cannot be used.

    Examples:
        >>> robot = deltaopt.load_robot("problems/robots/orsino.yaml")
        >>> robot.forearm.length
        0.5
    """
    file = Path(path)
    content = read_yaml(file)
    if "robot" in content and "base_radius" not in content:
        raise SceneError(file, "", None, "the robot file that it names", "is a scene file")
    return Robot.from_content(content, file)


def _robot_of(content: Any) -> Any:
    """A robot of any kind as it is; a Delta's file, or its content, as a Delta."""
    if isinstance(content, str | Path):
        return load_robot(content)
    return content if isinstance(content, Machine) else Robot.model_validate(content)


AnyRobot = Annotated[SerializeAsAny[Machine], BeforeValidator(_robot_of)]
"""A field that holds a robot of any kind."""
