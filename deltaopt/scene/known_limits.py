"""Which limits there are, the keys that give them in a scene, and those that a scene has."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import create_model

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.validated_record import Record
from deltaopt.limits.joints import (
    ARM_RANGE,
    JOINT_JERK,
    SPEED_LIMIT,
    TORQUE_LIMIT,
    TORQUE_RATE_LIMIT,
    BallJoint,
    TorqueCurve,
    WithLeastPayload,
)
from deltaopt.limits.keep_out import MOST_SOLIDS, KeepOut, hull_limits, place_among_rows
from deltaopt.limits.limit import Described, Limit
from deltaopt.limits.links import LinkClearance
from deltaopt.limits.norms_and_ranges import MotorLimit
from deltaopt.limits.platform_motion import (
    PLATFORM_ACCELERATION,
    PLATFORM_JERK,
    PLATFORM_SPEED,
    SPECIFIC_FORCE,
)
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.limits.singularities import PARALLEL_SINGULARITY, TILT_SINGULARITY, SerialSingularity
from deltaopt.limits.tube import MOST_PARTS, Tube, parts_of
from deltaopt.limits.workspace import WORKSPACE_DEPTH, WORKSPACE_RADIUS, ApproachLimit
from deltaopt.robot.machine import Machine
from deltaopt.robot.solids import MOST_TRIANGLES, Convex, Polytope

_STANDS_STILL = 1e-9
"""Share of the largest rate of a path's pieces below which it turns back where a piece begins."""

LIMITS: tuple[Limit, ...] = (
    TORQUE_LIMIT,
    SerialSingularity(),
    SPEED_LIMIT,
    PLATFORM_ACCELERATION,
    TorqueCurve(),
    PLATFORM_SPEED,
    SPECIFIC_FORCE,
    ARM_RANGE,
    BallJoint(),
    WORKSPACE_DEPTH,
    WORKSPACE_RADIUS,
    PARALLEL_SINGULARITY,
    TILT_SINGULARITY,
    KeepOut(),
    *hull_limits(),
    Tube(),
    ApproachLimit(),
    LinkClearance(),
    TORQUE_RATE_LIMIT,
    PLATFORM_JERK,
    JOINT_JERK,
)
"""All kinds of limit, in the order of the constraint rows of a problem. Before bodies, the rows of
those that depend on torques stand once more, for the least payload of a range."""

_KEYS: dict[str, Any] = {
    limit.key.name: (limit.key.type | None, None) for limit in LIMITS if limit.key
}
_Keys: Any = create_model("_Keys", __base__=Record, **_KEYS)


class Limits(_Keys):  # type: ignore[misc]  # its fields are the keys of LIMITS
    """The limits of a scene by key; they may be tighter than those of the robot's drive.

    Examples:
        >>> limits = deltaopt.Limits(acceleration=40.0, platform_speed="3 m/s")
        >>> limits.platform_speed
        3.0
    """


def require_keys_of_limits(scene: Described) -> None:
    """Raise SceneError where what a scene gives under ``limits`` contradicts the robot."""
    for limit in LIMITS:
        if limit.key:
            limit.items(scene)


@lru_cache(maxsize=256)
def limits_of(scene: Described) -> SceneLimits:
    """The limits that apply in a scene, with their numbers.

    Raises SceneError for a payload that varies where a limit is not known to hold between both ends
    of its range.
    """
    if scene.least_payload is None:
        return SceneLimits.of(LIMITS, scene)
    place, lighter = LIMITS.index(KeepOut()), list[Limit]()
    for limit in LIMITS:
        constraints = SceneLimits.of([limit], scene).constraints
        if not constraints.of_torque.any():
            continue
        if not constraints.holds_between_payloads:
            masses, name = [scene.least_payload, scene.payload], limit.name
            expected = f"one mass, since the limit {name} may be exceeded between two that keep it"
            raise SceneError(None, "payload", masses, expected)
        lighter.append(WithLeastPayload(limit))
    return SceneLimits.of([*LIMITS[:place], *lighter, *LIMITS[place:]], scene)


def without_shares(limits: object, robot: Machine) -> object:
    """The content of the key ``limits``, with shares of the drive's such as "85 %" as numbers."""
    if not isinstance(limits, dict):
        return limits
    motors = {limit.key.name: limit for limit in LIMITS if isinstance(limit, MotorLimit)}
    return {
        key: motors[key].without_shares(value, robot) if key in motors else value
        for key, value in limits.items()
    }


def in_order_of_rows(found: Iterable[tuple[int, Convex]]) -> tuple[tuple[int, Convex], ...]:
    """Bodies that the tool's point keeps out of, each with its index, in the order of the rows of
    their limits."""
    return tuple(sorted(found, key=lambda each: place_among_rows(each[1])))


def require_limits_for_bodies(obstacles: Sequence[tuple[int, Convex]]) -> None:
    """Raise SceneError for more bodies, or for larger hulls, than limits can have."""
    if len(obstacles) > MOST_SOLIDS:
        expected = f"at most {MOST_SOLIDS} pairs of a body and a shape of the tool"
        raise SceneError(None, "keep_out", len(obstacles), expected)
    for index, each in obstacles:
        if isinstance(each, Polytope) and len(each.triangles) > MOST_TRIANGLES:
            expected = f"a hull, grown by the tool, of at most {MOST_TRIANGLES} triangles"
            raise SceneError(None, f"keep_out[{index}].hull", len(each.triangles), expected)


def require_limit_for_tube(tube: float, axis: Array) -> None:
    """Raise SceneError for a tube about more pieces than its limit can have, or where they turn
    back. ``axis``: polynomials over shares from 0 to 1 of the pieces, (pieces, powers, 3), m."""
    if len(parts_of(axis)) > MOST_PARTS:
        raise SceneError(None, "tube", tube, "a path of at most 7 rounded corners beside it")
    rates = np.linalg.norm(axis[:, 1], axis=1)
    if rates.min() <= _STANDS_STILL * rates.max():
        raise SceneError(None, "tube", tube, "a path that nowhere turns back")
