"""How near arms and forearms come to keep-out bodies along a motion.

Arms and pairs of bars are capsules about lines, of the radii that the robot's file gives, if any.
The distance from a convex body is a convex function along a line, whose least value golden sections
find. So much is told of every motion, by samples.

Where a scene asks links to keep clear, all instants count. In the middle of a part of the motion,
the plane at the body's place that is nearest to a line divides both. Within h of it an end of the
line is off where it would be at constant velocity: pins, at w, by A h²/2 at most, ‖ẅ‖ ≤ A. An elbow
is at e(θ) on a circle of radius L, ‖w - e(θ)‖ = l. If the arm went on at constant speed, D = w - e
would miss the length by

    | ‖D‖² - l² | ≤ (max ‖Ḋ‖² + max ‖D‖ max ‖D̈‖) h² = G,

for it has no error and no rate in the middle. Where (w - e)·e′ is at least m in the part, e′ the
unit vector in which the elbow moves, the arm is off by G / (2 L m) at most, and so the elbow by
L θ̇² h²/2 + G / (2 m).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.robot.machine import Model
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.robot.solids import Convex
from deltaopt.scene.bodies import sums
from deltaopt.scene.scene import Scene
from deltaopt.verify.clearance import ENOUGH, HALVINGS, MOST, Parts, distance_from

_FRACTIONS = np.linspace(0.0, 1.0, 5)
"""Of every interval, where the robot is looked at."""
_SECTIONS = 32
"""Of a line: a place is then known to 2e-7 of it."""
_BISECTIONS = 44
"""The same, to 1e-13 of it."""
_GOLDEN = (5**0.5 - 1) / 2


def robot_clearance(scene: Scene, trajectory: Trajectory) -> float | None:
    """The least distance of arms and forearms from the bodies of a scene, m, negative inside of
    one, by samples; None if there are no bodies."""
    if scene.keep_out is None or not scene.robot.has_links:
        return None
    robot = as_delta(scene.robot)
    motion = trajectory.inside_intervals(_FRACTIONS)
    begins, ends = _lines(robot, motion.x, motion.theta)
    radii = np.repeat(_radii(robot), len(motion.x))
    return min(float((_least(b, begins, ends) - radii).min()) for b in _bodies(scene))


def sure_robot_clearance(scene: Scene, trajectory: Trajectory) -> float:
    """The same at all instants: the least distance where the motion is known to keep what the scene
    asks for, and otherwise a bound that no instant falls below, m."""
    least, worst, seen = np.inf, np.inf, 0
    parts, bodies = Parts.of(trajectory.position), _bodies(scene)
    robot = as_delta(scene.robot)
    radii, asked = _radii(robot), scene.least_clearance
    for halving in range(HALVINGS + 1):
        links = _MovingLinks.of(robot, trajectory.model, parts)
        open_ = np.zeros(len(parts.half), np.bool)
        for body in bodies:
            distance, bound = (each - radii for each in links.distance_and_bound(body))
            least = min(least, float(distance.min()))
            too_near = distance < asked - ENOUGH  # how near is told by these samples
            own = (bound < asked - ENOUGH) & ~too_near
            open_ |= own.any(axis=1)
            if own.any():
                worst = min(worst, float(bound[own].min()))
        seen += len(bodies) * len(parts.half)
        if not open_.any():
            return least
        if halving == HALVINGS or seen > MOST:
            break
        parts, worst = parts.halved(open_), np.inf
    return min(least, worst)


def _bodies(scene: Scene) -> list[Convex]:
    return [body for _, body in sums(scene.keep_out or (), None)]


def _radii(robot: Robot) -> Array:
    """Of the capsules of all links, (6,), m."""
    return np.array([robot.upper_arm.radius or 0.0, robot.forearm.radius or 0.0] * len(AZIMUTHS))


@dataclass(frozen=True)
class _MovingLinks:
    """The lines of all links in the middles of N parts of a motion: their ends, (N, 6, 2, 3), m,
    how fast these move, m/s, and by how much they are ``off`` uniform motion within the parts at
    most, (N, 6, 2), m; infinite where that is not known. ``half``: of the parts' durations, s."""

    ends: Array
    rates: Array
    off: Array
    half: Array

    @classmethod
    def of(cls, robot: Robot, model: Model, parts: Parts) -> _MovingLinks:
        x, v = (each.inside(parts.piece, parts.since) for each in (parts.path, parts.rate))
        q, dq, _ = model.motion(x, v, np.zeros_like(x))
        theta, dtheta, number = q[:, 3::3], dq[:, 3::3], len(x)
        begins, ends = (each.reshape(6, number, 3) for each in _lines(robot, x, theta))
        arm, h = ends[0::2] - begins[0::2], parts.half[:, None]
        outwards = np.array([[0.0, np.cos(angle), np.sin(angle)] for angle in AZIMUTHS])[:, None]
        ahead = np.cross(arm, np.cross(outwards, [1.0, 0.0, 0.0])) / robot.upper_arm.length
        bars = np.moveaxis(ends[1::2] - begins[1::2], 0, 1)
        ahead = np.moveaxis(ahead, 0, 1)
        elbow_rates = robot.upper_arm.length * dtheta[..., None] * ahead
        pin_rates = np.broadcast_to(v[:, None], elbow_rates.shape)
        largest = parts.largest[parts.piece][:, None]
        of_elbow = _off(robot, bars, ahead, elbow_rates, pin_rates, dtheta, largest, h)
        of_pin = np.broadcast_to(largest * h**2 / 2, of_elbow.shape)
        still = np.zeros_like(elbow_rates)
        return cls(
            np.stack([begins, ends], axis=2).transpose(1, 0, 2, 3),
            _by_link((still, elbow_rates), (elbow_rates, pin_rates)),
            _by_link((still[..., 0], of_elbow), (of_elbow, of_pin)),
            parts.half,
        )

    def distance_and_bound(self, body: Convex) -> tuple[Array, Array]:
        """How far the lines are from a body in the middles of the parts, and at least in all of
        them, (N, 6) each, m."""
        begin, way = self.ends[:, :, 0].reshape(-1, 3), np.diff(self.ends, axis=2).reshape(-1, 3)
        share = _nearest_share(body, begin, way)
        distance, normal = distance_from(body, begin + share[:, None] * way)
        rise = (normal * way).sum(axis=1)
        level = np.stack([distance - share * rise, distance + (1 - share) * rise], axis=1)
        level = level.reshape(*self.ends.shape[:2], 2)
        normal = normal.reshape(*self.ends.shape[:2], 3)
        towards = np.abs(np.einsum("nlc,nlec->nle", normal, self.rates)) * self.half[:, None, None]
        return distance.reshape(level.shape[:2]), (level - towards - self.off).min(axis=2)


def _off(
    robot: Robot,
    bars: Array,
    ahead: Array,
    elbow_rates: Array,
    pin_rates: Array,
    dtheta: Array,
    largest: Array,
    h: Array,
) -> Array:
    """By how much elbows are off uniform motion within h of the middle at most, (N, 3), m."""
    L, length, speed = robot.upper_arm.length, robot.forearm.length, np.abs(dtheta)
    bend = largest + L * dtheta**2
    fastest = np.linalg.norm(pin_rates - elbow_rates, axis=2) + bend * h
    G = (fastest**2 + (length + fastest * h) * bend) * h**2
    lever = np.abs((bars * ahead).sum(axis=2))
    turned = speed * h + G / (L * lever)
    moved = (np.linalg.norm(pin_rates, axis=2) + largest * h) * h
    m = lever - moved - L * turned - (length + moved + L * turned) * turned
    return np.where(m >= lever / 2, L * dtheta**2 * h**2 / 2 + G / (2 * m), np.inf)


def _by_link(of_arm: tuple[Array, Array], of_forearm: tuple[Array, Array]) -> Array:
    """What both ends of arms and of forearms have, (N, 3, …) each, as (N, 6, 2, …)."""
    arm, forearm = np.stack(of_arm, axis=2), np.stack(of_forearm, axis=2)
    both = np.stack([arm, forearm], axis=2)
    return both.reshape(len(both), 6, *both.shape[3:])


def _lines(robot: Robot, x: Array, theta: Array) -> tuple[Array, Array]:
    """Where the lines of all arms and forearms begin and end at N instants, (6 N, 3) each, m."""
    centre = x - np.array(robot.tool_offset)
    begins, ends = [], []
    for k, azimuth in enumerate(AZIMUTHS):
        outwards = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        shaft = np.broadcast_to(robot.base_radius * outwards, x.shape)
        along = np.cos(theta[:, k, None]) * outwards
        along[:, 0] -= np.sin(theta[:, k])
        elbow = shaft + robot.upper_arm.length * along
        begins += [shaft, elbow]
        ends += [elbow, centre + robot.platform_radius * outwards]
    return np.vstack(begins), np.vstack(ends)


def _nearest_share(body: Convex, begin: Array, way: Array) -> Array:
    """At which shares of lines they are nearest to a body, (N,): there the distance turns."""
    low, high = np.zeros(len(begin)), np.ones(len(begin))
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        _, normal = distance_from(body, begin + middle[:, None] * way)
        grows = (normal * way).sum(axis=1) > 0
        low, high = np.where(grows, low, middle), np.where(grows, middle, high)
    return np.asarray((low + high) / 2)


def _least(body: Convex, begins: Array, ends: Array) -> Array:
    """The least distance of each line from a body, (N,), m."""

    def at(share: Array) -> Array:
        distance, _ = distance_from(body, begins + share[:, None] * (ends - begins))
        return distance

    low, high = np.zeros(len(begins)), np.ones(len(begins))
    for _ in range(_SECTIONS):
        width = _GOLDEN * (high - low)
        one, other = high - width, low + width
        nearer = at(one) < at(other)
        low, high = np.where(nearer, low, one), np.where(nearer, other, high)
    return at((low + high) / 2)
