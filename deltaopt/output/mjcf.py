"""A robot in MuJoCo's format (MJCF): rigid bodies that know nothing of this package's equations.

The platform is free to turn, and only the parallelograms keep it level, as in the real robot: each
chain is an arm and two bars, and every bar is joined to the platform at a point. Where the model
of this package has twelve coordinates under nine constraints, this one has twenty-one under
eighteen. Coulomb friction is not part of it: MuJoCo's own is not tanh (θ̇ / w); whoever simulates
applies ``Robot.drive.friction.coulomb`` from outside.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin
from xml.sax.saxutils import quoteattr

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Inexpressible, Unreachable
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.delta.arm_loads import FRICTION
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot

_LEAST_INERTIA = 1e-12
"""Moment of inertia about its own axis of a bar that is modelled as slender, as a share of that
across: MuJoCo wants numbers greater than 0, and nothing turns a bar about its axis."""

_STEP = 1e-4
"""Step of MuJoCo's integrator in the file, s; the miss at the goal falls with it."""
_STIFF = f'solref="{2 * _STEP} 1" solimp="0.9999 0.9999 0.001"'
"""Joints as stiff as MuJoCo permits: its own values suit contacts, and let the platform sag."""

TO_WORLD = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""From the base's frame to one whose third axis is up."""


def mjcf(robot: Robot, payload: float | None = None, start: Vector3 | None = None) -> str:
    """The robot with a payload (kg) as text in MuJoCo's format; world axes with z up.

    World (X, Y, Z) are the base's (z, y, -x). Joints ``arm1`` to ``arm3`` are the motor angles,
    motors ``motor1`` to ``motor3`` their torques in N·m; site ``tool`` is the tool's point. The
    reference configuration of MuJoCo, all joints at 0, has the tool's point at ``start`` (m, base's
    frame), by default below the base's centre. Raises Unreachable where that cannot be, and
    Inexpressible for a term of the robot's model that the format does not have.
    """
    model = delta_model(robot, payload)
    for load in model.numbers.loads:
        if not isinstance(load, FRICTION):
            raise Inexpressible(
                f"MuJoCo's format has no {load.words} of an arm, which the robot has"
            )
    place = _below_the_base(robot) if start is None else np.array(start)
    q = model.inverse_kinematics(place)
    centre, world = place - robot.tool_offset, TO_WORLD @ robot.gravity_vector
    chains = "\n".join(_chain(robot, k, q) for k in range(3))
    connections = "\n".join(
        f'<connect site1="tip{k + 1}{side}" site2="corner{k + 1}{side}" {_STIFF}/>'
        for k in range(3)
        for side in _SIDES
    )
    motors = "\n".join(f'<motor name="motor{k}" joint="arm{k}"/>' for k in (1, 2, 3))
    return f"""<mujoco model={quoteattr(robot.name)}>
<compiler angle="radian"/>
<option timestep="{_STEP}" integrator="implicitfast" gravity="{_text(world)}"/>
<worldbody><body name="base" xyaxes="0 0 -1 0 1 0">
{_platform(robot, payload, centre)}
{chains}
</body></worldbody>
<equality>
{connections}
</equality>
<actuator>
{motors}
</actuator>
</mujoco>
"""


_SIDES = {"a": 1.0, "b": -1.0}
"""The two bars of a parallelogram, and on which side of the chain's plane they are."""


def _half_width(robot: Robot) -> float:
    """Half the width of the parallelograms, m. Robot files do not give it: it decides nothing as
    long as the platform stays level."""
    return robot.forearm.length / 10


def _platform(robot: Robot, payload: float | None, centre: Array) -> str:
    """Platform with pins, tool and payload: what it is made of sits at its centre or its tool's
    point, with a moment of inertia that no level platform feels."""
    mass = robot.platform.mass + 3 * (robot.platform.pins or 0.0)
    moment = mass * max(robot.platform_radius, _half_width(robot)) ** 2
    carried = [
        ("tool", (robot.tool and robot.tool.mass) or 0.0),
        ("payload", payload or 0.0),
    ]
    bodies = "\n".join(
        f'<body name="{name}_mass" pos="{_text(robot.tool_offset)}">{_point(each)}</body>'
        for name, each in carried
        if each
    )
    corners = "\n".join(
        f'<site name="corner{k + 1}{side}" pos="{_text(corner)}"/>'
        for k, azimuth in enumerate(AZIMUTHS)
        for side, sign in _SIDES.items()
        for corner in [_in_base(azimuth, 0, robot.platform_radius, sign * _half_width(robot))]
    )
    return f"""<body name="platform" pos="{_text(centre)}">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/>
<joint type="ball"/>
<inertial mass="{mass!r}" pos="0 0 0" diaginertia="{_text((moment, moment, moment))}"/>
<site name="tool" pos="{_text(robot.tool_offset)}"/>
{corners}
{bodies}</body>"""


def _chain(robot: Robot, k: int, q: Array) -> str:
    """An arm, its elbow and two bars, in the configuration q."""
    arm, drive, (q1, q2, q3) = robot.upper_arm, robot.drive, q[3 + 3 * k : 6 + 3 * k].tolist()
    azimuth, friction = AZIMUTHS[k], drive.friction
    along, across = arm.centre or (arm.length / 2, 0.0)
    moment = arm.mass * arm.length**2 / 12 if arm.inertia is None else arm.inertia
    armature = f' armature="{drive.inertia!r}"' if drive.inertia else ""
    damping = f' damping="{friction.viscous!r}"' if friction and friction.viscous else ""
    elbow = (
        f'<body name="elbow{k + 1}" pos="0 {arm.length!r} 0">{_point(robot.elbow.mass)}</body>'
        if robot.elbow and robot.elbow.mass
        else ""
    )
    bars = "\n".join(_bar(robot, f"{k + 1}{s}", sign, q2 - q1, q3) for s, sign in _SIDES.items())
    about_x = _text((cos(azimuth / 2), sin(azimuth / 2), 0, 0))
    about_z = _text((cos(q1 / 2), 0, 0, sin(q1 / 2)))
    return f"""<body name="shoulder{k + 1}" quat="{about_x}" pos="0 0 0">
<body name="arm{k + 1}" pos="0 {robot.base_radius!r} 0" quat="{about_z}">
<joint name="arm{k + 1}" axis="0 0 1" ref="{q1!r}"{armature}{damping}/>
<inertial mass="{arm.mass!r}" pos="{_text((-across, along, 0))}"
 diaginertia="{_text((moment, moment, moment))}"/>
{elbow}
{bars}
</body></body>"""


def _bar(robot: Robot, name: str, sign: float, bend: float, q3: float) -> str:
    """One bar, which hangs on its elbow by a universal joint and does not turn about itself."""
    bars = robot.forearm
    slender = bars.mass * bars.length**2 / 12
    I1, I2, I3 = bars.inertia or (slender, 0.0, slender)
    own = max(I2, _LEAST_INERTIA * max(I1, I3))
    c1, s1, c2, s2 = cos(bend / 2), sin(bend / 2), cos(q3 / 2), sin(q3 / 2)
    turned = (c1 * c2, c1 * s2 + 0.0, s1 * s2 + 0.0, s1 * c2 + 0.0)  # by q3 about x, then about z
    at = _text((0, robot.upper_arm.length, sign * _half_width(robot)))
    return f"""<body name="bar{name}" pos="{at}" quat="{_text(turned)}">
<joint axis="{_text((0, sin(q3), cos(q3)))}"/><joint axis="1 0 0"/>
<inertial mass="{bars.mass / 2!r}" pos="0 {bars.length / 2!r} 0"
 diaginertia="{_text((I1 / 2, own / 2, I3 / 2))}"/>
<site name="tip{name}" pos="0 {bars.length!r} 0"/></body>"""


def _point(mass: float) -> str:
    return f'<inertial mass="{mass!r}" pos="0 0 0" diaginertia="1e-14 1e-14 1e-14"/>'


def _in_base(azimuth: float, down: float, outward: float, sideways: float) -> Vector3:
    c, s = cos(azimuth), sin(azimuth)
    return down, c * outward - s * sideways, s * outward + c * sideways


def _below_the_base(robot: Robot) -> Array:
    """The tool's point with the arms horizontal, m; raises Unreachable if bars are too short."""
    reach = robot.base_radius + robot.upper_arm.length - robot.platform_radius
    depth2 = robot.forearm.length**2 - reach**2
    if depth2 <= 0:
        raise Unreachable("with horizontal arms the bars do not reach the platform: give a start")
    return np.array([depth2**0.5, 0.0, 0.0]) + robot.tool_offset


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
