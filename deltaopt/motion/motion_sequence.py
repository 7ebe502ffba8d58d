"""Motions one after the other, as those of a cycle: legs and the dwells between them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Motion, Trajectory
from deltaopt.problem.boundary import REST
from deltaopt.robot.machine import Model

_COLUMNS = tuple(each.name for each in fields(Motion) if each.name not in ("t", "under_way"))


@dataclass(frozen=True)
class MotionSequence:
    """Motions one after the other from the time 0 on, each with its own payload; call it with
    instants to get a `Motion`. ``parts``: one at least."""

    parts: tuple[Trajectory, ...]

    @cached_property
    def begins(self) -> Array:
        """When each part begins, and when the last one ends, (parts + 1,), s."""
        return np.concatenate([[0.0], np.cumsum([part.duration for part in self.parts])])

    @property
    def duration(self) -> float:
        """Of all of it, s."""
        return float(self.begins[-1])

    @cached_property
    def knots(self) -> Array:
        """Instants where polynomials meet, (K + 1,), s; torques may jump there."""
        inner = [
            begin + part.knots[:-1] - part.knots[0]
            for begin, part in zip(self.begins, self.parts, strict=False)
        ]
        return np.append(np.concatenate(inner), self.duration)

    def __call__(self, t: ArrayLike) -> Motion:
        """The motion at times t, (N,), s, from 0 to its duration, or at one, a number, in arrays of
        shape (3,). Where two parts meet it is that just after."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        parts_begun = np.searchsorted(self.begins, times, side="right")
        which = np.clip(parts_begun - 1, 0, len(self.parts) - 1)
        found = Motion(times, *np.zeros((len(_COLUMNS), len(times), 3)))
        for index, part in enumerate(self.parts):
            own = which == index
            if own.any():
                motion = part(part.knots[0] + times[own] - self.begins[index])
                for name in _COLUMNS:
                    getattr(found, name)[own] = getattr(motion, name)
        return found if np.ndim(t) else found.first


def waiting(model: Model, at: Vector3, velocity: Vector3, duration: float) -> Trajectory:
    """A wait of ``duration`` (s) at a point in m, which moves on at a ``velocity`` (m/s) as a belt
    does, with the payload of a model."""
    coefficients = np.array([[at, velocity, REST, REST]])  # exactly so, however short
    position = PiecewisePolynomial(np.array([0.0, duration]), coefficients)
    return Trajectory(position, model, end_velocities=(velocity, velocity))
