"""First motions beside the usual ones: for a second opinion, other ways and random curves."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice, pairwise

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.trajectory import Trajectory, passes
from deltaopt.planning.first_motions.around_bodies import clear_motions
from deltaopt.planning.first_motions.initial_motion import roughly_fastest
from deltaopt.planning.first_motions.multistart import first_motions
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene

_SPREAD = 0.3
"""Standard deviation of the bends of a phase, as a share of its way; in a tube, of its radius."""
_KNOTS = 24
"""Of each bent phase: its polynomials are of a higher order than motions are."""


def other_motions(
    scene: Scene, known: Trajectory | None, number: int, seed: int
) -> Iterator[Trajectory]:
    """First motions other than the usual first one, at most about ``number`` of them.

    From rest to rest they are distinct ways and random curves, past bodies on all their sides. In
    phases, in a tube and where an end moves they are a motion that is ``known``, bent at random:
    none where none is.
    """
    task = scene.task
    if not task.is_at_rest or task.gates or scene.tube is not None:
        return islice(_bent(scene, known, seed), number) if known else iter(())
    motions = first_motions(scene, number + 1, seed)
    if limits_of(scene).constraints.has_convex:
        return clear_motions(scene, motions, number)
    return islice(motions, 1, None)


def _bent(scene: Scene, known: Trajectory, seed: int) -> Iterator[Trajectory]:
    """A motion whose phases are bent at random: it passes the same points as fast, at the same
    times where an end moves."""
    rng, problem = np.random.default_rng(seed), problem_of(scene)
    begin, end = known.knots[[0, -1]].tolist()
    phases = list(pairwise([begin, *passes(problem, known).tolist(), end]))
    u = np.linspace(0.0, 1.0, _KNOTS + 1)
    bump, slope = 64 * (u - u**2) ** 3, 192 * (u - u**2) ** 2 * (1 - 2 * u)
    knots = np.concatenate([t0 + u[i > 0 :] * (t1 - t0) for i, (t0, t1) in enumerate(phases)])
    while True:
        x, v = (each.copy() for each in known.position.with_rate_at(knots))
        for i, (t0, t1) in enumerate(phases):
            own = slice(i * _KNOTS, (i + 1) * _KNOTS + 1)
            size = _SPREAD * (scene.tube or float(np.linalg.norm(x[own][-1] - x[own][0])))
            one, other = size * rng.standard_normal((2, 3))
            x[own] += bump[:, None] * _between(one, other, u)
            bent = slope[:, None] * _between(one, other, u) + bump[:, None] * (other - one)
            v[own] += bent / (t1 - t0)
        bent_motion = Trajectory(PiecewisePolynomial.hermite(knots, x, v), known.model)
        if not problem.is_at_rest:
            yield bent_motion
            continue
        driven = if_possible(RULED_OUT, roughly_fastest, scene, bent_motion)
        if driven is not None:
            yield driven


def _between(one: Array, other: Array, u: Array) -> Array:
    return np.asarray(one + u[:, None] * (other - one))
