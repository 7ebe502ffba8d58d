"""Boundaries: what is asked of the platform where a motion begins or ends, or two phases meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from deltaopt.files.validated_record import Vector3, vector3

REST = (0.0, 0.0, 0.0)
_FIXED = (False, False, False)


@dataclass(frozen=True)
class Boundary:
    """What is known of the platform's state at a boundary of a phase.

    ``position``: m, at the time 0 of the motion where it moves; of no account in coordinates that
    are ``free``. ``velocity``: m/s; of no account where the boundary ``is_passed`` at any.
    ``acceleration``: m/s², asked for where acceleration is continuous. ``belt``: the velocity at
    which the position itself moves, m/s. ``within``: the position is any
    place at most so far, m, from the one that is given.
    """

    position: Vector3
    velocity: Vector3 = REST
    acceleration: Vector3 = REST
    belt: Vector3 = REST
    free: tuple[bool, bool, bool] = _FIXED
    is_passed: bool = False
    within: float = 0.0

    @classmethod
    def passed(
        cls, place: tuple[float | None, float | None, float | None], within: float = 0.0
    ) -> Self:
        """A place, passed at any velocity; its coordinates that are None are free."""
        x, y, z = (0.0 if each is None else each for each in place)
        free = (place[0] is None, place[1] is None, place[2] is None)
        return cls((x, y, z), free=free, is_passed=True, within=within)

    @property
    def moves(self) -> bool:
        """Whether the place itself moves."""
        return self.belt != REST

    @property
    def is_rest_at_a_point(self) -> bool:
        """Whether the platform rests there, at a place that is known."""
        known = not (any(self.free) or self.is_passed or self.within)
        rests = self.velocity == REST and self.acceleration == REST
        return known and rests and not self.moves

    def at(self, duration: float, reached: Vector3) -> Boundary:
        """What is asked of a motion that takes ``duration`` (s) and ends at ``reached`` (m)."""
        if all(self.free):
            return Boundary(reached, self.velocity)  # at rest
        if not self.moves:
            return self
        there = np.add(self.position, np.multiply(duration, self.belt))
        return Boundary(vector3(there), self.velocity)
