"""Arms and forearms as capsules, and how near they are to keep-out bodies at given places."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.solid_distance import nearest_on_line, numbers_of_solid
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.robot.solids import Solid
from deltaopt.scene.bodies import solids_about
from deltaopt.scene.scene import Scene

LINKS = 6
"""Arm 1, forearm 1, arm 2, and so on."""


def name_of(link: int) -> str:
    """In words."""
    return f"{'forearm' if link % 2 else 'arm'} {link // 2 + 1}"


def rooms_at(scene: Scene, points: Array) -> Array:
    """By how much more than its radius and the scene's clearance each link stays away from each
    body, with the tool's point at points (N, 3), m: (N, 6, bodies). NaN out of reach."""
    return _rooms(scene, LinkGeometry.of(delta_model(scene.robot, scene.payload), points))


def rooms_of_arms(scene: Scene, angles: Array) -> Array:
    """The same of the arms alone at angles (N, 3), rad: (N, 3, bodies)."""
    robot = as_delta(scene.robot)
    return _rooms(scene, LinkGeometry(robot, np.zeros_like(angles), angles))[:, ::2]


def _rooms(scene: Scene, geometry: LinkGeometry) -> Array:
    bodies = solids_about(scene.keep_out or ())
    found = [nearest(body, *geometry.links)[1] - kept_from_bodies(scene) for body in bodies]
    return np.stack(found, axis=2)


def link_radii(robot: Robot) -> Array:
    """Of the capsules of all links, (6,), m."""
    return np.array([robot.link_radius(link) for link in range(LINKS)])


def kept_from_bodies(scene: Scene) -> Array:
    """How far the line of each link is to be from bodies, (6,), m."""
    return np.asarray(link_radii(as_delta(scene.robot)) + scene.least_clearance)


class LinkGeometry:
    """Where elbows and pins are with the tool's point at N places, (N, 3, 3), m, and in which
    directions elbows move, unit vectors ``ahead``, (N, 3, 3)."""

    def __init__(self, robot: Robot, x: Array, theta: Array) -> None:
        """With the tool's point at places x, m, and arms at angles θ, rad, (N, 3) each."""
        outwards = np.array([[0.0, np.cos(azimuth), np.sin(azimuth)] for azimuth in AZIMUTHS])
        down = np.array([1.0, 0.0, 0.0])
        cosine, sine = np.cos(theta)[..., None], np.sin(theta)[..., None]
        self.shafts = np.broadcast_to(robot.base_radius * outwards, (len(x), 3, 3))
        self.elbows = self.shafts + robot.upper_arm.length * (cosine * outwards - sine * down)
        self.pins = (x - robot.tool_offset)[:, None] + robot.platform_radius * outwards
        self.ahead = -sine * outwards - cosine * down
        self.forearm = robot.forearm.length

    @classmethod
    def of(cls, model: DeltaModel, x: Array) -> LinkGeometry:
        """With the tool's point at places x, (N, 3), m. NaN out of reach."""
        theta, is_there = np.full_like(x, np.nan), model.closes(x)
        still = np.zeros_like(x[is_there])
        theta[is_there] = model.motion(x[is_there], still, still)[0][:, 3::3]
        return cls(model.robot, x, theta)

    @property
    def links(self) -> tuple[Array, Array]:
        """Where the lines of all links begin and end, (N, 6, 3) each, m."""
        return each_link(self.shafts, self.elbows), each_link(self.elbows, self.pins)

    @property
    def directions(self) -> Array:
        """Of the forearms, from elbow to pins: unit vectors, (N, 3, 3)."""
        return np.asarray((self.pins - self.elbows) / self.forearm)

    @property
    def levers(self) -> Array:
        """u·e′ of each chain, (N, 3)."""
        return np.asarray((self.directions * self.ahead).sum(axis=2))

    def slope(self, link: int, share: Array, normal: Array) -> Array:
        """How the distance of a link from a body grows with the tool's place, (N, 3), where the
        link is nearest at a share of its line, (N,), and the body's normal there is (N, 3)."""
        chain, is_forearm = divmod(link, 2)
        of_elbow = (1 - share if is_forearm else share) * (normal * self.ahead[:, chain]).sum(1)
        by_elbow = (of_elbow / self.levers[:, chain])[:, None] * self.directions[:, chain]
        return np.asarray(by_elbow + is_forearm * share[:, None] * normal)


def each_link(of_arms: Array, of_forearms: Array) -> Array:
    """What arms and forearms have, (N, 3, …) each, in the order of links, (N, 6, …)."""
    both = np.stack([of_arms, of_forearms], axis=2)
    return both.reshape(len(both), LINKS, *both.shape[3:])


def nearest(body: Solid, begin: Array, end: Array) -> tuple[Array, Array, Array]:
    """At which shares of lines, from 0 to 1, they are nearest to a body, (N, lines), how far they
    are there, m, and in which direction that grows, (N, lines, 3). NaN where a line is."""
    share, distance, normal = nearest_on_line()(
        begin.reshape(-1, 3), end.reshape(-1, 3), parameters=np.array(numbers_of_solid(body))
    )
    lines = begin.shape[:-1]
    return share.reshape(lines), distance.reshape(lines), normal.reshape(begin.shape)
