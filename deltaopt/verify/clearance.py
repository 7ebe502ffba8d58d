"""The least clearance of a motion from keep-out bodies, by its own distances and its own bound.

The nearest point of a body is found by projection, and the distance is that to it. A distance from
a convex body is at least what its tangent plane says, and a motion is at most A h²/2 off its
tangent within h of an instant, where ‖ẍ‖ ≤ A. So within h of an instant t the distance is at least

    d(t) - |n · ẋ(t)| h - A h²/2,

n the direction from the nearest point. Parts of the motion are halved until that says enough: what
is reported holds at all instants.
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.halving import Parts, surely_largest
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.solids import Convex, Polytope, Solid
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.verify.measures import Excess, Known

ENOUGH = 5e-10
"""m below what is asked for, at which a part is not halved any more: half of what verification
allows."""
HALVINGS, MOST = 30, 400_000
"""Of a piece, and parts that are looked at in all: what is not known then is told as bad as it may
be."""
FIRST = 8
"""Parts of each piece to begin with."""


def clearance_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """By how much the motion comes nearer to a body than the scene allows, m; negative where it
    stays farther away. None if there are no bodies."""
    limits = limits_of(scene).constraints.limits
    limit = next((each for each in limits if each.own_measure is OwnMeasure.CLEARANCE), None)
    if limit is None:
        return None
    worst: Excess | None = None
    for index, body in scene.obstacles:
        least, t = least_clearance(body, trajectory.position, scene.least_clearance)
        over = scene.least_clearance - least
        subject = f"{limit.subject} from keep_out[{index}]"
        if worst is None or over > worst.value:
            worst = Excess(
                limit.name, limit.unit, subject, t, over, over, falls_below=True, known=Known.SURE
            )
    return worst


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

    found = surely_largest(
        Parts.of(path, FIRST),
        nearness,
        ENOUGH - asked,
        known=lambda too_near: too_near + ENOUGH,
        halvings=HALVINGS,
        most=MOST,
    )
    return -found.value, found.where


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
    """The same in the axes of a box or cylinder, without its radius."""
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
