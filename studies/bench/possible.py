"""Whether a move is possible, by a flood over a grid: apart from everything that plans.

A move is possible if a path leads from start to goal, through its via points, in which gravity
leaves every motor something to spare, joints stay in their ranges and the tool in its workspace and
clear of bodies, as do links where they are to: as slowly as need be it can be driven. Where the
scene gives a path, it is that.
An approach is three such paths: out of the cylinder about the start, above both, into the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import Array
from deltaopt.limits.limit import Column
from deltaopt.limits.singularities import margin
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.robot.tool import Box, Sphere
from deltaopt.scene.bodies import Body, Cylinder, HalfSpace
from deltaopt.scene.scene import Scene
from studies.bench.statics import AtRest, Statics

Truths = NDArray[np.bool]

SPARE = 0.02
"""Share of every torque limit that gravity must leave on the path."""
_STEPS = (12, 24, 48)
"""Steps of the grids along the reach of a chain, which are tried in turn. A passage narrower than a
step of the last, which takes a minute, is not found: then a move is called impossible that is not.
"""
_IN_CYLINDER = 9, 33
"""Points of a grid across and along the cylinder of an approach."""
_FLAT = 5e-3
"""Least volume of the bars' directions on the path: nearer to singularities torques are known to
few digits."""
_BETWEEN = np.linspace(0.0, 1.0, 7)[1:, None]
_ANGLES = 2001
"""Of an arm, on half a turn."""
_ON_LINK = np.linspace(0.0, 1.0, 41)
_AT_ONCE = 20_000
"""Points that are looked at in one go: a hundred million numbers of them would fill the memory."""
_ALONG = 401
"""Places at which a given path is looked at."""


@dataclass(frozen=True)
class Possibility:
    """Whether a path is ``found`` that can be held with ``SPARE`` of the torques left, and, if not,
    what was looked at ``against`` it; empty where nothing is known."""

    found: bool
    against: str = ""


def possibility(scene: Scene) -> Possibility:
    """Look for a path.

    Nothing is known where an end moves, and past hulls or with a tool of several shapes. Nor is it
    where a path is found but the platform is to keep from its tilt, or where none is found through
    the centres of spheres that the motion is to pass.
    """
    if scene.moves_at_ends or not _knows_bodies(scene):
        return Possibility(False)
    looked = _looked_for(scene)
    of_centres = any(point.within for point in scene.task.via)
    unknown = scene.given("tilt_singularity") if looked.found else of_centres
    return Possibility(False) if unknown else looked


def _looked_for(scene: Scene) -> Possibility:
    free = _Free.of(scene)
    start, goal = scene.given_points
    if scene.path is not None:
        path = scene.path.between(start, goal)
        found = bool(free(path(np.linspace(path.knots[0], path.knots[-1], _ALONG))).all())
        return Possibility(found, "" if found else f"the path given is not one {_HELD}")
    if scene.approach:
        return _approach(scene, free)
    between = (point.position for point in scene.task.via)
    places = [np.array(point) for point in (start, *between, goal)]
    at_rest = free.statics[0].at(np.array(places))
    if not (free.side * at_rest.volumes > 0).all():
        return Possibility(False, "a point on the other side of a parallel singularity")
    if scene.robot_keeps_clear and not free.arms_turn_to(at_rest.angles).all():
        return Possibility(False, "an arm that would have to turn through a body")

    def connected(steps: int) -> bool:
        grid = _grid(as_delta(scene.robot), steps)
        return all(_connected(one, other, grid, free) for one, other in pairwise(places))

    return _over_grids(connected)


_HELD = f"that can be held with {100 * SPARE:g} % to spare"


def _over_grids(connected: Callable[[int], bool]) -> Possibility:
    """What grids of more and more steps tell."""
    if any(map(connected, _STEPS)):
        return Possibility(True)
    steps = ", ".join(map(str, _STEPS))
    return Possibility(False, f"no path over grids of {steps} steps {_HELD}")


def _approach(scene: Scene, free: Free) -> Possibility:
    """Out of one cylinder, above the lower of both heights, and into the other."""
    columns, tops = scene.columns, list[Array]()
    for name, end, column in zip(("start", "goal"), scene.given_points, columns, strict=True):
        top = _top_of(column, np.array(end), free)
        if not len(top):
            return Possibility(False, f"no path out of the cylinder about the {name} {_HELD}")
        tops.append(top)
    level = max(column.level for column in columns)

    def above(points: Array) -> Truths:
        return np.asarray(free(points) & (points[..., 0] <= level))

    one, other = (top[len(top) // 2] for top in tops)
    return _over_grids(
        lambda steps: _connected(one, other, _grid(as_delta(scene.robot), steps), above)
    )


def _top_of(column: Column, end: Array, free: Free) -> Array:
    """Places at the top of a column's cylinder that a path in it leads to from its end, (n, 3)."""
    across, along = _IN_CYLINDER
    sides = column.radius * np.linspace(-1.0, 1.0, across)
    heights = np.linspace(end[0], column.level, along)
    mesh = np.meshgrid(heights, column.y + sides, column.z + sides, indexing="ij")
    points = np.stack(mesh, axis=-1)
    allowed = free(points.reshape(-1, 3)).reshape(points.shape[:3])
    beside = np.hypot(points[..., 1] - column.y, points[..., 2] - column.z)
    allowed &= beside <= column.radius
    begun = np.zeros(allowed.shape, bool)
    begun[0] = allowed[0] & (beside[0] < 1e-9 * column.radius)
    reached = _flooded(begun, points, allowed, free)
    return np.asarray(points[-1][reached[-1]])


Free = Callable[[Array], Truths]
"""Points (N, 3), m -> at which of them the platform may be."""


@dataclass(frozen=True)
class _Free:
    """Where the platform of a scene may be at rest with something to spare.

    ``statics``: with each mass that it carries. ``torque``: the largest of each motor, (3,), N·m.
    ``side``: 1 or -1, the sign of the volume of the bars' directions at the start. ``folded``: the
    least sin² of the angle between arm and bars that motions between these ends keep.
    """

    scene: Scene
    statics: tuple[Statics, ...]
    torque: Array
    side: float
    folded: float

    @classmethod
    def of(cls, scene: Scene) -> _Free:
        loads = {scene.payload or 0.0, scene.with_least_payload.payload or 0.0}
        statics = tuple(Statics(as_delta(scene.robot), load) for load in loads)
        limit = scene.given("torque")
        torque = np.minimum(scene.robot.torque_limits, np.inf if limit is None else limit)
        ends = statics[0].at(np.array(scene.given_points))
        folded = margin(float(ends.alignments.min()))
        return cls(scene, statics, torque, float(np.sign(ends.volumes[0])), folded)

    def __call__(self, points: Array) -> Truths:
        parts = np.array_split(points, -(-len(points) // _AT_ONCE) or 1)
        return np.concatenate([self._of_part(part) for part in parts])

    def _of_part(self, points: Array) -> Truths:
        found = [each.at(points) for each in self.statics]
        free = self._in_ranges(found[0]) & self._in_workspace(points)
        for each in found:
            free &= (np.abs(each.torques) <= (1 - SPARE) * self.torque).all(axis=1)
        tool = self.scene.robot.tool
        kept = self.scene.least_clearance + ((tool and tool.radius) or 0.0)
        for body in self.scene.keep_out or ():
            free &= _distance(body, points) > kept
        if self.scene.robot_keeps_clear:
            free &= self.arms_turn_to(found[0].angles)
            radius = as_delta(self.scene.robot).link_radius(1)
            forearms = self.statics[0].forearms(points[free])
            free[free] = _are_clear(self.scene, radius, forearms).all(axis=1)
        return free

    def arms_turn_to(self, angles: Array) -> Truths:
        """Whether arms get from the start to angles (N, 3), rad, and through no body on the way."""
        low, high = self._turned
        return np.asarray(((angles - low) % (2 * np.pi) < high - low).all(axis=1))

    @cached_property
    def _turned(self) -> Array:
        """The least and the largest angle to which each arm turns from the start until it is in a
        body, or has made half a turn, (2, 3), rad: where an arm is depends on its angle alone."""
        statics, radius = self.statics[0], as_delta(self.scene.robot).link_radius(0)
        start = statics.at(np.array(self.scene.given_points[:1])).angles
        steps, found = np.linspace(0.0, np.pi, _ANGLES)[:, None], np.empty((2, 3))
        for side, angles in enumerate((start - steps, start + steps)):
            blocked = ~_are_clear(self.scene, radius, statics.arms(angles))
            last = np.where(blocked.any(axis=0), blocked.argmax(axis=0), _ANGLES - 1)
            found[side] = angles[last, range(3)]
        return found

    def _in_ranges(self, at: AtRest) -> Truths:
        least = max(_FLAT, self.scene.given("parallel_singularity") or 0.0)
        inside = (at.alignments > self.folded).all(axis=1) & (self.side * at.volumes > least)
        joints = self.scene.robot.joints
        if joints and joints.arm:
            low, high = joints.arm
            inside &= ((at.angles > low) & (at.angles < high)).all(axis=1)
        if joints and joints.ball:
            inside &= (np.abs(at.sideways) < joints.ball).all(axis=1)
        return np.asarray(inside)

    def _in_workspace(self, points: Array) -> Truths:
        inside = np.ones(len(points), bool)
        workspace = self.scene.robot.workspace
        if workspace and workspace.depth:
            low, high = workspace.depth
            inside &= (points[:, 0] > low) & (points[:, 0] < high)
        if workspace and workspace.radius:
            inside &= np.hypot(points[:, 1], points[:, 2]) < workspace.radius
        return inside


def _are_clear(scene: Scene, radius: float, lines: Array) -> Truths:
    """Whether capsules of a radius (m) about lines (N, 3, 2, 3), m, are clear of all bodies, by
    places on the lines: (N, 3)."""
    clear, (begins, ends) = np.ones(lines.shape[:2], bool), lines.transpose(2, 0, 1, 3)
    kept = scene.least_clearance + radius
    for share in _ON_LINK:
        places = (begins + share * (ends - begins)).reshape(-1, 3)
        for body in scene.keep_out or ():
            clear &= (_distance(body, places) > kept).reshape(clear.shape)
    return clear


def _knows_bodies(scene: Scene) -> bool:
    shapes = scene.robot.tool is not None and scene.robot.tool.shapes is not None
    hulls = any(body.hull is not None for body in scene.keep_out or ())
    return not (scene.keep_out and (shapes or hulls))


def _distance(body: Body, points: Array) -> Array:
    """From a body to points outside it, (N,), m; at most 0 inside."""
    shape = body.shape
    if isinstance(shape, Sphere):
        return np.asarray(np.linalg.norm(points - shape.centre, axis=1) - shape.radius)
    if isinstance(shape, Box):
        return _outside(np.abs(points - np.array(shape.centre)) - np.array(shape.half))
    if isinstance(shape, HalfSpace):
        normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
        return np.asarray((np.array(shape.point) - points) @ normal)
    assert isinstance(shape, Cylinder)
    axis = np.subtract(shape.ends[1], shape.ends[0]) / shape.length
    away = points - np.array(shape.centre)
    along = away @ axis
    beside = np.linalg.norm(away - along[:, None] * axis, axis=1)
    return _outside(np.stack([beside - shape.radius, np.abs(along) - shape.length / 2], axis=1))


def _outside(beyond: Array) -> Array:
    """The distance of points that are so far beyond each of some faces at right angles, (N,)."""
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=1))


def _connected(start: Array, goal: Array, points: Array, free: Free) -> bool:
    """Whether a path leads from start to goal over the points of a grid that are free."""
    allowed = free(points.reshape(-1, 3)).reshape(points.shape[:3])
    begun = _joined(start, points, allowed, free)
    ended = _joined(goal, points, allowed, free)
    return bool((_flooded(begun, points, allowed, free) & ended).any())


def _grid(robot: Robot, steps: int) -> Array:
    """Points over all that the robot may reach, (nx, ny, nz, 3), m."""
    h = (robot.upper_arm.length + robot.forearm.length) / steps
    wide = steps + int(np.ceil(abs(robot.base_radius - robot.platform_radius) / h))
    depths, across = h * np.arange(-steps // 4, steps + 1), h * np.arange(-wide, wide + 1)
    mesh = np.meshgrid(depths, across, across, indexing="ij")
    return np.stack(mesh, axis=-1) + robot.tool_offset


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
