"""A lower bound on the duration of every motion from start to goal, on whatever path.

It holds for the whole problem, not near one motion: no other local minimum, found or not, is
shorter. It rests on work and energy alone; docs/dev/lower-bound.md has the proofs. It is
evaluated in closed form, without sampling paths or configurations, for the terms of the robot's
model and the limits on torque, speed and acceleration. Other limits make motions slower, so it
holds with them too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from deltaopt.curves.halving import bisected_number
from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.robot.machine import Energies
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

_Forces = tuple[Array, Array]
"""Torque on each arm, (3,), N·m, and force on the platform, (3,), N."""

_SPLITS = np.linspace(-1.0, 1.0, 9)
"""How the inertia of the bars is shared between arms and platform: 0 half each, ±1 as unevenly as
is possible. Every share gives a bound, of which the best is taken; more of them raise it by less
than 1e-3."""
_ARM_SHARES = np.concatenate([[0.0], np.geomspace(0.05, 20.0, 13)])
_ARM_POWERS = (1.0, 3.0)
_TILTS = (-0.5, -0.2, 0.0, 0.2, 0.5)
"""Directions in which progress is measured, every one of which gives a bound: how much the arms'
progress counts beside the platform's, how much more that of the arm with the longer way, and how
far the platform's direction is tilted with or against gravity. More of them raise the bound of
shipped scenes by less than 1 %."""
_BISECTIONS = 40
"""They find a duration to twelve digits, from below."""


@lru_cache(maxsize=32)
def lower_bound(scene: Scene) -> float:
    """A duration in s below which no motion from start to goal can be, whatever its path.

    The largest of several bounds, each of them proven. Unless both ends are at rest, and all that
    acts on the robot says how much it can give, it is what rotation takes, or 0, which is true and
    says nothing. Raises Unreachable where an end is.
    """
    task = scene.task
    if not task.is_at_rest:
        return scene.least_duration
    way = _Way.of(scene, given_points(task))
    if way is None:
        return scene.least_duration
    bounds = (_by_work(way), _by_speed(way), _by_power(way), _by_platform(way))
    return max(scene.least_duration, *bounds)


@lru_cache(maxsize=32)
def soonest(scene: Scene, place: Vector3) -> float:
    """A duration in s below which no motion from rest at the start gets to a place (m), at whatever
    velocity: by work alone, the first half of the bound from rest to rest.

    0 where something that acts on the robot does not say how much it can give. Raises Unreachable
    where start or place is.
    """
    way = _Way.of(scene, (scene.task.start.position, place))
    return 0.0 if way is None else _work_bound(way, (way.gaining,))


@dataclass(frozen=True)
class _Way:
    """What a motion must do, and with what.

    ``platform``: displacement of the platform, (3,), m. ``arms``: by how much the motor angles
    differ between start and goal, (3,), rad. ``energies``: of the robot. ``weight``: of what moves
    with the platform, half of the bars included, (3,), N. ``torque``: the largest torque of each
    motor, of gravity on its arm and of what else pushes it, (3,), N·m. ``braking``: by how much
    more an arm can be braked than pushed, N·m. ``speed``: of the arms, (3,), rad/s.
    ``platform_speed``, ``acceleration``: of the platform, m/s and m/s². What is not limited is
    infinite.
    """

    platform: Array
    arms: Array
    energies: Energies
    weight: Array
    torque: Array
    braking: float
    speed: Array
    platform_speed: float
    acceleration: float

    @classmethod
    def of(cls, scene: Scene, points: tuple[Vector3, Vector3]) -> _Way | None:
        """Between two points, m; None where these are one but for rounding, or the model has
        something that may act without bound, or that is not known."""
        model, limits = model_of(scene.robot, scene.payload), limits_of(scene)
        energies, ends = model.energies, np.array(points)
        start, goal = model.inverse_kinematics(ends)[:, model.functions.motors]
        arms = np.abs(goal - start)
        if energies is None or not arms.any():
            return None
        gravity = np.array(scene.robot.gravity_vector)
        return cls(
            platform=ends[1] - ends[0],
            arms=arms,
            energies=energies,
            weight=(energies.mass + energies.bars / 2) * gravity,
            torque=_upper(limits, "torque", 3) + energies.gravity + energies.pushing,
            braking=energies.braking - energies.pushing,
            speed=_upper(limits, "speed", 3),
            platform_speed=float(_upper(limits, "platform speed", 1)[0]),
            acceleration=float(_upper(limits, "acceleration", 1)[0]),
        )

    @property
    def gaining(self) -> _Forces:
        """What a motion gains energy by."""
        return self.torque, self.weight

    def losing(self, speed: Array | float) -> _Forces:
        """What it loses energy by, with arms of this speed at most, rad/s."""
        return self.torque + self.braking + self.energies.viscous * speed, -self.weight

    def inertias(self, split: Array) -> tuple[Array, Array]:
        """Inertia of an arm, kg·m², and mass of the platform with what counts of the bars, kg.

        With u the velocity of the elbow and w that of the platform, 2 u·w lies between
        ±(e u² + w² / e) for every e > 0, so that the energy of the bars has a lower bound without
        the product. ``split``: (n,), log e as a share of the largest at which both parts count.
        """
        own = self.energies
        both, apart = own.same + own.opposite, abs(own.same - own.opposite)
        if not both:
            return np.full(len(split), own.arm_inertia), np.full(len(split), own.mass)
        e = (both / apart) ** split if apart else np.ones(len(split))
        arms = np.maximum(both - apart * e, 0.0) * own.arm**2
        return own.arm_inertia + arms, own.mass + 3 * np.maximum(both - apart / e, 0.0)


def _upper(limits: SceneLimits, name: str, number: int) -> Array:
    """The upper bounds of a limit, infinite where it does not exist, (number,)."""
    found = limits.upper(name)
    return np.full(number, np.inf) if found is None else np.asarray(found, dtype=float)


def _by_work(way: _Way) -> float:
    """The bound from what motors and gravity can do, and what mass and inertia ask for.

    Viscous friction brakes the more, the faster the arms are, and they are the faster, the longer
    the motion takes: so the bound is itself a function of the duration, and decreasing. No
    duration is possible below the one at which it is met.
    """
    if not way.energies.viscous:
        return _work_bound(way, (way.gaining, way.losing(0.0)))
    inertia, mass = (float(each[0]) for each in way.inertias(np.zeros(1)))
    if not inertia and not np.isfinite(way.speed).all():
        return 0.0
    squares = np.sum(way.torque**2) / inertia + np.sum(way.weight**2) / mass if inertia else np.inf
    growth = float(np.sqrt(squares))  # of the root of twice the energy in a second at most, √W

    def bound(duration: float) -> float:
        fastest = growth * duration / np.sqrt(inertia) if inertia else np.inf
        speed = np.minimum(way.speed, fastest)
        return _work_bound(way, (way.gaining, way.losing(speed)))

    return _first_possible(lambda duration: bound(duration) <= duration, bound(0.0))


def _work_bound(way: _Way, phases: tuple[_Forces, ...]) -> float:
    """The largest over all directions and splits of √(2 p·W (1/k₁ + 1/k₂)).

    ``phases``: what acts while energy is gained and, where that is asked for, lost again.
    """
    inertia, mass = (each[:, None] for each in way.inertias(_SPLITS))
    kept = (inertia > 0).ravel()
    inertia, mass = inertia[kept], mass[kept]
    roots = np.concatenate([np.repeat(np.sqrt(inertia), 3, 1), np.repeat(np.sqrt(mass), 3, 1)], 1)
    directions = _directions(way)[None] * roots[:, None]  # (splits, directions, 6)
    progress = directions @ (np.concatenate([way.arms, way.platform]) * roots)[:, :, None]
    size = np.linalg.norm(directions, axis=2)
    longest = np.zeros(size.shape)
    for torque, weight in phases:
        work = np.concatenate([torque, weight]) / roots
        rate = np.linalg.norm(work, axis=1)[:, None]
        cosine = (directions @ work[:, :, None])[:, :, 0] / (rate * size)
        angle = np.arccos(np.clip(cosine, -1.0, 1.0))
        longest += 1 / (rate * size * np.maximum(np.sinc(angle / np.pi), 1e-6))
    squares = 2 * np.maximum(progress[:, :, 0], 0.0) * longest
    return float(np.sqrt(squares.max(initial=0.0)))


def _directions(way: _Way) -> Array:
    """Directions p to measure progress in, (n, 6): of the arms (at least 0), of the platform."""
    distance, weight = np.linalg.norm(way.platform), np.linalg.norm(way.weight)
    ahead = way.platform / distance
    down = way.weight / weight if weight else np.zeros(3)
    farthest = max(way.arms.max(), np.finfo(float).tiny)
    found = []
    for power in _ARM_POWERS:
        arms = (way.arms / farthest) ** power * farthest / distance
        found += [
            np.concatenate([share * arms, ahead + tilt * down])
            for share in _ARM_SHARES
            for tilt in _TILTS
        ]
        found.append(np.concatenate([arms, np.zeros(3)]))
    found.append(np.concatenate([way.torque, np.zeros(3)]))
    return np.array(found)


def _by_speed(way: _Way) -> float:
    """The bound from the speed limits of the arms, which they must reach and leave by work.

    Without inertia of the arms, or with viscous friction, the ramps are left out.
    """
    if not np.isfinite(way.speed).all():
        return 0.0
    inertia, mass = (each[:, None] for each in way.inertias(_SPLITS))
    weights = np.array([*np.eye(3), way.arms, way.torque])
    fastest, turn = weights @ way.speed, weights @ way.arms
    at_speed = turn / fastest
    if way.energies.viscous or not inertia.all():
        return float(at_speed.max())
    ramps = np.zeros((len(inertia), len(weights)))
    for torque in (way.torque, way.torque + way.braking):
        rate = np.sqrt(np.sum(torque**2) / inertia + np.sum(way.weight**2) / mass)
        ramps += 1 / (rate * np.linalg.norm(weights, axis=1) / np.sqrt(inertia))
    reached = turn > fastest**2 * ramps / 2  # else the speed limit need not be reached
    return float(np.where(reached, at_speed + fastest * ramps / 2, at_speed).max())


def _by_power(way: _Way) -> float:
    """The bound from the power that motors have at their speed limits, which the platform's energy
    comes from; it needs no inertia of the arms."""
    if not np.isfinite(way.speed).all():
        return 0.0
    _, masses = way.inertias(_SPLITS)
    mass = float(masses.max())
    friction = way.braking + way.energies.viscous * way.speed
    powers = [float(torque @ way.speed) for torque in (way.torque, way.torque + friction)]
    power, weight = max(powers), float(np.linalg.norm(way.weight)) / np.sqrt(mass)
    progress = float(np.linalg.norm(way.platform)) * np.sqrt(mass)

    def possible(duration: float) -> bool:
        half = duration / 2
        covered = 4 / 3 * np.sqrt(2 * power) * half**1.5 + weight * half**2
        return bool(covered >= progress)

    without_weight = 2 * (progress / (4 / 3 * np.sqrt(2 * power))) ** (2 / 3)
    return _first_possible(possible, without_weight)


def _by_platform(way: _Way) -> float:
    """The bound from limits on the platform's own speed and acceleration."""
    distance = float(np.linalg.norm(way.platform))
    speed, acceleration = way.platform_speed, way.acceleration
    if speed**2 < distance * acceleration:  # the speed limit is reached, perhaps at once
        return distance / speed + speed / acceleration
    return float(2 * np.sqrt(distance / acceleration))


def _first_possible(possible: Callable[[float], bool], upper: float) -> float:
    """The largest duration known to be too short: below it none is ``possible``, as none is below
    one that is not. ``upper``: a duration that is possible, s."""
    return bisected_number(possible, 0.0, upper, _BISECTIONS)[0]
