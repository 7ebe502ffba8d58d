"""A plan in a browser window of its own: the robot moves in three dimensions, by viser's server.

The page of ``deltaopt plan --report`` needs no server and says more; this is for looking around a
motion closely, and for other things that are drawn into the same scene.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import installed
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.mjcf import TO_WORLD
from deltaopt.plots.colours import BLACK, COLOURS, GREY
from deltaopt.plots.robot_view import chains
from deltaopt.robot.robot import Robot

_FROM = np.array([1.3, 0.4, 0.3])
"""Where the window looks from at first, in units of the robot's reach from its middle: all of the
robot is then seen, with y to the right and a little from above."""
_PATH_POINTS = 400
_WIDTH = 3.0
"""Of lines, in pixels."""


def to_world(points: Array) -> Array:
    """Points of the base's frame, (..., 3), m, in the window's."""
    return np.asarray(np.asarray(points) @ TO_WORLD.T, dtype=float)


def lines_of_robot(robot: Robot, x: Array, theta: Array) -> list[Array]:
    """Ends of the lines that the robot is drawn with, (lines, 2, 3), m, in the window's frame.

    Of each chain arm, elbow and both bars; last the platform and the tool. ``x``: the tool's point,
    (3,), m; ``theta``: motor angles, (3,), rad.
    """
    drawn = chains(robot, x, theta)
    found = []
    for chain in drawn:
        bars = zip(chain.elbow_ends, chain.platform_ends, strict=True)
        found.append([(chain.shaft, chain.elbow), tuple(chain.elbow_ends), *bars])
    corners = np.concatenate([chain.platform_ends for chain in drawn])
    platform = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    found.append([*platform, (np.asarray(x) - np.asarray(robot.tool_offset), np.asarray(x))])
    return [to_world(np.array(each)) for each in found]


class Viewer:
    """A server that shows a motion at the time of its slider, or one after the other while it
    plays."""

    def __init__(self, robot: Robot, trajectory: Trajectory, port: int) -> None:
        """Start a server that only this machine reaches. Raises MissingPackage without viser."""
        viser = installed("viser", "view")
        self.robot, self.trajectory = robot, trajectory
        self.server = server = viser.ViserServer(
            host="127.0.0.1", port=port, label="deltaopt", verbose=False
        )
        server.scene.set_up_direction("+z")
        motion = trajectory(trajectory.knots[0])
        middle = to_world(motion.x) / 2
        reach = robot.base_radius + robot.upper_arm.length + robot.forearm.length
        server.initial_camera.look_at = tuple(middle.tolist())
        server.initial_camera.position = tuple((middle + reach * _FROM).tolist())
        self.handles = [
            _lines(server, f"/robot/{name}", lines, colour)
            for name, lines, colour in zip(
                ("chain1", "chain2", "chain3", "platform"),
                lines_of_robot(robot, motion.x, motion.theta),
                (*COLOURS, BLACK),
                strict=True,
            )
        ]
        path = to_world(trajectory(trajectory.instants(_PATH_POINTS)).x)
        _lines(server, "/path", np.stack([path[:-1], path[1:]], axis=1), GREY)
        milliseconds = 1e3 * trajectory.duration
        gui = server.gui
        self.slider = gui.add_slider("time, ms", 0.0, milliseconds, milliseconds / 1000, 0.0)
        self.playing = gui.add_checkbox("play", initial_value=False)
        self.pace = gui.add_slider("pace, % of real time", 1.0, 100.0, 1.0, 10.0)
        self.torques = gui.add_text("torques, N·m", initial_value="", disabled=True)
        self.slider.on_update(lambda event: self.show(self.slider.value / milliseconds))
        self.show(0.0)

    def show(self, fraction: float) -> None:
        """Show the robot at a fraction of the duration."""
        motion = self.trajectory(self.trajectory.knots[0] + fraction * self.trajectory.duration)
        shown = lines_of_robot(self.robot, motion.x, motion.theta)
        for handle, lines in zip(self.handles, shown, strict=True):
            handle.points = lines.astype(np.float32)
        self.torques.value = ", ".join(f"{torque:.1f}" for torque in motion.tau)

    def advance(self, seconds: float) -> None:
        """Move on by what passes in the motion in so many seconds, if it plays; then begin anew."""
        if self.playing.value:
            later = self.slider.value + 1e3 * seconds * self.pace.value / 100
            self.slider.value = later if later <= 1e3 * self.trajectory.duration else 0.0
            self.show(self.slider.value / (1e3 * self.trajectory.duration))


def _lines(server: Any, name: str, lines: Array, colour: str) -> Any:
    rgb = tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5))
    points = lines.astype(np.float32)
    return server.scene.add_line_segments(
        name, points, colors=rgb, thickness=_WIDTH, thickness_units="screen"
    )
