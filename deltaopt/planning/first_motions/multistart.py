"""Multistart: several first guesses, because a minimum is local and another may be better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice, pairwise
from math import dist

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.planning.first_motions.around_bodies import clear_motions
from deltaopt.planning.first_motions.initial_motion import roughly_fastest
from deltaopt.planning.first_motions.order_of_merit import first_motion, in_order_of_merit
from deltaopt.planning.plan import Optimum
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene

_SPREAD = 0.3
"""Standard deviation of the bends of a phase, as a share of its way; in a tube, of its radius. A
larger one explores more of the workspace, but more curves leave it."""
_KNOTS = 24
"""Of each bent phase: its polynomials are of a higher order than motions are."""
_TRIES = 50
"""Random curves drawn for each guess that is wanted, before the search for drivable ones ends."""
_SAME_PATH = 1e-2
"""Two motions are the same local minimum if their positions at half time are closer than this share
of the distance from start to goal: more than planning to a tolerance moves them."""


def first_motions(scene: Scene, number: int, seed: int) -> Iterator[Trajectory]:
    """First guesses from rest to rest: distinct ways in order of merit, then the first of them bent
    at random, as fast as the limits allow.

    They are fewer than ``number`` if hardly any random curve stays in the workspace. Raises
    Unreachable if there is no way.
    """
    random = (
        each for motion in [first_motion(scene)] for each in _bent(scene, motion, seed, number)
    )
    return islice(chain(in_order_of_merit(scene), random), number)


def other_motions(
    scene: Scene, known: Trajectory | None, number: int, seed: int
) -> Iterator[Trajectory]:
    """First motions other than the usual first one, at most ``number`` of them.

    From rest to rest they are distinct ways and random curves, past bodies on all their sides. In
    phases, in a tube and where an end moves they are a motion that is ``known``, bent at random:
    none where none is.
    """
    task = scene.task
    if not task.is_at_rest or task.gates or scene.tube is not None:
        return islice(_bent(scene, known, seed, number), number) if known else iter(())
    motions = first_motions(scene, number + 1, seed)
    if limits_of(scene).constraints.has_convex:
        return clear_motions(scene, motions, number)
    return islice(motions, 1, None)


def _bent(scene: Scene, known: Trajectory, seed: int, number: int) -> Iterator[Trajectory]:
    """A motion whose phases are bent at random, for so many guesses: it passes the same points as
    fast, at the same times where an end moves."""
    rng, problem = np.random.default_rng(seed), problem_of(scene)
    phases = list(pairwise(boundary_instants(problem, known).tolist()))
    u = np.linspace(0.0, 1.0, _KNOTS + 1)
    bump, slope = 64 * (u - u**2) ** 3, 192 * (u - u**2) ** 2 * (1 - 2 * u)
    knots = np.concatenate([t0 + u[i > 0 :] * (t1 - t0) for i, (t0, t1) in enumerate(phases)])
    for _ in range(_TRIES * number):
        x, v = (each.copy() for each in known.position.with_rate_at(knots))
        for i, (t0, t1) in enumerate(phases):
            own = slice(i * _KNOTS, (i + 1) * _KNOTS + 1)
            size = _SPREAD * (scene.tube or dist(x[own][0], x[own][-1]))
            one, other = size * rng.standard_normal((2, 3))
            between = one + u[:, None] * (other - one)
            x[own] += bump[:, None] * between
            v[own] += (slope[:, None] * between + bump[:, None] * (other - one)) / (t1 - t0)
        bent = Trajectory(PiecewisePolynomial.hermite(knots, x, v), known.model)
        if not problem.is_at_rest:
            yield bent
        elif driven := if_possible(RULED_OUT, roughly_fastest, scene, bent):
            yield driven


def distinct(found: Sequence[tuple[Trajectory, float, float]], length: float) -> list[Optimum]:
    """The distinct local minima among motions with their costs and gaps, best first.

    Two motions are the same if their costs differ by no more than the sum of their gaps and
    their positions at half time by no more than ``_SAME_PATH`` times ``length``, the distance from
    start to goal in m.
    """
    optima: list[Optimum] = []
    for motion, cost, gap in sorted(found, key=lambda each: each[1]):
        halfway = motion([motion.knots[0] + motion.duration / 2]).x[0]
        new = Optimum(motion.duration, cost, tuple(halfway.tolist()), gap, 1)
        known = next((i for i, old in enumerate(optima) if _same(old, new, length)), None)
        if known is None:
            optima.append(new)
        else:
            old = optima[known]
            optima[known] = replace(old, starts=old.starts + 1)
    return optima


def _same(one: Optimum, other: Optimum, length: float) -> bool:
    apart = dist(one.halfway, other.halfway)
    difference = abs(one.cost / other.cost - 1)
    return difference <= one.gap + other.gap and apart <= _SAME_PATH * length
