"""The robot as lines, seen from the side and a little from above. Up is up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from deltaopt.curves.piecewise import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.plots.colours import COLOURS
from deltaopt.robot.robot import Robot
from deltaopt.scene.links import LinkGeometry

_WIDTH = 0.1
"""Width of the parallelograms over their length, which no robot file gives; report.html draws them
as wide."""
_ASIDE, _FROM_ABOVE = 0.35, 0.3
"""Angles, rad, by which the view differs from one at right angles to the move: enough to see which
chain is in front, and little enough for the path to keep its shape."""
_BASE, _PLATFORM = "0.85", "0.6"


@dataclass(frozen=True)
class View:
    """A parallel projection. ``turn``: about the vertical, 0 with y to the right. ``tilt``: from
    above, 0 from the side and a quarter turn from the top; rad."""

    turn: float
    tilt: float

    def __call__(self, points: Array) -> Array:
        """Points of the base's frame, (..., 3), as across and up in the picture, (..., 2)."""
        x, y, z = np.moveaxis(np.asarray(points), -1, 0)
        across = cos(self.turn) * y + sin(self.turn) * z
        away = sin(self.turn) * y - cos(self.turn) * z  # x down, y right: z comes forward
        return np.stack([across, sin(self.tilt) * away - cos(self.tilt) * x], axis=-1)


def view_of_move(start: Array, goal: Array) -> View:
    """The view that has the goal to the right of the start. ``start``, ``goal``: (3,), m."""
    return View(_turn(start, goal) + _ASIDE, _FROM_ABOVE)


def along_move(start: Array, goal: Array, tilt: float) -> Callable[[Array], Array]:
    """Takes points (N, 3), m, to how far they are from the start along the move and up, (N, 2), mm,
    in a view at right angles to it with a `View`'s ``tilt``. ``start``, ``goal``: (3,), m."""
    view = View(_turn(start, goal), tilt)
    return lambda points: 1e3 * (view(points) - view(start))


def _turn(start: Array, goal: Array) -> float:
    _, y, z = goal - start
    return atan2(z, y) if hypot(y, z) > 0 else 0.0


class Chain:
    """Points of one chain in the base's frame, (3,), m: ``shaft`` and ``elbow``; beside them, (2,
    3), left and right: the corners of the base, ``base_ends``, and the ends of both bars,
    ``elbow_ends`` and ``platform_ends``."""

    def __init__(self, links: LinkGeometry, k: int) -> None:
        """The k-th from 0 on, at the first place of the tool's point."""
        side = np.array([0.0, -sin(AZIMUTHS[k]), cos(AZIMUTHS[k])])
        aside = links.forearm * _WIDTH / 2 * side
        both = np.array([-aside, aside])
        self.shaft, self.elbow = links.shafts[0, k], links.elbows[0, k]
        self.base_ends, self.elbow_ends = self.shaft + both, self.elbow + both
        self.platform_ends = links.pins[0, k] + both


def chains(robot: Robot, x: Array, theta: Array) -> list[Chain]:
    """The three chains with the tool's point at x, (3,), m, and the arms at theta, (3,), rad."""
    links = LinkGeometry(robot, np.asarray(x)[None], np.asarray(theta)[None])
    return [Chain(links, k) for k in range(3)]


def draw_robot(
    axes: Axes, robot: Robot, x: Array, theta: Array, view: View, *, strength: float = 1.0
) -> None:
    """Draw the robot with the tool's point at x, (3,), m, and the arms at theta, (3,), rad.

    ``strength``: how opaque, 0 to 1.
    """
    drawn = chains(robot, x, theta)
    base = np.concatenate([chain.base_ends for chain in drawn])
    axes.fill(*view(base).T, facecolor=_BASE, edgecolor="none", alpha=strength, zorder=1)
    for chain, colour in zip(drawn, COLOURS, strict=True):
        line: dict[str, Any] = {"color": colour, "alpha": strength, "solid_capstyle": "round"}
        for upper, lower in zip(chain.elbow_ends, chain.platform_ends, strict=True):
            axes.plot(*view(np.array([upper, lower])).T, linewidth=0.8, **line)
        axes.plot(*view(chain.elbow_ends).T, linewidth=1.6, **line)
        axes.plot(*view(np.array([chain.shaft, chain.elbow])).T, linewidth=2.6, **line)
    platform = np.concatenate([chain.platform_ends for chain in drawn])
    axes.fill(
        *view(platform).T,
        facecolor=_PLATFORM,
        edgecolor="0.3",
        linewidth=0.6,
        alpha=strength,
        zorder=3,
    )
    if any(robot.tool_offset):
        tool = np.array([np.asarray(x) - np.asarray(robot.tool_offset), x])
        axes.plot(*view(tool).T, color="black", linewidth=1.6, alpha=strength, zorder=3)
