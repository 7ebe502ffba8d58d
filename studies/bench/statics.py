"""A robot at rest, apart from everything that plans: by triangles and by virtual work.

Kinematics and statics are written out anew; derivatives are differences of positions and energies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.robot.robot import Robot

_TILTED = np.array([0.0, 2 * np.pi / 3, 4 * np.pi / 3])
_RADIAL = np.stack([np.zeros(3), np.cos(_TILTED), np.sin(_TILTED)], axis=1)
"""The directions in which the arms reach outwards, (3, 3)."""
_DOWN = np.array([1.0, 0.0, 0.0])
_STEP = 1e-6
"""Of the upper arm's length: half the difference that derivatives are taken over."""


@dataclass(frozen=True)
class AtRest:
    """A robot at rest at N points; not a number where a chain does not close.

    ``torques``: of the motors, (N, 3), N·m. ``angles``: of the arms, (N, 3), rad. ``sideways``: of
    the bars to the planes of their arms, (N, 3), rad. ``alignments``: sin² between arms and bars,
    (N, 3). ``volumes``: of the bars' directions, (N,).
    """

    torques: Array
    angles: Array
    sideways: Array
    alignments: Array
    volumes: Array


@dataclass(frozen=True)
class Statics:
    """A robot at rest with a ``load``, kg, at its tool's point."""

    robot: Robot
    load: float

    def at(self, points: Array) -> AtRest:
        """At points of the tool, (N, 3), m."""
        robot = self.robot
        centres = points - np.array(robot.tool_offset)
        here = _chains(robot, centres)
        bars = (centres[:, None] - here.elbows) / robot.forearm.length
        size = _STEP * robot.upper_arm.length
        slopes, forces = np.empty((len(points), 3, 3)), np.empty((len(points), 3))
        for axis, step in enumerate(size * np.eye(3)):
            left, right = _chains(robot, centres - step), _chains(robot, centres + step)
            slopes[:, :, axis] = (right.angles - left.angles) / (2 * size)
            lower, upper = self._energy(centres - step, left), self._energy(centres + step, right)
            forces[:, axis] = (upper - lower) / (2 * size)
        torques = np.full((len(points), 3), np.nan)  # comparisons with it are false
        finite = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(forces).all(axis=1)
        good = np.asarray(finite)
        good &= np.abs(np.linalg.det(np.where(good[:, None, None], slopes, np.eye(3)))) > 0
        transposed = slopes[good].transpose(0, 2, 1)  # slopesᵀ τ = dV/dx
        torques[good] = np.linalg.solve(transposed, forces[good][:, :, None])[:, :, 0]
        closed = np.asarray(np.isfinite(bars).all(axis=(1, 2)))
        volumes = np.linalg.det(np.where(closed[:, None, None], bars, 0.0))
        return AtRest(torques, here.angles, here.sideways, here.alignments, volumes)

    def arms(self, angles: Array) -> Array:
        """Both ends of the middle line of each arm at angles (N, 3), rad: (N, 3, 2, 3), m."""
        out, down = np.cos(angles)[..., None] * _RADIAL, np.sin(angles)[..., None] * _DOWN
        shafts = np.broadcast_to(self.robot.base_radius * _RADIAL, out.shape)
        return np.stack([shafts, shafts + self.robot.upper_arm.length * (out - down)], axis=2)

    def forearms(self, points: Array) -> Array:
        """Both ends of the middle line of each pair of bars where the tool is at points (N, 3), m:
        (N, 3, 2, 3)."""
        centres = points - np.array(self.robot.tool_offset)
        elbows, outwards = _chains(self.robot, centres).elbows, self.robot.platform_radius * _RADIAL
        ends = [elbows + outwards, centres[:, None] + np.broadcast_to(outwards, elbows.shape)]
        return np.stack(ends, axis=2)

    def _energy(self, centres: Array, chains: _Chains) -> Array:
        """Potential energy of gravity but for a constant, (N,), J."""
        robot, g = self.robot, np.array(self.robot.gravity_vector)
        tool = (robot.tool and robot.tool.mass) or 0.0
        carried = robot.platform.mass + 3 * (robot.platform.pins or 0.0) + tool + self.load
        elbows = robot.elbow.mass if robot.elbow else 0.0
        moment = carried * centres
        moment = moment + robot.upper_arm.mass * chains.arm_centres.sum(axis=1)
        moment = moment + elbows * chains.elbows.sum(axis=1)
        moment = moment + robot.forearm.mass * (chains.elbows + centres[:, None]).sum(axis=1) / 2
        return np.asarray(-moment @ g)


@dataclass(frozen=True)
class _Chains:
    """Elbows and arms' centres of mass, as if the platform had no radius, (N, 3, 3), m; ``angles``,
    ``sideways``, ``alignments`` as of `AtRest`."""

    elbows: Array
    arm_centres: Array
    angles: Array
    sideways: Array
    alignments: Array


def _chains(robot: Robot, centres: Array) -> _Chains:
    arm, bar = robot.upper_arm.length, robot.forearm.length
    ahead, across_arm = robot.upper_arm.centre or (arm / 2, 0.0)
    elbows, masses, angles, sides, alignments = [], [], [], [], []
    for azimuth, radial in zip(_TILTED, _RADIAL, strict=True):
        across = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
        shaft = (robot.base_radius - robot.platform_radius) * radial
        away = centres - shaft
        sideways, outward, down = away @ across, away @ radial, away[:, 0]
        reach = np.hypot(outward, down)
        with np.errstate(all="ignore"):
            cosine = (arm**2 + reach**2 - (bar**2 - sideways**2)) / (2 * arm * reach)
            angle = np.arctan2(-down, outward) + np.arccos(cosine)  # the elbow outside
        along = np.cos(angle)[:, None] * radial - np.sin(angle)[:, None] * _DOWN
        turning = -np.sin(angle)[:, None] * radial - np.cos(angle)[:, None] * _DOWN
        elbow = shaft + arm * along
        rest = (centres - elbow) - sideways[:, None] * across
        with np.errstate(all="ignore"):
            inline = (rest * along).sum(1) / np.linalg.norm(rest, axis=1)
            sides.append(np.arcsin(sideways / bar))
        elbows.append(elbow)
        masses.append(shaft + ahead * along + across_arm * turning)
        angles.append(angle)
        alignments.append(1 - inline**2)
    parts = (elbows, masses, angles, sides, alignments)
    return _Chains(*(np.stack(part, axis=1) for part in parts))
