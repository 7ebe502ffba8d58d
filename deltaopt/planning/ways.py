"""Ways past keep-out bodies: first motions on different sides of what is between start and goal.

A local optimiser does not move a motion from one side of a body to another. So where a first motion
runs into a body it is bent around it, to each of four sides; what it then runs into is passed in
the same way. Every bent path is drawn tight, as a band that bodies push away, and what is clear of
all of them is compared by how fast it can be driven.

Outside bounded convex bodies every path can be deformed into every other, so that ways are no
classes of homotopy: a way is which side of which body the motion passes, in order of time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, TypeVar

import numpy as np

from deltaopt.errors import DeltaOptError, Infeasible, NotConverged, Singular, Unreachable
from deltaopt.limits.constraints import SceneLimits
from deltaopt.motion.links import least_rooms, planned_distances
from deltaopt.motion.sure_bounds import rows_not_kept, signed_distances
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.planning.first_motions.initial_motion import QUINTIC, roughly_fastest
from deltaopt.planning.first_motions.passages import shortest_path, what_was_searched
from deltaopt.planning.near_bodies import near, past_these, with_those_hit
from deltaopt.planning.refinement import Slower
from deltaopt.planning.search import Attempt
from deltaopt.robot.model import delta_model
from deltaopt.scene.links import ROUGH_BISECTIONS, name_of
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.scene.task import given_points

_SAMPLES = 64
"""Pieces of a band. More follow bodies more closely, but are drawn tight more slowly."""
_MARGIN = 0.02
"""How far bands stay from bodies where there is room, as a share of the way from start to goal:
a first motion that touches bodies leaves a solver no inside to begin in."""
_MARGINS, _GENTLE = (0.02, 0.01, 0.003, 0.001, 3e-4, 1e-4), 4
"""The same for paths through passages, one after the other until there is room; and how many of the
last steps of drawing they get."""
_RISE = 0.3
"""By how much the margin grows with the distance from an end that is nearer to a body than that."""
_TENSIONS = np.geomspace(300.0, 3.0, 16)
"""Tension of a band over that with which a sample stays where it is, step by step: high ones draw
it straight between bodies, low ones leave it smooth where these push it."""
_DEPTH, _WIDTH = 4, 24
"""How many bodies are passed one after the other, and how many bands are bent in all: each costs
some 0.1 ms."""
_FARTHEST = 2.0
"""Of the way from start to goal, how far a path is bent aside at most."""
CLEAR = "clear of all bodies"
"""The name of a way that comes near none."""
_NEAR = 0.1
"""Of the way: bodies that a path comes nearer to are named."""
_MOST_WAYS, _PROMISING = 6, 1.03
"""How many ways past bodies are solved on the first mesh, those that can be driven fastest, and how
much slower than the fastest of them there a way may be that is planned too. A mesh of 16 intervals
tells durations to some two per cent."""
_FINER = (1, 2, 4)
"""By what factors the first mesh is made finer until a plan past bodies succeeds: between the
points of a coarse mesh a motion may lead through a thin body."""
_NEARLY = 1e-2
"""Gap above which a plan that misses its tolerance is far from an optimum, so that another one is
made from a finer first mesh."""
_SAME = 0.05
"""Of the way: bands that are nowhere farther apart are the same way."""
_SAME_MOTION, _COMPARED = 0.01, 33
"""Of the way: motions on the first mesh that are nowhere farther apart at the same share of their
durations, at so many instants, are the same motion, to what a first mesh is solved to."""


@dataclass(frozen=True, eq=False)
class Way:
    """A first motion that keeps clear of all bodies, and the ``sides`` on which it passes those
    that it comes near, in order of time: "above keep_out[0]"."""

    motion: Trajectory
    sides: tuple[str, ...]

    @property
    def name(self) -> str:
        """In words."""
        return ", ".join(self.sides) or CLEAR


@dataclass(frozen=True)
class TakenWay:
    """A way past bodies in words, and how long it takes, s. ``is_planned``: to the tolerance that
    was asked for; otherwise on the first mesh alone, about."""

    name: str
    duration: float
    is_planned: bool


class Planned(Protocol):
    """A plan, as far as the choice among ways asks for it."""

    @property
    def duration(self) -> float: ...
    @property
    def cost(self) -> float: ...
    @property
    def gap(self) -> float: ...
    @property
    def within_tolerance(self) -> bool: ...
    @property
    def trajectory(self) -> Trajectory: ...


P = TypeVar("P", bound=Planned)
Planning = Callable[[Attempt], P]
"""Plans from an attempt. Raises NotConverged."""


def fastest_way(
    attempt: Attempt, planned: Planning[P], on_first_mesh: Callable[[Attempt], Trajectory]
) -> tuple[P, tuple[TakenWay, ...]]:
    """The best plan of all ways past the bodies of a scene, and the ways, first the one taken.

    ``attempt``: from a motion that may run into bodies. ``on_first_mesh``: the motion that is best
    on the first mesh of an attempt; it may raise NotConverged, as may ``planned``. Raises
    Infeasible where there is no way, and NotConverged where none leads to a plan.
    """
    ways = ways_around(attempt.scene, attempt.motion)
    if not ways and attempt.scene.planned_links:  # a solver may move links out of bodies
        ways = [Way(attempt.motion, ())]
    if not ways:
        raise Infeasible(no_way(attempt.scene))
    failures, found = list[NotConverged](), list[tuple[P, tuple[TakenWay, ...]]]()
    for factor in _FINER:
        finer = replace(attempt, intervals=factor * attempt.intervals)
        try:
            found.append(_best_of(ways[:_MOST_WAYS], finer, planned, on_first_mesh))
        except NotConverged as error:
            failures.append(error)
            continue
        best, taken = min(found, key=lambda one: one[0].cost)
        if best.within_tolerance or best.gap <= _NEARLY or len(found) > 1:
            return best, taken
    if found:
        return found[0]
    raise failures[0]


def _best_of(
    ways: list[Way],
    attempt: Attempt,
    planned: Planning[P],
    on_first_mesh: Callable[[Attempt], Trajectory],
) -> tuple[P, tuple[TakenWay, ...]]:
    """The same for some ways on one first mesh: those that are fast there are planned."""
    scene, attempts = attempt.scene, [_along(way, attempt) for way in ways]
    if len(ways) > 1:
        attempts = [_improved(scene, each, on_first_mesh) for each in attempts]
    order = _distinct(attempts)
    most = _PROMISING * attempts[order[0]].motion.duration
    plans, failures = dict[int, P](), list[NotConverged]()
    durations = {i: attempts[i].motion.duration for i in order if attempts[i].is_near}
    for which in order:
        if plans and attempts[which].motion.duration > most:
            break
        if plans and isinstance(scene.objective, Time):
            known = min(plan.duration for plan in plans.values())
            attempts[which] = replace(attempts[which], most=known)
        try:
            plans[which] = _past_all(scene, attempts[which], planned)
        except Slower as error:
            durations[which] = error.duration
        except NotConverged as error:
            failures.append(error)
    if not plans:
        raise failures[0]
    chosen = min(plans, key=lambda which: plans[which].cost)
    durations |= {i: plan.duration for i, plan in plans.items()}
    taken = sorted(durations, key=lambda i: (i != chosen, durations[i]))
    return plans[chosen], tuple(
        TakenWay(ways[i].name, durations[i], is_planned=i in plans) for i in taken
    )


def _along(way: Way, attempt: Attempt) -> Attempt:
    """An attempt from the motion of a way, past the bodies that this comes near."""
    bodies = near(attempt.scene, way.motion.position)
    return replace(attempt, scene=past_these(attempt.scene, bodies), motion=way.motion)


def _improved(
    scene: Scene, attempt: Attempt, on_first_mesh: Callable[[Attempt], Trajectory]
) -> Attempt:
    """An attempt from the motion that is best on its first mesh, where that is found, past all
    bodies that it runs into; ``scene``: with all bodies."""
    try:
        motion = on_first_mesh(attempt)
    except (NotConverged, Unreachable, Singular):
        return attempt
    more = with_those_hit(scene, attempt.scene, motion.position)
    if more is not None:
        return _improved(scene, replace(attempt, scene=more), on_first_mesh)
    return replace(attempt, motion=motion, is_near=True)


def _past_all(scene: Scene, attempt: Attempt, planned: Planning[P]) -> P:
    """A plan from an attempt, past all bodies that it runs into; ``scene``: with all bodies."""
    plan = planned(attempt)
    more = with_those_hit(scene, attempt.scene, plan.trajectory.position)
    return plan if more is None else _past_all(scene, replace(attempt, scene=more), planned)


def _distinct(attempts: list[Attempt]) -> list[int]:
    """Which attempts to plan from, the fastest motion first: of those whose first mesh led to the
    same motion one alone, for all would lead to the same plan."""
    found, paths = list[int](), list[Array]()
    for i in sorted(range(len(attempts)), key=lambda i: attempts[i].motion.duration):
        motion = attempts[i].motion
        path = motion.position.at(motion.knots[0] + motion.duration * np.linspace(0, 1, _COMPARED))
        way = float(np.linalg.norm(path[-1] - path[0]))
        if any(np.abs(path - other).max() < _SAME_MOTION * way for other in paths):
            continue
        found.append(i)
        paths.append(path)
    return found


def name_of_way(scene: Scene, motion: Trajectory) -> str:
    """The way that a motion takes past the bodies of a scene, in words."""
    return Way(motion, _Bodies.of(scene).sides(_sampled(motion))).name


def no_way(scene: Scene) -> str:
    """A sentence for a scene in which no way past the bodies is found."""
    return (
        "start and goal are clear of all bodies, but no way past these is found: "
        f"{what_was_searched(scene)} lead there"
    )


def ways_around(scene: Scene, first: Trajectory) -> list[Way]:
    """The ways past the bodies of a scene, the one that is driven fastest first; none if none is
    found. ``first``: a motion that may run into bodies."""
    if is_clear(scene, first):
        return [Way(first, ())]
    bodies = _Bodies.of(scene)
    found: list[Way] = []
    bands: list[Array] = []
    for band in _clear_bands(bodies, _sampled(first)):
        if any(np.abs(band - other).max() < _SAME * bodies.way for other in bands):
            continue
        bands.append(band)
        motion = _driven(scene, band)
        if motion is not None:
            found.append(Way(motion, bodies.sides(band)))
    if not found:
        found = list(_through_passages(scene, bodies))
    return sorted(found, key=lambda way: way.motion.duration)


def clear_motions(scene: Scene, motions: Iterator[Trajectory], number: int) -> Iterator[Trajectory]:
    """As many first motions clear of all bodies, from motions that may run into these: all ways
    around bodies from the first of them, then from the next. A motion that none leads around is
    given as it is, and each path once."""
    paths = list[Array]()
    for motion in motions:
        for each in [way.motion for way in ways_around(scene, motion)] or [motion]:
            path = _sampled(each)
            length = float(np.linalg.norm(path[-1] - path[0]))
            if any(np.abs(path - other).max() < _SAME * length for other in paths):
                continue
            paths.append(path)
            yield each
            if len(paths) == number:
                return


def fastest_moving_way(
    attempt: Attempt, planned: Planning[P], on_first_mesh: Callable[[Attempt], Trajectory]
) -> tuple[P, tuple[TakenWay, ...]] | None:
    """As ``fastest_way`` where an end moves: ways from rest to rest between the ends of the motion
    of the attempt begin and end as a solver is asked to change it, but pass bodies. None where
    there are none or none leads to a plan."""
    scene, position = attempt.scene, attempt.motion.position
    begin, end = (tuple(x) for x in position.at(position.knots[[0, -1]]).tolist())
    try:
        at_rest = scene.model_copy(update={"start": begin, "goal": end, "via": None})
        ways = ways_around(at_rest, attempt.motion)
        return _best_of(ways[:_MOST_WAYS], attempt, planned, on_first_mesh) if ways else None
    except DeltaOptError:  # an end may be too near to a body to be at rest there
        return None


def _through_passages(scene: Scene, bodies: _Bodies) -> Iterator[Way]:
    """The way along the shortest path of straight lines, rounded as far as bodies allow; with a
    stop at each of its corners where they do not."""
    corners = shortest_path(scene)
    if corners is None:
        return
    band = _resampled(corners)
    for margin in _MARGINS:
        drawn = replace(bodies, margin=margin).drawn(band[None], _TENSIONS[-_GENTLE:])[0]
        motion = _driven(scene, drawn) if bodies.hits(drawn) is None else None
        if motion is not None:
            yield Way(motion, bodies.sides(drawn))
            return
    motion = _with_stops(scene, corners)
    if motion is not None:
        yield Way(motion, bodies.sides(band))


@dataclass(frozen=True)
class _Bodies:
    """The bodies of a scene as functions of the place. ``way``: distance from start to goal, m.
    ``at_ends``: distances of start and goal from each body, (2, rows), m."""

    scene: Scene
    limits: SceneLimits
    ends: Array
    at_ends: Array
    way: float
    margin: float = _MARGIN

    @classmethod
    def of(cls, scene: Scene) -> _Bodies:
        ends = np.array(given_points(scene.task))
        at_ends, _ = _distances(scene, ends)
        way = float(np.linalg.norm(ends[1] - ends[0]))
        return cls(scene, limits_of(scene), ends, at_ends, way)

    @property
    def kept(self) -> Array:
        """The least distance from each body, m, then those of links that are planned to keep clear
        of one."""
        of_tool = self.limits.bounds[0][self.limits.constraints.convex]
        return np.append(of_tool, [each.least for each in self.scene.kept_links])

    def margins(self, x: Array) -> Array:
        """How far places (…, 3) are to be from bodies, (…, rows): less near an end that is."""
        margin = self.kept + self.margin * self.way
        for end, own in zip(self.ends, self.at_ends, strict=True):
            away = np.linalg.norm(x - end, axis=-1)[..., None]
            margin = np.minimum(margin, own + _RISE * away)
        return margin

    def drawn(self, bands: Array, tensions: Array) -> Array:
        """Bands (W, n, 3) drawn tight by one tension after the other, pushed away by bodies; their
        ends stay."""
        for smoothing in map(_smoothing, tensions.tolist()):
            bands = smoothing @ bands
            for _ in range(2):
                inner = bands[:, 1:-1].reshape(-1, 3)
                distance, slope = _distances(self.scene, inner)
                short = np.maximum(self.margins(inner) - distance, 0.0)
                worst, which = short.argmax(axis=1), np.arange(len(inner))
                inner = inner + short[which, worst, None] * slope[which, worst]
                bands[:, 1:-1] = inner.reshape(len(bands), -1, 3)
        return bands

    def hits(self, band: Array) -> tuple[int, int, int] | None:
        """The body that a band runs into first, and between which samples; None if it is clear."""
        distance, _ = _distances(self.scene, band)
        inside = distance < self.kept
        inside[[0, -1]] = False
        if not inside.any():
            return None
        first = int(inside.any(axis=1).argmax())
        body = int((distance[first] - self.kept).argmin())
        last = first
        while last + 1 < len(band) and inside[last + 1, body]:
            last += 1
        return body, first, last

    def bent(self, band: Array, body: int, first: int, last: int) -> Iterator[Array]:
        """A band bent around a body that it is inside of from one sample to another, to the four
        sides of its own direction."""
        along = band[last + 1] - band[first - 1]
        for side in _sides(along):
            x, shift = band[first : last + 1], 0.0
            while shift <= _FARTHEST * self.way:
                distance, slope = _distances(self.scene, x + shift * side)
                short = self.kept[body] + _MARGIN * self.way - distance[:, body]
                if short.max() <= 1e-3 * self.way:
                    yield _pulled(band, first, last, shift * side)
                    break
                gain = np.maximum(slope.reshape(len(x), -1, 3)[:, body] @ side, 0.2)
                shift += float((np.maximum(short, 0.0) / gain).max())

    def sides(self, band: Array) -> tuple[str, ...]:
        """On which sides a band passes the bodies that it comes near, in order of time."""
        distance, slope = _distances(self.scene, band)
        near = distance <= self.kept + _NEAR * self.way
        near[[0, -1]] = False
        found = []
        for row, (index, _) in enumerate(self.scene.obstacles):
            places = np.flatnonzero(near[:, self._row(row)])
            if len(places):
                place = int(places[len(places) // 2])
                way = _direction(slope[place, self._row(row)])
                found.append((place, f"{way} keep_out[{index}]"))
        for row, (link, index, _) in enumerate(self.scene.planned_links, self._row_of_links):
            places = np.flatnonzero(near[:, row])
            if len(places):
                place = int(places[len(places) // 2])
                found.append((place, f"{name_of(link)} clear of keep_out[{index}]"))
        return tuple(dict.fromkeys(name for _, name in sorted(found)))

    def _row(self, obstacle: int) -> int:
        """Which row of the limits is that of an obstacle: unused places have none."""
        return int(np.flatnonzero(np.isfinite(self.kept))[obstacle])

    @property
    def _row_of_links(self) -> int:
        """Which row is the first of links."""
        return len(self.kept) - len(self.scene.planned_links)


def _distances(scene: Scene, x: Array) -> tuple[Array, Array]:
    """How far the tool's point at places (N, 3), m, is from bodies, and then links that are planned
    to keep clear of them, (N, rows), and the derivatives by the place, (N, rows, 3)."""
    distance, slope = signed_distances(scene, x)
    if not scene.planned_links:
        return distance, slope
    of_links, by_place = planned_distances(scene, x, ROUGH_BISECTIONS)
    out_of_reach = np.isnan(of_links)  # where another limit holds
    of_links[out_of_reach], by_place[out_of_reach] = np.inf, 0.0
    return np.hstack([distance, of_links]), np.hstack([slope, by_place])


def is_clear(scene: Scene, motion: Trajectory) -> bool:
    """Whether a motion is known to be clear of all bodies, with tool and links as far as these are
    planned to be, at all instants."""
    if rows_not_kept(scene, motion.position).any():
        return False
    if not scene.planned_links:
        return True
    rooms = least_rooms(scene, motion)
    return all(rooms[link, body] >= 0 for link, body, _ in scene.planned_links)


def _clear_bands(bodies: _Bodies, base: Array) -> Iterator[Array]:
    """Bands that are clear of all bodies, from one that is not."""
    front, bent = [base], 0
    for _ in range(_DEPTH):
        candidates = []
        for band in front:
            hit = bodies.hits(band)
            if hit is not None:
                candidates += list(bodies.bent(band, *hit))
        candidates = candidates[: _WIDTH - bent]
        bent += len(candidates)
        if not candidates:
            return
        front = []
        for bowed, band in zip(
            candidates, bodies.drawn(np.array(candidates), _TENSIONS), strict=True
        ):
            clear = [each for each in (band, bowed) if bodies.hits(each) is None]
            yield from clear[:1]
            front += [] if clear else [bowed]


@lru_cache(maxsize=64)
def _smoothing(tension: float) -> Array:
    """A linear map of the samples of a band, (n, n), that lessens its tension and its bending, and
    leaves its ends."""
    n = _SAMPLES + 1
    second = np.diff(np.eye(n), 2, axis=0)
    stiffness = np.zeros((n, n))
    stiffness[1:-1] = tension * (10 * (second.T @ second)[1:-1] - second)
    return np.asarray(np.linalg.inv(np.eye(n) + stiffness), dtype=float)


def _sides(along: Array) -> Array:
    """Unit vectors across a direction: up, down and to both sides, as far as these are across."""
    ahead = along / np.linalg.norm(along)
    up = np.array([-1.0, 0.0, 0.0]) + ahead[0] * ahead
    if np.linalg.norm(up) < 1e-3:  # straight up or down
        up = np.array([0.0, 1.0, 0.0]) - ahead[1] * ahead
    up /= np.linalg.norm(up)
    left = np.cross(ahead, up)
    return np.array([up, left, -left, -up])


def _direction(slope: Array) -> str:
    """A side of a body in words: x points down."""
    axis = int(np.abs(slope).argmax())
    if axis == 0:
        return "above" if slope[0] < 0 else "below"
    return f"on the {'+' if slope[axis] > 0 else '-'}{'xyz'[axis]} side of"


def _pulled(band: Array, first: int, last: int, shift: Array) -> Array:
    """A band of which the samples from one to another are shifted, and those before and after in
    proportion."""
    n = len(band)
    share = np.ones(n)
    share[:first] = np.sin(np.pi / 2 * np.arange(first) / first)
    share[last + 1 :] = np.sin(np.pi / 2 * np.arange(n - last - 2, -1, -1) / (n - 1 - last))
    return np.asarray(band + share[:, None] * shift)


def _sampled(motion: Trajectory) -> Array:
    """Places of a motion at equal distances along its path, (n, 3), m."""
    u = np.linspace(motion.knots[0], motion.knots[-1], 8 * _SAMPLES + 1)
    return _resampled(motion.position.at(u))


def _resampled(x: Array) -> Array:
    """Places at equal distances along straight lines between places (N, 3), m."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1)))
    wanted = np.linspace(0.0, along[-1], _SAMPLES + 1)
    return np.stack([np.interp(wanted, along, x[:, i]) for i in range(3)], axis=1)


def _driven(scene: Scene, band: Array) -> Trajectory | None:
    """The motion along a band, as fast as the limits roughly allow; None where it is not possible
    or not clear of bodies between the samples."""
    steps = np.diff(band, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    tangents = steps / lengths[:, None]
    turn = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    speeds = _speeds(lengths, 2 * turn / (lengths[1:] + lengths[:-1]))
    tangent = np.vstack([tangents[:1], tangents[1:] + tangents[:-1], tangents[-1:]])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    t = np.append(0.0, np.cumsum(2 * lengths / (speeds[1:] + speeds[:-1])))
    position = PiecewisePolynomial.hermite(t, band, tangent * speeds[:, None])
    model = delta_model(scene.robot, scene.payload)
    try:
        if not is_clear(scene, Trajectory(position, model)):
            return None
        return roughly_fastest(scene, Trajectory(position, model))
    except DeltaOptError:
        return None


def _with_stops(scene: Scene, corners: Array) -> Trajectory | None:
    """The motion along straight lines, at rest at every corner, (n, 3), m; None where it cannot be
    driven."""
    model = delta_model(scene.robot, scene.payload)
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    knots = np.append(0.0, np.cumsum(np.sqrt(lengths)))
    coefficients = np.zeros((len(lengths), len(QUINTIC), 3))
    times = np.diff(knots)[:, None] ** np.arange(len(QUINTIC))
    coefficients[:] = (QUINTIC / times)[:, :, None] * np.diff(corners, axis=0)[:, None]
    coefficients[:, 0] = corners[:-1]
    try:
        return roughly_fastest(scene, Trajectory(PiecewisePolynomial(knots, coefficients), model))
    except DeltaOptError:
        return None


def _speeds(lengths: Array, curvature: Array) -> Array:
    """The largest speeds at the samples of a path at which the acceleration, forwards and sideways
    each, is at most 1, from rest to rest; as if the robot's reach were a ball of accelerations."""
    squares = np.concatenate([[0.0], 1 / np.maximum(curvature, 1e-9), [0.0]])
    for k in range(len(lengths)):
        squares[k + 1] = min(squares[k + 1], squares[k] + 2 * lengths[k])
    for k in reversed(range(len(lengths))):
        squares[k] = min(squares[k], squares[k + 1] + 2 * lengths[k])
    return np.asarray(np.sqrt(squares))
