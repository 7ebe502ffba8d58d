"""Whether a move is possible, by a flood over a grid: apart from everything that plans.

Kinematics and statics are written out anew, by triangles and by virtual work with derivatives
from differences. A move is possible if a path leads from start to goal on which gravity leaves
every motor something to spare: as slowly as need be it can be driven. Robots may have neither a
tool offset nor centres of mass of their own, and gravity acts along x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

SPARE = 0.02
"""Share of every torque limit that gravity must leave on the path."""
_STEPS = (12, 24)
"""Steps of the grids along the reach of a chain, which are tried in turn. A passage narrower than a
step of the last is not found, so that a move may be possible that this does not call so; a grid
twice as fine takes a minute."""
_FOLDED, _FLAT = 1e-3, 5e-3
"""Least sin² of the angle between arm and bars, and least volume of the bars' directions, on the
path: nearer to singularities torques are known to few digits."""
_TILTED = np.array([0.0, 2 * np.pi / 3, 4 * np.pi / 3])
_BETWEEN = np.linspace(0.0, 1.0, 7)[1:, None]


def is_possible(scene: Scene) -> bool:
    """Whether a path over a grid is found that can be held with ``SPARE`` of the torques left.

    False, for it is not known, where the path is given, an end moves or bodies are in the way.
    """
    if scene.path is not None or scene.moves_at_ends or scene.keep_out:
        return False
    start, goal = (np.array(point) for point in scene.given_points)
    statics = _Statics.of(scene)
    side = float(np.sign(statics.at(start[None]).volumes[0]))

    def free(points: Array) -> Truths:
        found = statics.at(points)
        held = (np.abs(found.torques) <= (1 - SPARE) * statics.limits).all(axis=1)
        return held & (found.alignments > _FOLDED).all(axis=1) & (side * found.volumes > _FLAT)

    return any(_connected(start, goal, _grid(scene.robot, steps), free) for steps in _STEPS)


Free = Callable[[Array], Truths]
"""Points (N, 3), m -> at which of them the platform may be."""


def _connected(start: Array, goal: Array, points: Array, free: Free) -> bool:
    """Whether a path leads from start to goal over the points of a grid that are free."""
    allowed = free(points.reshape(-1, 3)).reshape(points.shape[:3])
    begun = _joined(start, points, allowed, free)
    ended = _joined(goal, points, allowed, free)
    return bool((_flooded(begun, points, allowed, free) & ended).any())


@dataclass(frozen=True)
class _At:
    """Torques at rest, (N, 3), N·m; sin² between arms and bars, (N, 3); volumes of the bars'
    directions, (N,). Not a number where a chain does not close."""

    torques: Array
    alignments: Array
    volumes: Array


@dataclass(frozen=True)
class _Statics:
    """The robot at rest with a ``load`` (kg), and the torque ``limits`` of its motors, N·m."""

    robot: Robot
    load: float
    limits: Array

    @classmethod
    def of(cls, scene: Scene) -> _Statics:
        return cls(scene.robot, scene.payload or 0.0, np.array(scene.robot.torque_limits))

    def at(self, points: Array) -> _At:
        elbows, _, alignments = self._chains(points)
        bars = (points[:, None] - elbows) / self.robot.forearm.length
        size = 1e-6 * self.robot.upper_arm.length
        slopes, forces = np.empty((len(points), 3, 3)), np.empty((len(points), 3))
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = size
            left, one, _ = self._chains(points - step)
            right, other, _ = self._chains(points + step)
            slopes[:, :, axis] = (other - one) / (2 * size)
            lower, upper = self._energy(points - step, left), self._energy(points + step, right)
            forces[:, axis] = (upper - lower) / (2 * size)
        torques = np.full((len(points), 3), np.nan)  # comparisons with it are false
        finite = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(forces).all(axis=1)
        good = np.asarray(finite)
        good &= np.abs(np.linalg.det(np.where(good[:, None, None], slopes, np.eye(3)))) > 0
        transposed = slopes[good].transpose(0, 2, 1)  # slopesᵀ τ = dV/dx
        torques[good] = np.linalg.solve(transposed, forces[good][:, :, None])[:, :, 0]
        closed = np.asarray(np.isfinite(bars).all(axis=(1, 2)))
        volumes = np.linalg.det(np.where(closed[:, None, None], bars, 0.0))
        return _At(torques, alignments, volumes)

    def _chains(self, points: Array) -> tuple[Array, Array, Array]:
        """Elbows (N, 3, 3) in m, motor angles (N, 3) and sin² between arm and bars (N, 3)."""
        robot = self.robot
        arm, bar = robot.upper_arm.length, robot.forearm.length
        elbows, angles, alignments = [], [], []
        for azimuth in _TILTED:
            radial = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
            across = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
            shaft = (robot.base_radius - robot.platform_radius) * radial
            away = points - shaft
            sideways, outward, down = away @ across, away @ radial, away[:, 0]
            reach = np.hypot(outward, down)
            with np.errstate(all="ignore"):
                cosine = (arm**2 + reach**2 - (bar**2 - sideways**2)) / (2 * arm * reach)
                angle = np.arctan2(-down, outward) + np.arccos(cosine)  # the elbow outside
            along = np.cos(angle)[:, None] * radial - np.sin(angle)[:, None] * np.eye(3)[0]
            elbow = shaft + arm * along
            rest = (points - elbow) - sideways[:, None] * across
            with np.errstate(all="ignore"):
                inline = (rest * along).sum(1) / np.linalg.norm(rest, axis=1)
            elbows.append(elbow)
            angles.append(angle)
            alignments.append(1 - inline**2)
        return np.stack(elbows, 1), np.stack(angles, 1), np.stack(alignments, 1)

    def _energy(self, points: Array, elbows: Array) -> Array:
        """Potential energy of gravity, which acts along x, (N,), J."""
        robot, g = self.robot, float(np.linalg.norm(self.robot.gravity))
        depth = (robot.platform.mass + self.load) * points[:, 0]
        arms = robot.upper_arm.mass * elbows[:, :, 0].sum(axis=1) / 2
        bars = robot.forearm.mass * (elbows[:, :, 0] + points[:, :1]).sum(axis=1) / 2
        return np.asarray(-g * (depth + arms + bars))


def _grid(robot: Robot, steps: int) -> Array:
    """Points over all that the robot may reach, (nx, ny, nz, 3), m."""
    h = (robot.upper_arm.length + robot.forearm.length) / steps
    wide = steps + int(np.ceil(abs(robot.base_radius - robot.platform_radius) / h))
    depths, across = h * np.arange(-steps // 4, steps + 1), h * np.arange(-wide, wide + 1)
    return np.stack(np.meshgrid(depths, across, across, indexing="ij"), axis=-1)


def _joined(point: Array, points: Array, allowed: Truths, free: Free) -> Truths:
    """Which of the nearest allowed points of the grid a straight line joins to a point."""
    distance = np.where(allowed, np.linalg.norm(points - point, axis=-1), np.inf)
    found = np.zeros(allowed.shape, bool)
    for i in np.argsort(distance, axis=None)[:60]:
        place = np.unravel_index(i, distance.shape)
        if np.isfinite(distance[place]):
            found[place] = free(point + _BETWEEN * (points[place] - point)).all()
    return found


def _flooded(begun: Truths, points: Array, allowed: Truths, free: Free) -> Truths:
    """All points of the grid that are connected to those where it begins."""
    steps = [s for s in product((-1, 0, 1), repeat=3) if s > (0, 0, 0)]
    links = []
    for step in steps:
        one = tuple(slice(max(0, -d), -d if d > 0 else None) for d in step)
        other = tuple(slice(max(0, d), d if d < 0 else None) for d in step)
        both = allowed[one] & allowed[other]
        both[both] = free(((points[one] + points[other]) / 2)[both])
        links.append((one, other, both))
    reached = begun.copy()
    while True:
        before = reached.sum()
        for one, other, both in links:
            reached[other] |= reached[one] & both
            reached[one] |= reached[other] & both
        if reached.sum() == before:
            return reached
