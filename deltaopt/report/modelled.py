"""What of a robot is modelled and what is not, in words."""

from __future__ import annotations

from deltaopt.mechanisms.delta.arm_loads import FRICTION
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene

_COLLISIONS = "collisions"
_OTHER_COLLISIONS = "collisions with anything but the bodies of the scene"
NEVER = ("elasticity", "play in joints", _COLLISIONS)
"""What no model of this package has."""


def modelled(scene: Scene) -> list[str]:
    """The terms that are in a scene's equations, one phrase each."""
    return [phrase for phrase, present in _terms(scene).items() if present]


def not_modelled(scene: Scene) -> list[str]:
    """The terms that are not, of those that the model could have and of all others."""
    left_out = [phrase for phrase, present in _terms(scene).items() if not present]
    kept_out = {_COLLISIONS: _OTHER_COLLISIONS} if scene.keep_out else {}
    return [*left_out, *(kept_out.get(phrase, phrase) for phrase in NEVER)]


def _terms(scene: Scene) -> dict[str, bool]:
    """Every term, and whether the scene's model has it."""
    robot, drive = as_delta(scene.robot), scene.robot.drive
    tool, parameters = robot.tool, delta_model(robot, scene.payload).numbers
    return {
        "masses and inertia of platform, arms and forearms": True,
        "payload": scene.payload is not None,
        "gravity": any(robot.gravity_vector),
        "inertia of the bars about their length": parameters.I42 is not None,
        "masses of the elbows": bool(robot.elbow and robot.elbow.mass),
        "masses of the pins at the platform": bool(robot.platform.pins),
        "a tool's mass or offset": bool(tool and (tool.mass or tool.offset)),
        "inertia of motors and gears": bool(drive.inertia),
        **{kind.words: False for kind in FRICTION},
        **{load.words: True for load in parameters.loads},
    }
