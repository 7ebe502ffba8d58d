"""The least clearance of a motion from keep-out bodies, by its own distances and its own bounds.

The nearest point of a body is found by projection, and the distance is that to it. A distance from
a convex body is at least what its tangent plane says, and a motion is at most A h²/2 off its
tangent within h of an instant, where ‖ẍ‖ ≤ A. So within h of an instant t the distance is at least

    d(t) - |n · ẋ(t)| h - A h²/2,

n the direction from the nearest point. Parts of the motion are halved until that says enough: what
is reported holds at all instants.

Arms and pairs of bars are capsules about lines, of the radii that the robot's file gives, if any.
The distance from a convex body is a convex function along a line, whose least value bisection
finds. How near links come is told of every motion, by samples.

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

from dataclasses import replace

import numpy as np

from deltaopt.curves.halving import Parts, nearest_on_lines, surely_largest
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.trajectory import Motion, Trajectory
from deltaopt.robot.machine import Model
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.robot.solids import Convex, Polytope, Solid
from deltaopt.scene.bodies import sums
from deltaopt.scene.links import LinkGeometry, each_link, link_radii
from deltaopt.scene.scene import Scene
from deltaopt.verify.measures import Excess, excess_of

ENOUGH = 5e-10
"""m: a part of the motion is halved no further once its bound is this near to the clearance asked
for. It is half of what verification allows."""
HALVINGS, MOST = 30, 400_000
"""How often a piece is halved at most, and how many parts are looked at in all. What is not known
by then is reported as the worst that it may be."""
FIRST = 8
"""How many equal parts each piece is divided into first."""


def clearance_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """By how much the motion comes nearer to a body than the scene allows, m; negative where it
    stays farther away. None if there are no bodies."""
    blank, found = excess_of(scene, OwnMeasure.CLEARANCE), list[Excess]()
    if blank is None:
        return None
    for index, body in scene.obstacles:
        least, t = least_clearance(body, trajectory.position, scene.least_clearance)
        over = scene.least_clearance - least
        subject = f"{blank.subject} from keep_out[{index}]"
        found.append(
            replace(blank, subject=subject, t=t, value=over, amount=over, falls_below=True)
        )
    return max(found, key=lambda each: each.value, default=None)


def least_clearance(body: Convex, path: PiecewisePolynomial, asked: float) -> tuple[float, float]:
    """The least distance (m) of a motion from a body, and when (s).

    It is that of an instant where all of the motion is known to keep what is asked for (m), and
    otherwise a bound that no instant falls below.
    """
    largest = largest_accelerations(path)

    def nearness(parts: Parts) -> tuple[Array, Array, Array]:
        distance, normal = distance_from(body, parts.at())
        towards = np.abs((normal * parts.at(1)).sum(axis=1))
        off = largest[parts.piece] * parts.half**2 / 2
        bound = distance - towards * parts.half - off
        return -distance[:, None], parts.middles, -bound[:, None]

    nearest, where = surely_largest(
        Parts.of(path, FIRST),
        nearness,
        ENOUGH - asked,
        known=lambda too_near: too_near + ENOUGH,
        halvings=HALVINGS,
        most=MOST,
    )
    return -nearest, where


def largest_accelerations(path: PiecewisePolynomial) -> Array:
    """What the norm of the second derivative is at most in each piece, (K,)."""
    sizes = np.linalg.norm(path.derivative().derivative().coefficients, axis=2)
    lengths = np.diff(path.knots)[:, None]
    return np.asarray((sizes * lengths ** np.arange(sizes.shape[1])).sum(axis=1))


def distance_from(body: Convex, x: Array) -> tuple[Array, Array]:
    """Signed distances of points (N, 3), m, from a body, negative inside, (N,), and the directions
    in which they grow fastest, (N, 3)."""
    if isinstance(body, Polytope):
        distance, normal = _from_polytope(np.array(body.triangles), x)
    else:
        axes = np.array(body.axes)
        distance, normal = _from_solid(body, (x - np.array(body.centre)) @ axes.T)
        normal = normal @ axes
    return distance - body.radius, normal


def _from_solid(body: Solid, u: Array) -> tuple[Array, Array]:
    """Distance and normal in the axes of a box or cylinder, without its radius."""
    half = np.array(body.half)
    if body.is_cylinder:
        across = np.maximum(np.linalg.norm(u[:, :2], axis=1), 1e-300)
        outwards = np.column_stack([u[:, :2] / across[:, None], np.zeros(len(u))])
        up = np.column_stack([np.zeros((len(u), 2)), np.sign(u[:, 2])])
        within = np.column_stack([across - half[0], np.abs(u[:, 2]) - half[2]])
        ways = np.stack([outwards, up], axis=1)
    else:
        within = np.abs(u) - half
        ways = np.eye(3) * np.sign(u)[:, None, :]
    away = np.maximum(within, 0.0)
    outside = np.linalg.norm(away, axis=1)
    nearest = within.argmax(axis=1)
    inwards = within.max(axis=1)
    is_out = inwards > 0
    normal = np.einsum("nk,nkc->nc", away, ways) / np.maximum(outside, 1e-300)[:, None]
    normal[~is_out] = ways[np.arange(len(u)), nearest][~is_out]
    return np.where(is_out, outside, inwards), normal


def _from_polytope(triangles: Array, x: Array) -> tuple[Array, Array]:
    """Signed distances from a convex polytope without its radius, and directions."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    height = x @ normals.T - (a * normals).sum(axis=1)
    face = height.argmax(axis=1)
    highest = height.max(axis=1)
    distance, normal = highest.copy(), normals[face]
    for i in np.flatnonzero(highest > 0):
        place = _nearest_place(triangles, normals, height[i], x[i])
        away = x[i] - place
        distance[i] = np.linalg.norm(away)
        normal[i] = away / distance[i]
    return distance, normal


def _nearest_place(triangles: Array, normals: Array, height: Array, x: Array) -> Array:
    """The place of a polytope's surface that is nearest to a point outside, (3,)."""
    foot = x - height[:, None] * normals
    corners, following = triangles, np.roll(triangles, -1, axis=1)
    edges = following - corners
    across = np.cross(edges, foot[:, None] - corners)
    on_face = (np.einsum("tkc,tc->tk", across, normals) >= 0).all(axis=1)
    share = np.clip(((x - corners) * edges).sum(axis=2) / (edges**2).sum(axis=2), 0.0, 1.0)
    places = np.concatenate([foot[on_face], (corners + share[:, :, None] * edges).reshape(-1, 3)])
    return np.asarray(places[((places - x) ** 2).sum(axis=1).argmin()])


_FRACTIONS = np.linspace(0.0, 1.0, 5)
"""Where in every interval the distances of arms and forearms are sampled, as fractions of it."""
_CLOSELY = 1e-13
"""Accuracy, m, to which the distance of a line from a body is computed."""


def robot_clearance(scene: Scene, trajectory: Trajectory) -> float | None:
    """The least distance of arms and forearms from the bodies of a scene, m, negative inside of
    one, by samples; None if there are no bodies."""
    if scene.keep_out is None or not scene.robot.has_links:
        return None
    motion = trajectory.inside_intervals(_FRACTIONS)
    return float(link_distances(scene, motion.x, motion.theta).min())


def link_distances(scene: Scene, x: Array, theta: Array) -> Array:
    """Distances of arms and forearms from the bodies of a scene, (N, links, bodies), m, with the
    tool's point at places x, m, and arms at angles θ, rad, (N, 3) each."""
    robot = as_delta(scene.robot)
    begin, end = LinkGeometry(robot, x, theta).links
    found = [_nearest(body, begin, end - begin)[1] for body in _bodies(scene)]
    return np.stack(found, axis=-1) - link_radii(robot)[:, None]


def clearances(scene: Scene, motion: Motion) -> dict[str, Array]:
    """Distances, m, from each keep-out body, (N, bodies), of what keeps clear of them, by name: the
    tool, and where the scene says so arms and forearms."""
    of_tool = np.full((len(motion.x), len(scene.keep_out or ())), np.inf)
    for body, grown in scene.obstacles:
        of_tool[:, body] = np.minimum(of_tool[:, body], distance_from(grown, motion.x)[0])
    if not scene.robot_keeps_clear:
        return {"the tool": of_tool}
    of_links = link_distances(scene, motion.x, motion.theta).min(axis=1)
    return {"the tool": of_tool, "arms, forearms": of_links}


def sure_robot_clearance(scene: Scene, trajectory: Trajectory) -> float:
    """The least distance at all instants, m: where the motion is known to keep what the scene asks
    for that of an instant, and otherwise a bound that no instant falls below."""
    robot = as_delta(scene.robot)
    bodies, radii = _bodies(scene), link_radii(robot)
    largest = largest_accelerations(trajectory.position)

    def nearness(parts: Parts) -> tuple[Array, Array, Array]:
        ends, rates, off = moving_links(robot, trajectory.model, parts, largest[parts.piece])
        begin, way = ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0]
        distances, bounds = list[Array](), list[Array]()  # (N, 6) for each body, m
        for body in bodies:
            share, distance, normal = _nearest(body, begin, way)
            rise = (normal * way).sum(axis=2)
            level = np.stack([distance - share * rise, distance + (1 - share) * rise], axis=2)
            moved = np.abs(np.einsum("nlc,nlec->nle", normal, rates)) * parts.half[:, None, None]
            distances.append(distance - radii)
            bounds.append((level - moved - off).min(axis=2) - radii)
        return -np.hstack(distances), parts.middles, -np.hstack(bounds)

    nearest, _ = surely_largest(
        Parts.of(trajectory.position, FIRST),
        nearness,
        ENOUGH - scene.least_clearance,
        known=lambda too_near: np.full_like(too_near, np.inf),  # by an instant
        halvings=HALVINGS,
        most=MOST // len(bodies),
    )
    return -nearest


def _bodies(scene: Scene) -> list[Convex]:
    return [body for _, body in sums(scene.keep_out or (), None)]


def moving_links(
    robot: Robot, model: Model, parts: Parts, largest: Array
) -> tuple[Array, Array, Array]:
    """The lines of all links in the middles of N parts of a motion: their ends, (N, 6, 2, 3), m,
    how fast these move, m/s, and by how much they are off uniform motion within the parts at most,
    (N, 6, 2), m; infinite where that is not known. ``largest``: what the platform's acceleration is
    at most in each part, (N,), m/s²."""
    x, v = parts.at(), parts.at(1)
    q, dq, _ = model.motion(x, v, np.zeros_like(x))
    geometry, dtheta = LinkGeometry(robot, x, q[:, 3::3]), dq[:, 3::3]
    bars, ahead = geometry.pins - geometry.elbows, geometry.ahead
    elbow_rates = robot.upper_arm.length * dtheta[..., None] * ahead
    pin_rates = np.broadcast_to(v[:, None], elbow_rates.shape)
    largest, h = largest[:, None], parts.half[:, None]
    L, length, speed = robot.upper_arm.length, robot.forearm.length, np.abs(dtheta)
    bend = largest + L * dtheta**2
    fastest = np.linalg.norm(pin_rates - elbow_rates, axis=2) + bend * h
    G = (fastest**2 + (length + fastest * h) * bend) * h**2
    lever = np.abs((bars * ahead).sum(axis=2))
    turned = speed * h + G / (L * lever)
    moved = (np.linalg.norm(pin_rates, axis=2) + largest * h) * h
    m = lever - moved - L * turned - (length + moved + L * turned) * turned
    elbow_bend = L * dtheta**2 * h**2 / 2 + G / (2 * m)
    of_elbow = np.where(m >= lever / 2, elbow_bend, np.inf)
    of_pin = np.broadcast_to(largest * h**2 / 2, of_elbow.shape)
    still = np.zeros_like(elbow_rates)
    moving = each_link(still, elbow_rates), each_link(elbow_rates, pin_rates)
    bent = each_link(still[..., 0], of_elbow), each_link(of_elbow, of_pin)
    ends, rates, off = (np.stack(both, axis=2) for both in (geometry.links, moving, bent))
    return ends, rates, off


def _nearest(body: Convex, begin: Array, way: Array) -> tuple[Array, Array, Array]:
    """At which shares of lines they are nearest to a body, (N, 6), the distances there, (N, 6), m,
    and the directions in which these grow, (N, 6, 3)."""

    def distances(x: Array) -> tuple[Array, Array]:
        distance, normal = distance_from(body, x.reshape(-1, 3))
        return distance.reshape(x.shape[:-1]), normal.reshape(x.shape)

    share = nearest_on_lines(lambda x: distances(x)[1], begin, way, _CLOSELY)
    return share, *distances(begin + share[..., None] * way)
