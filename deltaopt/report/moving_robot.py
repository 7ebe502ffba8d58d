"""What the page's script needs to draw a moving robot: numbers, in SI units, as JSON has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, isnan, sin

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.motion.active_limits import ActiveLimit, share_curves
from deltaopt.motion.motion_sequence import MotionSequence
from deltaopt.motion.trajectory import Trajectory, ends_of
from deltaopt.output.body_outlines import axis_points, columns_of, edges_of, hulled_points
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.clearance import clearances

FRAMES = 400
"""Steps of the page's slider. A motion of 0.2 s has one each half millisecond; more would make the
page larger and nothing visible."""
_SAMPLES = 1000
"""Samples of each curve, at least; about the pixels of a chart's width."""
_DISC = 0.4
"""Radius of the disc that stands for a half-space, as a share of the length of a chain."""
_MOST_PER_INTERVAL = 64
"""Samples of each curve within an interval, at most."""
_Name = tuple[str, str]
"""Of a curve: its limit and subject."""


@dataclass(frozen=True)
class Moving:
    """A motion that is drawn, for a scene, and the limits that it is at."""

    scene: Scene
    trajectory: Trajectory
    active: tuple[ActiveLimit, ...]


def drawing(parts: Sequence[Moving]) -> dict[str, object]:
    """Everything the script draws of motions one after the other: the robot's shape, its frames,
    curves of limits, bands. A limit that some have alone is not used, 0, in the others."""
    whole, first = MotionSequence(tuple(part.trajectory for part in parts)), parts[0]
    start, goal = ends_of(problem_of(first.scene), first.trajectory).tolist()
    frames = whole(np.linspace(0.0, whole.duration, FRAMES + 1))
    intervals = len(whole.knots) - 1
    steps = min(_MOST_PER_INTERVAL, max(2, -(-_SAMPLES // intervals)))
    inside = np.linspace(0, 1, steps)  # 0 and 1: both sides of a jump at a knot
    t = (whole.knots[:-1, None] + np.diff(whole.knots)[:, None] * inside).ravel()
    finely = np.linspace(0, 1, _MOST_PER_INTERVAL)
    curves, spans = dict[_Name, Array](), dict[_Name, list[object]]()
    near, least = dict[str, Array](), dict[str, float]()
    before = 0
    for part, begins in zip(parts, whole.begins.tolist(), strict=False):
        since = begins - part.trajectory.knots[0]
        shares = share_curves(problem_of(part.scene), part.trajectory, inside)
        for name, own in shares.items():
            curves.setdefault(name, np.zeros(len(t)))[before : before + len(own)] = own
        for body, distances in _clearances(part, inside).items():
            values = near.setdefault(body, np.full(len(t), np.nan))
            values[before : before + len(distances)] = 1e3 * distances
        for body, distances in _clearances(part, finely).items():
            least[body] = min(least.get(body, np.inf), 1e3 * float(distances.min()))
        before += steps * (len(part.trajectory.knots) - 1)
        for each in part.active:
            held = [[span.begin + since, span.end + since, span.upper] for span in each.spans]
            spans.setdefault((each.limit, each.subject), []).extend(held)
    vias = dict.fromkeys(via for part in parts for via in part.scene.task.via)
    kept_out = [part.scene for part in parts if part.scene.keep_out]
    drawn = {repr(body): body for part in parts for body in bodies(part.scene)}
    return {
        "duration": whole.duration,
        "robot": shape(as_delta(first.scene.robot)),
        "start": start,
        "goal": goal,
        "via": [{"at": list(each.position), "within": each.within} for each in vias],
        "bodies": list(drawn.values()),
        "belts": [way for part in parts for way in _belts(part)],
        "frames": {name: _rounded(getattr(frames, name), 7) for name in ("t", "x", "theta")},
        "curves": {
            "t": _rounded(t, 7),
            "of": [
                {"limit": limit, "subject": subject, "values": _rounded(values, 4)}
                for (limit, subject), values in curves.items()
            ],
        },
        "clearance": {
            "asked": sorted({1e3 * scene.least_clearance for scene in kept_out}),
            "of": [
                {
                    "subject": body,
                    "values": [None if isnan(x) else round(x, 3) for x in values.tolist()],
                    "least": round(least[body], 3),
                }
                for body, values in near.items()
            ],
        },
        "active": [
            {"limit": limit, "subject": subject, "spans": held}
            for (limit, subject), held in spans.items()
        ],
    }


def bodies(scene: Scene) -> list[dict[str, object]]:
    """The keep-out bodies and, where ``stay`` says so, the cylinders and the tube that the motion
    stays in. Lengths in m: of a sphere its ``centre`` and ``radius``, of a tube the points of its
    ``axis`` and its ``radius``; of others the ``corners`` of which they are the convex hull, none
    for a half-space, and ``edges``, lines."""
    found: list[dict[str, object]] = []
    reach, about = _DISC * scene.robot.reach, np.array(scene.task.start.position)
    named = [(body.named(index), body) for index, body in enumerate(scene.keep_out or ())]
    kept_out = len(named)
    named += zip(("approach of the start", "approach of the goal"), columns_of(scene), strict=False)
    for index, (name, body) in enumerate(named):
        outline: dict[str, object]
        if body.sphere is not None:
            outline = {"centre": list(body.sphere.centre), "radius": body.sphere.radius}
        else:
            corners = [] if body.half_space else _rounded(hulled_points(body, reach), 6)
            edges = [_rounded(edge, 6) for edge in edges_of(body, about, reach)]
            outline = {"corners": corners, "edges": edges}
        found.append({"name": name, "stay": index >= kept_out, **outline})
    if scene.tube is not None:
        axis = _rounded(axis_points(scene), 6)
        found.append({"name": "tube", "stay": True, "axis": axis, "radius": scene.tube})
    return found


def _clearances(part: Moving, inside: Array) -> dict[str, Array]:
    """Distances, m, at fractions of every interval, (K n,), from each keep-out body of what keeps
    clear of it."""
    names = [body.named(index) for index, body in enumerate(part.scene.keep_out or ())]
    found = clearances(part.scene, part.trajectory.inside_intervals(inside))
    return dict(zip(names, np.min(list(found.values()), axis=0).T, strict=True))


def _belts(part: Moving) -> list[list[list[float]]]:
    """Where a goal on a belt is when the motion begins and when it ends, m; none at rest."""
    goal, motion = part.scene.task.goal, part.trajectory
    if not goal.moves:
        return []
    return [[list(goal.position), motion(motion.knots[[-1]]).x[0].tolist()]]


def shape(robot: Robot) -> dict[str, object]:
    """Lengths in m and azimuths of the chains as cosine and sine; the base's frame, x down.

    The width of the parallelograms, which no robot file gives, is drawn as a tenth of their length.
    """
    return {
        "base_radius": robot.base_radius,
        "platform_radius": robot.platform_radius,
        "arm": robot.upper_arm.length,
        "half_width": robot.forearm.length / 20,
        "tool": list(robot.tool_offset),
        "azimuths": [[cos(azimuth), sin(azimuth)] for azimuth in AZIMUTHS],
    }


def _rounded(values: Array, digits: int) -> object:
    """As lists; negative zeros become zero."""
    return (np.round(values, digits) + 0.0).tolist()
