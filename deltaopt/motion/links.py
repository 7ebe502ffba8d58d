"""How near arms and forearms come to keep-out bodies along a motion: sure bounds.

A link is a capsule about a line. At an instant t the place of the line that is nearest to a body,
and that of the body, have a plane between them, with the normal n. All of the body is on one side
of it at any time; the line is on the other side as long as both of its ends are. So within h of t
the line is at least

    d(t) + min over both ends e of n·(e(t) - nearest place) - |n·ė(t)| h - A_e h²/2

from the body, where ‖ë‖ ≤ A_e. It holds for any place of the line, not only the nearest. Pins move
as the platform does, on polynomials. An elbow follows from them: with u the direction of the
forearm of length l and e′ that in which the elbow, at the end of an arm of length L, moves,

    L θ̇ (u·e′) = u·ẇ        l L θ̈ (u·e′) = ‖ẇ - ė‖² + l u·ẅ + l L θ̇² u·e″

for pins at w. |u·e′|, 0 in a serial singularity, changes no faster than both directions turn, which
bounds it from below, and with it θ̇ and θ̈. Parts of a motion are halved until the bounds say enough.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from deltaopt.curves.halving import Parts, halve_until_known
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.solids import Solid
from deltaopt.scene.bodies import solids_about
from deltaopt.scene.links import LINKS, LinkGeometry, each_link, kept_from_bodies, nearest
from deltaopt.scene.scene import Scene

_FIRST = 4
"""Parts of each piece of a motion to begin with."""
_HALVINGS, _MOST = 24, 200_000
"""Of a part, and pairs of a part and a body that are looked at in all: what is not known then is
taken to be as bad as the bound says."""
_LEAST_SHARE = 0.5
"""Of |u·e′| at an instant, down to which it may fall within a part."""


def least_rooms(
    scene: Scene, motion: Trajectory, pairs: Iterable[tuple[int, int]] | None = None
) -> Array:
    """By how much more than its radius and the scene's clearance each link stays away from each
    body at least, at all instants, (6, bodies), m; negative where it does not. ``pairs``: of a link
    and a body that are looked at, if not all; others are as if infinitely far away.

    More than 0 it is a bound that may be far too low, less it is what is seen at the worst of many
    instants, and NaN where the motion is out of reach.
    """
    bodies, kept = solids_about(scene.keep_out or ()), kept_from_bodies(scene)
    least = np.full((LINKS, len(bodies)), np.inf)
    looked_at: dict[int, list[int]] = {}
    for link, body in np.ndindex(least.shape) if pairs is None else pairs:
        looked_at.setdefault(body, []).append(link)

    def unknown(parts: Parts, is_last: bool) -> Truths:
        lines = _Lines(delta_model(scene.robot, motion.model.payload), parts)
        is_open = np.zeros(len(parts), np.bool)
        for b, links in looked_at.items():
            now, bound = lines.rooms(links, bodies[b], kept)  # (parts, links) each
            is_too_near, below = ~(now >= 0), np.minimum(now, bound)
            is_known = is_too_near | (below >= 0) | is_last
            own = np.where(is_known, np.where(is_too_near, now, below), np.inf).min(axis=0)
            least[links, b] = np.minimum(least[links, b], own)
            is_open |= ~is_known.all(axis=1)
        return is_open

    most = _MOST // max(1, len(looked_at))
    halve_until_known(Parts.of(motion.position, _FIRST), unknown, _HALVINGS, most)
    return least


def planned_distances(scene: Scene, x: Array) -> tuple[Array, Array]:
    """How far the lines of ``Scene.kept_links`` are from bodies with the tool's point at places
    (N, 3), m, (N, pairs), and the derivatives of that by the place, (N, pairs, 3). NaN out of
    reach."""
    geometry = LinkGeometry.of(delta_model(scene.robot, scene.payload), x)
    distances = np.zeros((len(x), len(scene.kept_links)))
    slopes = np.zeros((*distances.shape, 3))
    begin, end = geometry.links
    for k, kept in enumerate(scene.kept_links):
        which = slice(kept.link, kept.link + 1)
        share, distance, normal = nearest(kept.body, begin[:, which], end[:, which])
        distances[:, k] = distance[:, 0]
        slopes[:, k] = geometry.slope(kept.link, share[:, 0], normal[:, 0])
    return distances, slopes


class _Lines:
    """The lines of all links in the middles of parts of a motion: where they begin and end,
    (parts, 6, 3), m, and how fast both ends move, m/s. ``bends``: what the ends' accelerations are
    at most in the parts, (parts, 6, 2), m/s²: infinite where that is not known. ``half``: of the
    parts' durations, s."""

    def __init__(self, model: DeltaModel, parts: Parts) -> None:
        """Of the links of a robot's model."""
        robot = model.robot
        v, geometry = parts.at(1), LinkGeometry.of(model, parts.at())
        speed, bend = parts.largest(1)[:, None], parts.largest(2)[:, None]
        lever, half = np.abs(geometry.levers), parts.half[:, None]
        arm, forearm = robot.upper_arm.length, robot.forearm.length
        of_elbows = _elbow_bends(lever, speed, bend, half, arm, forearm)
        of_pins, still = np.broadcast_to(bend, lever.shape), np.zeros_like(geometry.elbows)
        along = (geometry.directions * v[:, None]).sum(axis=2) / geometry.levers
        elbow_rates = along[..., None] * geometry.ahead
        pin_rates = np.broadcast_to(v[:, None], still.shape)
        of_begins, of_ends = each_link(still[..., 0], of_elbows), each_link(of_elbows, of_pins)
        self.begins, self.ends = geometry.links
        self.begin_rates = each_link(still, elbow_rates)
        self.end_rates = each_link(elbow_rates, pin_rates)
        self.bends = np.stack([of_begins, of_ends], axis=2)
        self.half = parts.half

    def rooms(self, links: list[int], body: Solid, kept: Array) -> tuple[Array, Array]:
        """By how much more than is kept, (6,), m, the lines of some links stay away from a body:
        now, and at least in all of the part, (parts, links) each."""
        begins, ends = self.begins[:, links], self.ends[:, links]
        way = ends - begins
        share, distance, normal = nearest(body, begins, ends)
        along = (normal * way).sum(axis=2)
        ahead = np.stack([-share * along, (1 - share) * along], axis=2)
        rates = np.stack([self.begin_rates[:, links], self.end_rates[:, links]], axis=2)
        moved = np.abs(np.einsum("plc,plec->ple", normal, rates)) * self.half[:, None, None]
        off = self.bends[:, links] * self.half[:, None, None] ** 2 / 2
        bound = distance + (ahead - moved - off).min(axis=2)
        return distance - kept[links], bound - kept[links]


def _elbow_bends(
    lever: Array, speed: Array, bend: Array, half: Array, arm: float, forearm: float
) -> Array:
    """What the acceleration of an elbow is at most within a half part (s) of an instant at which
    |u·e′| is ``lever``, m/s²; infinite where it may fall below half of that. ``speed``, ``bend``:
    the most that the platform's velocity and acceleration are."""
    fastest = speed / (_LEAST_SHARE * lever)
    turning = (speed + fastest) / forearm + fastest / arm
    least = lever - turning * half
    elbow = speed / least
    angular = (speed + elbow) ** 2 / forearm + bend + elbow**2 / arm
    bends = angular / least + elbow**2 / arm
    return np.where(least >= _LEAST_SHARE * lever, bends, np.inf)
