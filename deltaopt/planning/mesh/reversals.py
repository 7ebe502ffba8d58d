"""Meshes for motions whose arms turn back under Coulomb friction, and softer friction at first.

Friction c · tanh (θ̇ / w) changes its sign while an arm's speed goes from -w to w, at a reversal:
within a thousandth of a motion as a rule. So do the torques that a motion may use, and if no points
of the mesh lie there, polynomials exceed the limits between points, by up to 2 c, and the motion
would have to be slowed for that. So knots are put at reversals.

Where reversals are is known from the mesh before alone, and roughly at first. On a mesh whose
intervals are longer than a reversal takes, there is a local optimum for every place that a reversal
has among the points: the solver comes to rest in one that is not the best, or hardly converges. So
friction is softer on the first meshes: it changes its sign over a wider range of speeds, which the
mesh resolves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

Array = NDArray[np.float64]

_SOFTEST, _SOFT_MESHES = 1 / 8, 2
"""The speed w of the friction of the first mesh, as a share of the largest speed of an arm: a speed
changes by as much in an interval of a first mesh. And how many meshes have softer friction than the
scene, w falling by the same factor from each to the next. One more takes time for itself; with one
less, a plan in ten takes several times as long."""
_LAYER = np.array([-2.5, -1.0, 1.0, 2.5])
"""Where knots are put at a reversal: speeds of the arm in units of w. Friction is constant to 1 %
beyond the outer ones. More knots save time of the motion, and cost time of the solver."""
_APART = 0.4
"""Least distance of such a knot from others, in the time that a speed takes to change by w: knots
of arms that turn back together would make useless short intervals."""
_SHORTEST = 1e-4
"""Least distance from others as a fraction of the duration, as that of other intervals."""
_LONGEST = 0.1
"""Duration of a change by w, as a fraction of that of the motion, from which on an ordinary mesh
resolves a reversal."""
_SAMPLES = np.linspace(0.0, 1.0, 5)
"""Fractions of intervals where speeds of arms are evaluated: they are nearly straight between."""
_AT_REST = 1e-6
"""Share of the largest speed of an arm below which it is at rest, but for rounding."""


def softer_problems(problem: Problem, motion: Trajectory) -> tuple[Problem, ...]:
    """A problem with softer Coulomb friction, the softest first, for the first meshes.

    ``motion``: a first guess, whose speeds say what is soft. None without Coulomb friction, or
    where it is that soft already.
    """
    friction = problem.model.robot.drive.friction
    if friction is None or not friction.coulomb or friction.speed is None:
        return ()
    _, speeds, _ = motion.coordinates_inside(_SAMPLES)
    softest = _SOFTEST * float(np.abs(speeds[:, motion.model.functions.motors]).max())
    if softest <= friction.speed:
        return ()
    shares = np.arange(_SOFT_MESHES) / _SOFT_MESHES
    softer = softest * (friction.speed / softest) ** shares
    return tuple(_with_friction_speed(problem, speed) for speed in softer.tolist())


def _with_friction_speed(problem: Problem, speed: float) -> Problem:
    drive = problem.model.robot.drive
    assert drive.friction is not None
    friction = drive.friction.model_copy(update={"speed": speed})
    drive = drive.model_copy(update={"friction": friction})
    return problem.of(problem.model.robot.model_copy(update={"drive": drive}))


def with_reversals(mesh: Array, motion: Trajectory, problem: Problem) -> Array:
    """A mesh, (N,), with knots where arms turn back in a motion of a scene, and at both ends.

    The motion is of the mesh before. It is the same mesh without a load of the arms that changes
    its sign within a moment, as Coulomb friction does.
    """
    speeds = problem.model.layers
    if not speeds:
        return mesh
    places, rates = _reversals(motion)
    widths = min(speeds) / np.maximum(rates, min(speeds) / _LONGEST)
    knots = np.append(np.append(0.0, np.cumsum(mesh)[:-1]), 1.0)
    for i in np.argsort(widths):  # the quickest first: others find knots there
        if widths[i] >= _LONGEST:
            break
        wanted = places[i] + widths[i] * _LAYER
        distances = np.abs(knots[:, None] - wanted).min(axis=0)
        inside = (wanted > 0) & (wanted < 1)
        knots = np.append(knots, wanted[inside & (distances > max(_APART * widths[i], _SHORTEST))])
    return np.diff(np.sort(knots))


def _reversals(motion: Trajectory) -> tuple[Array, Array]:
    """Where arms are at rest, as fractions of the duration, and by how much their speeds would
    change there within the duration, rad/s, (n,) each: reversals, and for each arm both ends."""
    _, speeds, accelerations = motion.coordinates_inside(_SAMPLES)
    N, motors = len(motion.knots) - 1, motion.model.functions.motors
    speed = speeds[:, motors].reshape(N, len(_SAMPLES), 3)
    speed = np.where(np.abs(speed) < _AT_REST * np.abs(speed).max(), 0.0, speed)
    before, after = speed[:, :-1], speed[:, 1:]
    turning = before * after < 0
    interval, sample, _ = np.nonzero(turning)
    before, after = before[turning], after[turning]
    begin, length = motion.knots[:-1] - motion.knots[0], np.diff(motion.knots)
    steps = _SAMPLES[1] * length[interval]
    at = begin[interval] + steps * (sample + before / (before - after))
    rates = np.abs(after - before) / steps
    ends = np.abs(accelerations[[0, -1], motors]).ravel()
    places = np.concatenate([at / motion.duration, np.repeat([0.0, 1.0], 3)])
    return places, np.concatenate([rates, ends]) * motion.duration
