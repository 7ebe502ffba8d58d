"""Ways past keep-out bodies: first motions on different sides of what is between start and goal.

Outside bounded convex bodies every path can be deformed into every other, so that ways are no
classes of homotopy: a way is which side of which body the motion passes, in order of time. A local
optimiser does not move a motion from one side of a body to another. So it begins with bows, which
are bent as a whole (``bows``), and, where these do not lead to a fast plan, with bands, which pass
one body after the other and are drawn tight (``bands``). Where bows are few or there are no bands,
it begins with paths of straight lines as well (``passages``).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, islice
from math import dist
from operator import itemgetter

import numpy as np

from deltaopt.curves.piecewise import QUINTIC, Array, PiecewisePolynomial
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.links import least_rooms
from deltaopt.motion.loads import loads_inside
from deltaopt.motion.sure_bounds import rows_not_kept
from deltaopt.motion.time_scaling import fractions_of
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.bands import (
    TENSIONS,
    Bodies,
    clear_bands,
    pulled,
    resampled,
    sampled,
    sides_of,
)
from deltaopt.planning.first_motions.bows import bows, is_near_any, sides_around, speeds
from deltaopt.planning.first_motions.in_tube import along_axis
from deltaopt.planning.first_motions.initial_motion import Proposal, roughly_fastest
from deltaopt.planning.first_motions.passages import shortest_paths, what_was_searched
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene

_MARGINS, _GENTLE = (0.02, 0.01, 0.003, 0.001, 3e-4, 1e-4), 2
"""How far bands through passages stay from bodies, as shares of the way from start to goal, one
after the other until there is room; and how many of the last steps of drawing these and the axes of
tubes get."""
_DIGITS = 9
"""Decimals of a band's places, m, so that a plan begins with the same bits whatever the processor:
how BLAS adds, and so the last bits of a band that was drawn tight, differ between them."""
_COINCIDE = 1e-6
"""Of the way from start to goal: places of a band that are nearer to each other are one."""
_BACK = -0.995
"""Cosine of the angle between two straight lines that are within a tenth of opposite."""
_LEAST, _FASTER = 0.03, 1.5
"""By what share of the slowing that a motion asks for each piece of it is taken to ask at least;
and how many times faster it is where it is driven by what its pieces ask for. By uniform
accelerations alone 10 of 546 scenes past obstacles take longer than the best known by 0.2 %, not 6;
with 1.25, 36 of 400 neighbouring problems take longer by 0.4 % to 0.7 %."""
CLEAR = "clear of all bodies"
"""The name of a way that comes near none."""
_FEW = 2
"""Ways along bows of the fastest motion without bodies: where there are fewer, as beside boards and
at the edge of the workspace, bows of the first motion and bands of bent lines are looked at too. Of
201 scenes past obstacles the worst took 36 % longer than the best without them, 3 % with them."""
_BENT, _OF_EACH = (0.4, 0.8), 2
"""Of the way, how far lines are bent to each of four sides then, and how many bands of each are
looked at. Bands of the line itself lead to one side of a body that fills half the workspace."""
_ASIDE = 0.01 * 2.0 ** np.arange(7)
"""How far a motion whose ends move is led aside halfway, as shares of how far it goes."""
_SAME = 0.05
"""Of the way: paths that are nowhere farther apart are the same way."""


def name_of_way(scene: Scene, motion: Trajectory) -> str:
    """The way that a motion takes past the bodies of a scene, in words."""
    bodies, path = Bodies.along(scene, motion)
    return _sides_in_words(bodies, path)


def _sides_in_words(bodies: Bodies, path: Array) -> str:
    """The sides of bodies on which a path leads, in order of time: "above keep_out[0]"."""
    return ", ".join(bodies.sides(path)) or CLEAR


def _way(bodies: Bodies, path: Array, motion: Trajectory) -> Proposal:
    """The way of a motion along a path, (n, 3), m."""
    return Proposal(f"the way {_sides_in_words(bodies, path)}", motion)


def no_way(scene: Scene) -> str:
    """A sentence for a scene in which no way past the bodies is found."""
    return (
        "start and goal are clear of all bodies, but no way past these is found: "
        f"{what_was_searched(scene)} lead there within all limits and clear of singularities"
    )


def ways_around(
    scene: Scene, first: Trajectory, free: Trajectory | None = None
) -> Iterator[list[Proposal]]:
    """The ways past the bodies of a scene, from one source after the other, of each the one that is
    driven fastest first. ``free``: the fastest motion without bodies, if it is known.

    First come ``first``, where that is clear of bodies, and bows of ``free``: ways that are much as
    it is are fast. Where ``first`` is not clear, then bands of it, or ways along paths of straight
    lines where there are none. Where bows of ``free`` are few, bows of ``first`` come as well, such
    ways beside bands, and at last bands of ``first`` bent as a whole to each of four sides.
    """
    bodies, known = Bodies.of(scene), list[Array]()

    def drawn(paths: Iterable[Array]) -> list[Proposal]:
        return _drawn_ways(scene, bodies, paths, known)

    found = [Proposal(f"the way {CLEAR}", first)] if is_clear(scene, first) else []
    bowed = drawn(bows(bodies, sampled(free))) if free else []
    are_few = not found and len(bowed) < _FEW
    if are_few:
        bowed += drawn(bows(bodies, sampled(first)))
    yield [*found, *sorted(bowed, key=lambda way: way.motion.duration)]
    bands = [] if found else drawn(_either_way(bodies, sampled(first)))
    yield bands
    if are_few or not (found or bands):
        yield _through_passages(scene, bodies)
    if free and are_few:
        lines = _bent(bodies, sampled(first))
        yield drawn(chain.from_iterable(islice(clear_bands(bodies, x), _OF_EACH) for x in lines))


def _either_way(bodies: Bodies, base: Array) -> Iterator[Array]:
    """Clear bands that pass one body after the other in order of time, and then those that pass
    them in the order of the way back, which may lead to other sides of them."""
    yield from clear_bands(bodies, base)
    yield from (band[::-1] for band in clear_bands(bodies, base[::-1]))


def ways_beside(scene: Scene, free: Trajectory) -> list[Proposal]:
    """The ways of the fastest motion without bodies, led aside to each side by as little as makes
    it clear of them: the one that is led aside least first, and each way once.

    Such a motion begins and ends at the velocities that are asked for. Ways that are driven from
    rest to rest do not.
    """
    bodies, path = Bodies.along(scene, free)
    found = list[tuple[float, Trajectory]]()
    for side in sides_around(path[-1] - path[0]):
        motions = ((size, free.beside(size * free.extent * side)) for size in _ASIDE.tolist())
        found += islice((each for each in motions if is_clear(scene, each[1])), 1)
    ways = dict[str, Proposal]()
    for _, motion in sorted(found, key=itemgetter(0)):
        path = sampled(motion)
        if (motion.model.alignments(path) > 0).all():  # False where not a number, out of reach
            way = _way(bodies, path, motion)
            ways.setdefault(way.name, way._replace(is_aside=True))
    return list(ways.values())


def _bent(bodies: Bodies, path: Array) -> Iterator[Array]:
    """A path (n, 3), m, whose middle is pulled to each of four sides."""
    middle = len(path) // 2
    for size in _BENT:
        for side in sides_of(path[-1] - path[0]):
            yield pulled(path, middle, middle, size * bodies.way * side)


def _drawn_ways(
    scene: Scene, bodies: Bodies, paths: Iterable[Array], known: list[Array]
) -> list[Proposal]:
    """The ways along paths (n, 3), m, as far as they can be driven, the fastest first; those that
    are much the same, or much as one that is ``known``, once."""
    found = list[Proposal]()
    for path in paths:
        places = resampled(path)
        if is_near_any(places, known, _SAME * bodies.way):
            continue
        motion = driven(scene, path)
        if motion is not None:
            known.append(places)
            found.append(_way(bodies, path, motion))
    return sorted(found, key=lambda way: way.motion.duration)


def clear_motions(scene: Scene, motions: Iterator[Trajectory], number: int) -> Iterator[Trajectory]:
    """As many first motions clear of all bodies, from motions that may run into these: all ways
    around bodies from the first of them, then from the next. A motion that none leads around is
    given as it is, and each path once."""
    paths = list[Array]()
    for motion in motions:
        ways = chain.from_iterable(ways_around(scene, motion))
        for each in [way.motion for way in ways] or [motion]:
            path = sampled(each)
            length = dist(path[-1], path[0])
            if is_near_any(path, paths, _SAME * length):
                continue
            paths.append(path)
            yield each
            if len(paths) == number:
                return


def _through_passages(scene: Scene, bodies: Bodies) -> list[Proposal]:
    """The ways along shortest paths of straight lines, the fastest first."""
    found = (_along_lines(scene, bodies, corners) for corners in shortest_paths(scene))
    return sorted(filter(None, found), key=lambda way: way.motion.duration)


def _along_lines(scene: Scene, bodies: Bodies, corners: Array) -> Proposal | None:
    """The way along straight lines between corners, (n, 3), m, rounded as far as bodies allow; with
    a stop at each corner where they do not; None where that cannot be driven."""
    band = resampled(corners)
    for margin in _MARGINS:
        drawn = replace(bodies, margin=margin).drawn(band[None], TENSIONS[-_GENTLE:])[0]
        motion = driven(scene, drawn) if bodies.hits(drawn[None])[0] is None else None
        if motion is not None:
            return _way(bodies, drawn, motion)
    motion = with_stops(scene, corners)
    return _way(bodies, band, motion) if motion else None


def axis_within_reach(scene: Scene) -> Trajectory | None:
    """The motion along a tube's axis, drawn within reach and tube; None as of ``driven``."""
    bodies, axis = Bodies.of(scene), resampled(along_axis(scene.axis_of_tube).reshape(-1, 3))
    drawn = bodies.drawn(bodies.in_reach(axis)[None], TENSIONS[-_GENTLE:])[0]
    return driven(scene, drawn)


def is_clear(scene: Scene, motion: Trajectory) -> bool:
    """Whether a motion is known to be clear of all bodies, with tool and links as far as these are
    planned to be, at all instants."""
    if rows_not_kept(problem_of(scene), motion.position).any():
        return False
    planned = [(link, body) for link, body, _ in scene.planned_links]
    return not planned or bool((least_rooms(scene, motion, pairs=planned) >= 0).all())


def leads_past(scene: Scene, motion: Trajectory) -> bool:
    """Whether a motion leads through no body, though it may cut corners."""
    bodies, path = Bodies.along(scene, motion)
    return bodies.is_nearly_clear(path)


def driven(scene: Scene, band: Array) -> Trajectory | None:
    """The motion along a band, as fast as the limits roughly allow; None where it is not possible
    or not clear of bodies between the samples.

    It has the same accelerations everywhere, or, where that is much faster, those that this motion
    tells to be possible at each place: near a singularity they are small.
    """
    band = np.concatenate([band[:1], np.round(band[1:-1], _DIGITS), band[-1:]])
    band = _without_spikes(band)
    found = _timed(scene, band, 1.0)
    if found is None:
        return None
    fractions = fractions_of(found)
    loads = loads_inside(problem_of(scene), found, fractions)
    slower = np.pad(loads.slowing(loads.highest_demands(len(fractions))), 1, "edge")
    beside = np.maximum.reduce([slower[:-2], slower[1:-1], slower[2:]])
    other = _timed(scene, band, np.maximum(beside, _LEAST) ** -2)
    return other if other is not None and _FASTER * other.duration < found.duration else found


def _timed(scene: Scene, band: Array, most: Array | float) -> Trajectory | None:
    """The motion along a band with the largest accelerations in its pieces in proportion to
    ``most``, (n - 1,), as fast as the limits roughly allow; None as of ``driven``."""
    steps = np.diff(band, axis=0)
    tangents = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    durations, fastest = speeds(band, most)
    tangent = np.vstack([tangents[:1], tangents[1:] + tangents[:-1], tangents[-1:]])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    t = np.append(0.0, np.cumsum(durations))
    position = PiecewisePolynomial.hermite(t, band, tangent * fastest[:, None])
    motion = Trajectory(position, model_of(scene.robot, scene.payload))
    if not is_clear(scene, motion):
        return None
    return if_possible(RULED_OUT, roughly_fastest, scene, motion)


def _without_spikes(band: Array) -> Array:
    """The band without places that all but coincide with another, and without those at which it
    turns right back: rounding would decide the direction there. Both of its ends stay.
    """
    least, kept = _COINCIDE * dist(band[0], band[-1]), [band[0]]
    for place in band[1:]:
        while len(kept) > 1 and (
            dist(place, kept[-1]) <= least or _turns_back(kept[-2], kept[-1], place)
        ):
            kept.pop()
        if dist(place, kept[-1]) > least:
            kept.append(place)
    return np.array(kept)


def _turns_back(before: Array, place: Array, after: Array) -> bool:
    """Whether the straight lines to and from a place are within a tenth of opposite."""
    arriving, leaving = place - before, after - place
    return float((arriving * leaving).sum()) < _BACK * dist(place, before) * dist(after, place)


def with_stops(scene: Scene, corners: Array) -> Trajectory | None:
    """The motion along straight lines, at rest at every corner, (n, 3), m; None where it cannot be
    driven."""
    model = model_of(scene.robot, scene.payload)
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    knots = np.append(0.0, np.cumsum(np.sqrt(lengths)))
    coefficients = np.zeros((len(lengths), len(QUINTIC), 3))
    times = np.vander(np.diff(knots), len(QUINTIC), increasing=True)
    coefficients[:] = (QUINTIC / times)[:, :, None] * np.diff(corners, axis=0)[:, None]
    coefficients[:, 0] = corners[:-1]
    motion = Trajectory(PiecewisePolynomial(knots, coefficients), model)
    return if_possible(RULED_OUT, roughly_fastest, scene, motion)
