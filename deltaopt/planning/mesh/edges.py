"""Motions over sharp edges of bodies and of tubes, in phases that end where an edge is passed.

At an edge that neither tool nor clearance rounds, the distance from a body has no derivative. A
solver then finds no way around it unless the motion keeps off, and on every mesh there is another
best motion, for another point lies on either side of the edge. But a body is what all half-spaces
beyond its faces have in common: a motion is clear of it as long as it is clear of one face at any
instant. So where a solution on a mesh touches an edge, it tells which face it is clear of when; and
with a phase for each, whose duration is free, no kink is left. Wherever one phase meets the next
the motion is clear of both faces: on the edge, where it touches that.

What is clear of a face is clear of the body, so that a wrong choice of faces costs time alone,
which the multipliers of limits with room left tell as part of the gap. On a first mesh, edges that
are rounded by less than its points are apart count as sharp.

A tube has such edges too, inside of bends whose radius of curvature is less than the tube's radius:
there a motion is in the tube about the stretch of the path before the middle of the bend, or in
that about the stretch after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from operator import itemgetter

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.limits.limit import DividedLimit
from deltaopt.limits.scene_limits import Placed, SceneLimits
from deltaopt.motion.sure_bounds import distances_from_faces, signed_distances
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.planning.nlp.phases import FacePhases
from deltaopt.planning.nlp.problem import Guess, MeshProgram, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.problem.boundary import ANYWHERE, Boundary
from deltaopt.problem.problem import Problem

_SHARP = 2e-5
"""Radius of edges, m, up to which they are sharp."""
_MOST_PHASES = 8
"""More say that bodies have too many faces for phases of their own."""
_SHORTEST = 2e-3
"""Shortest phase, as a fraction of the duration."""
_SAMPLES = 8
"""Places of each interval that are looked at."""
_NEAR_END = 2 * _SAMPLES
"""Samples from an end of a part to which contacts count as its edge's."""
_INSIDE = 1e-3
"""How far from its edges, m, a motion touches a face that it is not on the edge of."""
_ROOM = 3.0
"""How near a motion must come to both faces of an edge to pass on it, in units of the radius up to
which edges are sharp, but ``_INSIDE`` at least, which rules on the meshes of plans: in a window of
3 mm a motion that touches one edge is 1 mm from the opposite one."""
_OPPOSITE = 1e-9
"""What the sum of the distances from two opposite faces varies by, m: they have no edge."""
_ROUNDING = 1e-6
"""How far, m, a motion may be beyond a face and still count as clear of it. Where a solution bulges
over a body between points, it is farther beyond all faces, and counts as clear of the nearest."""
_AT_BODY = 1e-4
"""How near, m, a motion comes to a body whose edge it passes."""
_TOUCHES, _FREE = 0.02, 1e-6
"""Of all that a limit costs, what an interval must cost to count as touching it; and what the limit
must cost, as a fraction of the duration per share of its bound."""


@dataclass(frozen=True)
class _Part:
    """A part of a motion, from a sample on, in which it keeps limits with other numbers: clear of a
    face of a body, or in the tube about a stretch of its path. ``on_edge``: whether it begins on an
    edge that is touched."""

    begin: int
    numbers: Array
    on_edge: bool


def next_phases(
    program: MeshProgram,
    scaling: Scaling,
    motion: Trajectory,
    solution: Solved,
    sharp: float = _SHARP,
) -> FacePhases | None:
    """The phases of ``phases_over_edges`` for next meshes, from the solution of a program; None
    also where there can be none."""
    if not _takes_phases(program, scaling):
        return None
    return phases_over_edges(scaling.problem, motion, touching(solution), sharp)


def first_phases(program: MeshProgram, scaling: Scaling, guess: Guess) -> tuple[Scaling, Array]:
    """The scaling and the mesh, (N,), to begin with. If the guess is near the best motion and comes
    within 0.1 mm of a body at a sharp edge, as one that was found in phases does, they have the
    phases past that edge."""
    problem, mesh = scaling.problem, program.mesh
    if not guess.near or not _takes_phases(program, scaling):
        return scaling, mesh
    distances, _ = signed_distances(problem, _samples(guess.trajectory)[1])
    convex = problem.limits.constraints.convex
    near = distances < problem.limits.least_distances + _AT_BODY
    touched = np.zeros((len(near) // _SAMPLES, len(convex)), np.bool)
    touched[:, convex] = near.reshape(len(touched), _SAMPLES, near.shape[1]).any(axis=1)
    faces = phases_over_edges(problem, guess.trajectory, touched)
    if faces is None:
        return scaling, mesh
    return replace(scaling, faces=faces), faces.on(mesh, problem.together)


def _takes_phases(program: MeshProgram, scaling: Scaling) -> bool:
    """Whether a program can be solved in phases past edges, and there may be some."""
    has_edges = scaling.constraints.has_convex or scaling.problem.limits.divided is not None
    return program.takes_phases and has_edges


def phases_over_edges(
    problem: Problem, motion: Trajectory, touched: Truths, sharp: float = _SHARP
) -> FacePhases | None:
    """The phases of a motion that touches sharp edges, with those that the problem has;
    None if it touches none, or if there are no phases for it.

    ``touched``: in which intervals of the motion it is at the bound of which limits, (N, rows).
    ``sharp``: radius, m, up to which edges count as sharp.
    """
    limits = problem.limits
    divided, touches = limits.divided, np.repeat(touched, _SAMPLES, axis=0)
    of_bodies = touches[:, limits.constraints.convex]
    has_edges = np.array([len(faces) > 1 for faces in limits.faces], np.bool)
    rows = of_bodies.any(axis=0) & has_edges & (limits.edge_radii <= sharp)
    if not rows.any() and divided is None:
        return None
    times, x = _samples(motion)
    parts, held = list[list[_Part]](), np.zeros(len(rows), np.bool)
    for row in np.flatnonzero(rows).tolist():
        distances = distances_from_faces(problem, x, row)
        parts.append(_parts(limits, row, distances, of_bodies[:, row], sharp))
        held[row] = len(parts[-1]) > 1
    if divided is not None:
        at_wall = np.asarray(touches[:, divided.rows].any(axis=1))
        parts.append(_parts_by_regions(limits, divided, x, at_wall))
    parts = [own for own in parts if len(own) > 1]
    changes = [each for own in parts for each in own[1:]]
    if not changes or len(changes) >= _MOST_PHASES:
        return None
    passed = (boundary_instants(problem, motion)[1:-1] - motion.knots[0]) / motion.duration
    meet = [*zip(passed.tolist(), problem.gates, strict=True)]
    for each in changes:
        instant = float(times[each.begin])
        meet.append((instant, ANYWHERE if each.on_edge else _gate(motion, instant)))
    meet.sort(key=itemgetter(0))
    instants = np.array([instant for instant, _ in meet])
    begins = [0, *np.searchsorted(times, instants).tolist()]
    within = [0, *np.searchsorted(passed, instants, side="right").tolist()]  # of the problem's
    of_problem = limits.in_phases(len(passed) + 1)[within]
    numbers = [
        _numbers_at(limits, parts, begin, own)
        for begin, own in zip(begins, of_problem, strict=True)
    ]
    gates = tuple(gate for _, gate in meet)
    return FacePhases(_apart(instants), gates, np.array(numbers), held)


def _apart(instants: Array) -> Array:
    """Instants in order, (n,), moved as little as makes every phase long enough."""
    places = _SHORTEST * np.arange(1, len(instants) + 1)
    later = places + np.maximum.accumulate(np.maximum(instants - places, 0.0))
    return np.asarray(np.minimum(later, 1 - places[::-1]))


def prices(solution: Solved) -> Array:
    """Multipliers of all limits in each interval, (N, rows)."""
    return np.asarray(np.abs(solution.multipliers).sum(axis=1))


def touching(solution: Solved) -> Truths:
    """In which intervals the motion of a solution is at the bound of which limits, (N, rows)."""
    price = prices(solution)
    return np.asarray(price > _TOUCHES * np.maximum(price.sum(axis=0), _FREE))


def _parts(
    limits: SceneLimits, row: int, distances: Array, touches: Truths, sharp: float
) -> list[_Part]:
    """The parts of a motion by faces of the body of a row that it is clear of; one or none if it
    touches no edge. ``distances``: from its faces, (N, faces), m. ``touches``: at which samples it
    touches the body, (N,). ``sharp``: as of ``phases_over_edges``."""
    over = distances - limits.least_distances[row]
    faces = _fewest_changes(over)
    if faces is None:
        return []
    begins = [0, *(np.flatnonzero(np.diff(faces)) + 1).tolist()]
    on_edge = [
        k > 0
        and bool(touches[_around(k)].any())
        and bool(over[k, faces[k - 1 : k + 1]].min() < max(_INSIDE, _ROOM * sharp))
        for k in begins
    ]
    inside = touches.copy()
    for k in np.array(begins)[on_edge].tolist():
        inside[_around(k)] = False
    if not any(on_edge) or (np.sort(over[inside], axis=1)[:, -2] > -_INSIDE).any():
        return []
    order = faces[begins].tolist()
    firsts = [0, *np.flatnonzero(on_edge).tolist(), len(begins)]  # of runs from edge to edge
    found = list[_Part]()
    for first, end in pairwise(firsts):
        beyond = {*order[max(first - 1, 0) : first], *order[end : end + 1]}
        last = begins[end] if end < len(begins) else len(touches)
        opened = None
        if not (inside[begins[first] : last].any() or beyond & set(order[first:end])):
            opened = limits.opened(row, beyond)
        if opened is not None:
            found.append(_Part(begins[first], opened, on_edge[first]))
            continue
        found += [
            _Part(begins[k], limits.faces[row][order[k]], on_edge[k]) for k in range(first, end)
        ]
    return found


def _around(sample: int) -> slice:
    """The samples whose contacts count as those of an edge that is passed at one of them."""
    return slice(max(sample - _NEAR_END, 0), sample + _NEAR_END)


def _parts_by_regions(
    limits: SceneLimits, divided: Placed[DividedLimit], x: Array, touches: Truths
) -> list[_Part]:
    """The parts of a motion at places (N, 3), m, by the regions of a limit that it is in: from one
    to the next where it touches the edge between them. ``touches``: at which samples it is at the
    bound, (N,)."""
    limit, numbers = divided.limit, limits.numbers[divided.numbers]
    which = np.maximum.accumulate(limit.nearest(numbers, x))  # in order, though it may skip some
    changes = (np.flatnonzero(np.diff(which)) + 1).tolist()
    on_edge = [k for k in changes if touches[_around(k)].any()]
    found = list[_Part]()
    for begin, end in pairwise([0, *on_edge, len(x)]):
        own = limit.of_regions(numbers, which[begin], which[end - 1] + 1)
        found.append(_Part(begin, limits.with_part(divided.numbers, own), on_edge=True))
    return found


def _numbers_at(
    limits: SceneLimits, parts: list[list[_Part]], sample: int, numbers: Array
) -> Array:
    """The numbers of all limits in the phase that begins at a sample, from those of the problem's
    phase there, ``numbers``; ``parts``: of each body, and of a tube."""
    for each in parts:
        own = next(part for part in reversed(each) if part.begin <= sample).numbers
        numbers = np.where(own != limits.numbers, own, numbers)
    return numbers


def _samples(motion: Trajectory) -> tuple[Array, Array]:
    """Instants, fractions of the duration, (N · ``_SAMPLES``,), and places there, m."""
    knots = (motion.knots - motion.knots[0]) / motion.duration
    shares = np.arange(_SAMPLES) / _SAMPLES
    times = (knots[:-1, None] + np.diff(knots)[:, None] * shares).ravel()
    return times, motion.position.at(motion.knots[0] + motion.duration * times)


def _fewest_changes(over: Array) -> Index | None:
    """Which face a motion is clear of at each sample, (N,), with as few changes as possible, each
    where it is as far as possible from both faces. None where a face would follow its opposite one.

    ``over``: by how much the motion is farther from each face than it must be, (N, faces), m.
    """
    beyond = over < np.minimum(-_ROUNDING, over.max(axis=1, keepdims=True))
    order, ends, at = list[int](), list[int](), 0
    while at < len(over):
        left = beyond[at:]
        reach = np.where(left.any(axis=0), left.argmax(axis=0), len(left))
        order.append(int(reach.argmax()))
        at += int(reach.max())
        ends.append(at)
    faces, first = np.full(len(over), order[0]), 0
    for end, (one, other) in zip(ends, pairwise(order), strict=False):
        if np.ptp(over[:, [one, other]].sum(axis=1)) < _OPPOSITE:
            return None
        not_yet = np.flatnonzero(beyond[first:end, other])  # clear of the other one
        first += 1 + int(not_yet.max(initial=0))
        first += int(over[first : end + 1, [one, other]].min(axis=1).argmax())
        faces[first:] = other
    return faces


def _gate(motion: Trajectory, instant: float) -> Boundary:
    """What is given where phases meet away from edges: when they meet would be of no account, and a
    solver would not find it. It is when the coordinate that changes fastest is as it was."""
    x, v = motion.position.with_rate_at(motion.knots[:1] + motion.duration * instant)
    fastest = int(np.abs(v[0]).argmax())
    a, b, c = (float(x[0, i]) if i == fastest else None for i in range(3))
    return Boundary.passed((a, b, c))
