"""Signs, zero and order of a Delta's motors as a drawing: from above, and one arm from the side."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from deltaopt.curves.piecewise import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.plots.colours import BLACK, COLOURS, GREY
from deltaopt.plots.robot_view import View, chains, draw_robot
from deltaopt.plots.style import figure
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot

_ABOVE, _SIDE = View(0.0, pi / 2), View(0.0, 0.0)
_ARROW = 0.3
"""Length of the axes' arrows over the reach of the arms, base radius and arm together."""
_TURN = 40.0
"""Degrees, to which the arrows of a positive and a negative angle go."""


def draw(robot: Robot, x: Array, file: Path) -> None:
    """Draw a robot with its platform at x, (3,), m."""
    theta = DeltaModel(robot).inverse_kinematics(x)[[3, 6, 9]]
    with figure(file, 7.2, 4.2, title()) as page:
        above, side = page.subplots(1, 2)
        _from_above(above, robot, x, theta)
        _from_the_side(side, robot, x, theta)
        for axes in (above, side):
            axes.set_aspect("equal", adjustable="box")
            axes.set_axis_off()


def title() -> str:
    """The message, by the azimuths of the model."""
    turn = np.degrees(AZIMUTHS[1] - AZIMUTHS[0])
    return f"Motor 2 is {turn:.0f}° on from motor 1, x points down, an arm above level is positive"


def _from_above(axes: Axes, robot: Robot, x: Array, theta: Array) -> None:
    """Draw the order of the motors, seen by somebody who looks down on the robot."""
    axes.set_title("from above")
    draw_robot(axes, robot, x, theta, _ABOVE)
    reach = robot.base_radius + robot.upper_arm.length
    for k, (azimuth, colour) in enumerate(zip(AZIMUTHS, COLOURS, strict=True)):
        outward = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        across, up = _ABOVE(1.2 * reach * outward)
        axes.text(across, up, f"motor {k + 1}", color=colour, ha="center", va="center")
    for sign in (1, -1):  # clockwise is positive, since x points away
        angles = np.deg2rad(-sign * np.linspace(8, 112, 50))
        arc = 0.7 * reach * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        axes.plot(*arc.T, color=GREY, linewidth=0.9)
        _arrow(axes, arc[-2], arc[-1])
        across, up = 1.1 * arc[25]
        axes.text(across, up, f"{120 * sign:+d}°".replace("-", "−"), ha="left", va="center")
    corner = np.array([0.75, -0.95]) * reach
    _axis(axes, corner, _ABOVE, (0.0, _ARROW * reach, 0.0), "y")
    _axis(axes, corner, _ABOVE, (0.0, 0.0, _ARROW * reach), "z")
    axes.text(corner[0], corner[1] + 0.06 * reach, "$x$ points away", va="bottom")
    axes.set_xlim(-1.0 * reach, 1.5 * reach)
    axes.set_ylim(-1.5 * reach, 1.25 * reach)


def _from_the_side(axes: Axes, robot: Robot, x: Array, theta: Array) -> None:
    """Draw the plane of motor 1: zero and sign of its angle, and x downward."""
    axes.set_title("from the side; lengths as in the robot file, mm")
    draw_robot(axes, robot, x, theta, _SIDE, strength=0.3)
    first = chains(robot, x, theta)[0]
    shaft, elbow = _SIDE(first.shaft), _SIDE(first.elbow)
    arm = robot.upper_arm.length
    axes.plot(*np.array([shaft, elbow]).T, color=COLOURS[0], linewidth=2.6)
    level = np.array([shaft, shaft + np.array([1.25 * arm, 0.0])])
    axes.plot(*level.T, ":", color=BLACK, linewidth=1.0)
    axes.text(shaft[0] + 1.3 * arm, shaft[1], "0: level", va="center")
    for sign, name, va in ((1, "positive: up", "bottom"), (-1, "negative: down", "top")):
        angles = np.deg2rad(sign * np.linspace(2, _TURN, 50))
        arc = shaft + 1.12 * arm * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        axes.plot(*arc.T, color=GREY, linewidth=0.9)
        _arrow(axes, arc[-2], arc[-1])
        axes.text(arc[-1][0], arc[-1][1] + 0.06 * sign * arm, name, va=va)
    platform = np.array([x[0], 0.0, 0.0])
    for begin, end, key, length in (
        (first.shaft, np.zeros(3), "base_radius", robot.base_radius),
        (first.shaft, first.elbow, "upper_arm.length", arm),
        (first.elbow, first.platform_ends.mean(axis=0), "forearm.length", robot.forearm.length),
        (platform, first.platform_ends.mean(axis=0), "platform_radius", robot.platform_radius),
    ):
        _length(axes, _SIDE(begin), _SIDE(end), f"{key} {1e3 * length:.0f}")
    corner = np.zeros(2)
    _axis(axes, corner, _SIDE, (0.8 * arm, 0.0, 0.0), "x")
    _axis(axes, corner, _SIDE, (0.0, 0.6 * robot.base_radius, 0.0), "y")
    left, right = axes.get_xlim()
    axes.set_xlim(left, right + 0.9 * arm)
    axes.set_ylim(axes.get_ylim()[0] - 0.3 * arm, 1.2 * arm)  # for the names of lengths


def _length(axes: Axes, begin: Array, end: Array, name: str) -> None:
    """Draw a length beside its line, with its name."""
    along = (end - begin) / np.linalg.norm(end - begin)
    aside = 0.05 * np.array([along[1], -along[0]])
    points = np.array([begin, end]) + aside
    style = {"arrowstyle": "<->", "color": GREY, "shrinkA": 0, "shrinkB": 0, "linewidth": 0.8}
    axes.annotate("", points[1].tolist(), points[0].tolist(), arrowprops=style)
    across, up = points.mean(axis=0) + aside / 2
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    turn = turn - 180 if turn > 90 else turn + 180 if turn < -90 else turn
    axes.text(across, up, name, rotation=turn, va="center", ha="center", fontsize=7, color=GREY)


def _axis(
    axes: Axes, origin: Array, view: View, along: tuple[float, float, float], name: str
) -> None:
    """Draw an axis of the base's frame from a point of the picture."""
    tip = view(np.array(along))
    _arrow(axes, origin, origin + tip)
    across, up = origin + 1.25 * tip
    axes.text(across, up, f"${name}$", ha="center", va="center")


def _arrow(axes: Axes, begin: Array, end: Array) -> None:
    style = {"arrowstyle": "-|>", "color": BLACK, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.0}
    axes.annotate("", (end[0], end[1]), (begin[0], begin[1]), arrowprops=style)
