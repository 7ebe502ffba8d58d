"""First motions where an end moves: from a state, to a state, to a belt, or to rest anywhere.

A motion whose end moves cannot be slowed, so that its duration is chosen at once: of quintics
between both ends the shortest that keeps the limits at samples, or else the one that exceeds them
least.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np

from deltaopt.errors import DeltaOptError
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.time_scaling import sizes_at
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import REST, EndState, MovingEnds, RestAnywhere

_COARSE = np.array([2.0**k for k in range(-12, 5)])
"""Durations that are looked at first, s: from motions of a millimetre to those of giants."""
_FINE = np.array([2.0 ** (k / 6) for k in range(-6, 7)])
"""Durations that are looked at then, in units of the best of the first."""
_SAMPLES = np.linspace(0.0, 1.0, 9)
"""Fractions of a quintic at which its limits are looked at: it is only a guess."""
_NEARLY = 1.2
"""Excess over its limits with which a guess is good enough: the optimum bends away from it."""

States = Callable[[float], tuple[EndState, EndState]]
"""Duration (s) -> the states that a motion of that duration begins and ends in."""
Family = Callable[[Array], tuple[Array, Array]]
"""Durations (n,), s -> for each a motion in as many pieces: coefficients of ascending powers of the
time since a piece began, (n, pieces, powers, 3), m, and their lengths, (n, pieces), s."""


def first_moving_motions(
    scene: Scene, under_way: PiecewisePolynomial | None
) -> Iterator[Trajectory]:
    """First guesses, the best first: a quintic; the motion under way to its end and on from there
    to the goal, where one is under way; a stop, and on from there.

    ``under_way``: what would follow the start, from the time 0 on, m over s.
    """
    task = scene.task
    assert isinstance(task, MovingEnds)
    direct = from_state_to_state(scene)
    if direct is not None:
        yield direct
    if under_way is not None:
        yield from _onwards(scene, under_way)
    stop = _quintic(scene, lambda T: (task.start, EndState(_stopped(task.start, T))))
    if stop is not None and task.start.velocity != REST:
        yield from _onwards(scene, stop.position)


def from_state_to_state(scene: Scene) -> Trajectory | None:
    """The shortest quintic that nearly keeps the limits at samples, or the one that exceeds them
    least; None if none stays within reach."""
    task = scene.task
    assert isinstance(task, MovingEnds)
    return _quintic(scene, lambda T: _ends(task.start, task, T))


def from_rest(scene: Scene, place: Vector3) -> Scene:
    """The scene from rest at a place (m) instead of its start."""
    return scene.model_copy(update={"start": place})


def end_of(position: PiecewisePolynomial) -> Vector3:
    """Where a motion ends, m."""
    x, y, z = position.at(position.knots[-1:])[0].tolist()
    return x, y, z


def _onwards(scene: Scene, before: PiecewisePolynomial) -> Iterator[Trajectory]:
    """A motion that comes to rest, and one from there to the scene's goal, if there is one."""
    if isinstance(scene.task.goal, RestAnywhere):
        yield Trajectory(before, delta_model(scene.robot, scene.payload))
        return
    with suppress(DeltaOptError):
        rest = from_rest(scene, end_of(before))
        later = (
            from_state_to_state(rest) if isinstance(rest.task, MovingEnds) else first_motion(rest)
        )
        if later is not None:
            yield Trajectory(before.then(later.position), later.model)


def _ends(start: EndState, task: MovingEnds, duration: float) -> tuple[EndState, EndState]:
    return start, task.goal.at(duration, _stopped(start, duration))


def _stopped(start: EndState, duration: float) -> Vector3:
    """Where a state gets to that comes to rest in a duration (s), its acceleration symmetric in
    time, m."""
    x, y, z = (np.array(start.position) + np.array(start.velocity) * duration / 2).tolist()
    return x, y, z


def _quintic(scene: Scene, states: States) -> Trajectory | None:
    """The shortest quintic between states that nearly keeps the limits at samples, or the one that
    exceeds them least; None if none stays within reach."""
    return shortest_of(scene, lambda T: (_coefficients(states, T)[:, None], T[:, None]))


def shortest_of(scene: Scene, family: Family) -> Trajectory | None:
    """The shortest motion of a family that nearly keeps the limits at samples, or the one that
    exceeds them least; None if none stays within reach."""
    best = _best(scene, family, _COARSE)
    best = None if best is None else _best(scene, family, best * _FINE)
    if best is None:
        return None
    coefficients, lengths = family(np.array([best]))
    knots = np.append(0.0, np.cumsum(lengths[0]))
    position = PiecewisePolynomial(knots, coefficients[0])
    return Trajectory(position, delta_model(scene.robot, scene.payload))


def _best(scene: Scene, family: Family, durations: Array) -> float | None:
    """The best of some durations (s), increasing."""
    coefficients, lengths = family(durations)
    pieces = coefficients.reshape(-1, *coefficients.shape[2:])
    sizes = sizes_at(scene, pieces, lengths.ravel(), _SAMPLES)
    highest = sizes.reshape(len(durations), -1).max(axis=1)
    if not np.isfinite(highest).any():
        return None
    keeping = np.flatnonzero(highest <= _NEARLY)
    return float(durations[keeping[0] if len(keeping) else np.nanargmin(highest)])


def _coefficients(states: States, durations: Array) -> Array:
    """Of the quintics between states, without acceleration at both ends, (n, 6, 3)."""
    both = [states(T) for T in durations.tolist()]
    x0, x1 = (np.array([pair[i].position for pair in both]) for i in (0, 1))
    v0, v1 = (np.array([pair[i].velocity for pair in both]) for i in (0, 1))
    T = durations[:, None]
    way, gain = x1 - x0 - T * v0, T * (v1 - v0)
    zero = np.zeros_like(x0)
    cube, fourth, fifth = 10 * way - 4 * gain, -15 * way + 7 * gain, 6 * way - 3 * gain
    return np.stack([x0, v0, zero, cube / T**3, fourth / T**4, fifth / T**5], axis=1)
