"""Boundaries: what is asked of the platform where a motion begins or ends, or two phases meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.errors import in_words
from deltaopt.files.validated_record import Vector3, vector3

REST = (0.0, 0.0, 0.0)
_FIXED = (False, False, False)


@dataclass(frozen=True)
class Boundary:
    """What is asked of the platform's state at a boundary of a phase.

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
    ) -> Boundary:
        """A place, passed at any velocity; its coordinates that are None are free."""
        x, y, z = (0.0 if each is None else each for each in place)
        free = (place[0] is None, place[1] is None, place[2] is None)
        return cls((x, y, z), free=free, is_passed=True, within=within)

    @property
    def moves(self) -> bool:
        """Whether the place itself moves."""
        return self.belt != REST

    @property
    def is_anywhere(self) -> bool:
        """Whether any place will do."""
        return all(self.free)

    @property
    def is_given(self) -> bool:
        """Whether the position is known before the motion is."""
        return not (self.moves or any(self.free))

    @property
    def description(self) -> str:
        """In words: a point in m, and how it moves or is passed unless the platform rests there."""
        point = f"{in_words(self.position)} m"
        if self.moves:
            return f"{point} on a belt of {in_words(self.belt)} m/s"
        if self.is_anywhere:
            return "rest, anywhere"
        return point if self.is_at_rest else f"{point} at {in_words(self.velocity)} m/s"

    @property
    def is_at_rest(self) -> bool:
        """Whether the platform neither moves nor begins to."""
        return self.velocity == self.acceleration == REST

    @property
    def is_rest_at_a_point(self) -> bool:
        """Whether the platform rests there, at a place that is known."""
        return self.is_given and self.is_at_rest and not (self.is_passed or self.within)

    def at(self, duration: float, reached: Vector3) -> Boundary:
        """What is asked of a motion that takes ``duration`` (s) and ends at ``reached`` (m)."""
        if self.is_anywhere:
            return Boundary(reached, self.velocity)  # at rest
        if not self.moves:
            return self
        there = np.add(self.position, np.multiply(duration, self.belt))
        return Boundary(vector3(there), self.velocity)


ANYWHERE = Boundary.passed((None, None, None))
"""Any place, passed at any velocity: phases meet there that differ in their limits alone."""
