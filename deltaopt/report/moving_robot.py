"""What the page's script needs to draw a moving robot: numbers, in SI units, as JSON has them."""

from __future__ import annotations

from collections.abc import Iterable
from math import cos, sin

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.motion.active_limits import ActiveLimit, share_curves
from deltaopt.motion.trajectory import Trajectory, ends_of
from deltaopt.output.body_outlines import corners_of, edges_of
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.scene import Scene

FRAMES = 400
"""Steps of the page's slider. A motion of 0.2 s has one each half millisecond; more would make the
page larger and nothing visible."""
_SAMPLES = 1000
"""Samples of each curve, at least; about the pixels of a chart's width."""
_DISC = 0.4
"""Radius of the disc that stands for a half-space, as a share of the length of a chain."""
_MOST_PER_INTERVAL = 64
"""Samples of each curve within an interval, at most."""


def drawing(
    scene: Scene, trajectory: Trajectory, active: Iterable[ActiveLimit]
) -> dict[str, object]:
    """Everything the script draws: the robot's shape, its frames, curves of limits, bands."""
    begin = trajectory.knots[0]
    start, goal = ends_of(problem_of(scene), trajectory).tolist()
    frames = trajectory(trajectory.instants(FRAMES + 1))
    intervals = len(trajectory.knots) - 1
    steps = min(_MOST_PER_INTERVAL, max(2, -(-_SAMPLES // intervals)))
    inside = np.linspace(0, 1, steps)  # 0 and 1: both sides of a jump at a knot
    lengths = np.diff(trajectory.knots)
    t = (trajectory.knots[:-1, None] + lengths[:, None] * inside).ravel()
    return {
        "duration": trajectory.duration,
        "robot": shape(as_delta(scene.robot)),
        "start": start,
        "goal": goal,
        "via": [{"at": list(each.position), "within": each.within} for each in scene.task.via],
        "bodies": bodies(scene),
        "frames": {
            "t": _rounded(frames.t - begin, 7),
            "x": _rounded(frames.x, 7),
            "theta": _rounded(frames.theta, 7),
        },
        "curves": {
            "t": _rounded(t - begin, 7),
            "of": [
                {"limit": each.limit, "subject": each.subject, "values": _rounded(each.values, 4)}
                for each in share_curves(problem_of(scene), trajectory, inside)
            ],
        },
        "active": [
            {
                "limit": each.limit,
                "subject": each.subject,
                "spans": [
                    [span.begin - begin, span.end - begin, span.upper] for span in each.spans
                ],
            }
            for each in active
        ],
    }


def bodies(scene: Scene) -> list[dict[str, object]]:
    """The keep-out bodies, lengths in m: of a sphere its ``centre`` and ``radius``; of others the
    ``corners`` of which they are the convex hull, none for a half-space, and ``edges``, lines."""
    found: list[dict[str, object]] = []
    reach = _DISC * scene.robot.reach
    about = np.array(scene.task.start.position)
    for index, body in enumerate(scene.keep_out or ()):
        name = f"keep_out[{index}], a {body.kind}"
        if body.sphere is not None:
            ball = {"centre": list(body.sphere.centre), "radius": body.sphere.radius}
            found.append({"name": name, **ball})
            continue
        edges = [_rounded(edge, 6) for edge in edges_of(body, about, reach)]
        corners = [] if body.half_space else _rounded(corners_of(body, reach), 6)
        found.append({"name": name, "corners": corners, "edges": edges})
    return found


def shape(robot: Robot) -> dict[str, object]:
    """Lengths in m and azimuths of the chains as cosine and sine; the base's frame, x down.

    The width of the parallelograms, which no robot file gives, is drawn as a tenth of their length.
    """
    return {
        "base_radius": robot.base_radius,
        "platform_radius": robot.platform_radius,
        "arm": robot.upper_arm.length,
        "bars": robot.forearm.length,
        "half_width": robot.forearm.length / 20,
        "tool": list(robot.tool_offset),
        "azimuths": [[cos(azimuth), sin(azimuth)] for azimuth in AZIMUTHS],
    }


def _rounded(values: Array, digits: int) -> object:
    """As lists; negative zeros become zero."""
    return (np.round(values, digits) + 0.0).tolist()
