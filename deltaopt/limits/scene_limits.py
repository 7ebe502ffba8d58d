"""The limits of one scene, with their numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, Generic, TypeVar

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import ConvexLimit, Described, DividedLimit, Limit, Numbers, PhasedLimit
from deltaopt.limits.running_cost import Running

_L = TypeVar("_L", bound=Limit)


@dataclass(frozen=True)
class Placed(Generic[_L]):
    """A limit of a scene, and where its ``numbers`` and ``rows`` are."""

    limit: _L
    numbers: slice
    rows: slice


@dataclass(frozen=True)
class SceneLimits:
    """The limits of one scene: which there are, and their numbers, (constraints.parameters,)."""

    constraints: Constraints
    numbers: Array

    @classmethod
    def of(cls, limits: Sequence[Limit], scene: Described) -> SceneLimits:
        """Those of these limits that exist in a scene."""
        found: list[tuple[Limit, Numbers]] = [
            (limit, numbers) for limit in limits for numbers in limit.items(scene)
        ]
        items = tuple((limit, len(numbers)) for limit, numbers in found)
        values = np.array([value for _, numbers in found for value in numbers], dtype=float)
        return cls(_shared(Constraints(items)), values)

    def only(self, kept: Sequence[int]) -> SceneLimits:
        """Some of the items, by their indices, in their order; itself if these are all."""
        if len(kept) == len(self.constraints.items):
            return self
        items = tuple(self.constraints.items[i] for i in kept)
        numbers = [self.of_items[i] for i in kept]
        constraints = replace(self.constraints, items=items)
        return SceneLimits(_shared(constraints), np.concatenate(numbers))

    def with_cost(self, cost: Running) -> SceneLimits:
        """These for a motion with such a running cost."""
        return SceneLimits(_shared(replace(self.constraints, cost=cost)), self.numbers)

    def up_to(self, order: int) -> SceneLimits:
        """Those of an order at most."""
        limits = self.constraints.limits
        return self.only([i for i, limit in enumerate(limits) if limit.order <= order])

    @property
    def of_items(self) -> list[Array]:
        """The numbers of each item."""
        return [self.numbers[own] for own in self.constraints.places]

    @property
    def _placed(self) -> Iterator[Placed[Any]]:
        """The limit of each item, and where its numbers and its rows are."""
        of = self.constraints
        return map(Placed, of.limits, of.places, of.slices)

    @cached_property
    def phased(self) -> Placed[PhasedLimit] | None:
        """The limit whose numbers differ from phase to phase of the motion, if there is one."""
        return self._first(PhasedLimit)

    def in_phases(self, number: int) -> Array:
        """All numbers in each phase of a motion of so many, (phases, numbers)."""
        found = np.tile(self.numbers, (number, 1))
        if self.phased is not None:
            own = self.phased.numbers
            found[:, own] = self.phased.limit.numbers_in_phases(self.numbers[own])
        return found

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of every measure in its unit, infinite where there is none."""
        return _bounds(self.constraints, tuple(self.numbers.tolist()))[:2]

    @cached_property
    def scales(self) -> Array:
        """The natural size of every measure in its unit."""
        return _bounds(self.constraints, tuple(self.numbers.tolist()))[2]

    @cached_property
    def least_distances(self) -> Array:
        """Of the rows of ``Constraints.convex`` the least distances, m; -inf of those of no
        body."""
        return self.bounds[0][self.constraints.convex]

    @cached_property
    def edge_radii(self) -> Array:
        """Of the rows of ``Constraints.convex`` the radii of the edges of their bounds, m."""
        return np.array([one.edge_radius(self.numbers[part]) for one, part in self._convex_rows])

    @cached_property
    def faces(self) -> tuple[tuple[Array, ...], ...]:
        """Of each row of ``Constraints.convex`` all numbers, with those of its body replaced by
        those of one of its faces, for every face, as of ``ConvexLimit.faces``."""
        return tuple(
            tuple(self.with_part(part, face) for face in limit.faces(self.numbers[part]))
            for limit, part in self._convex_rows
        )

    def opened(self, row: int, faces: Collection[int]) -> Array | None:
        """All numbers with those of the body of one of these rows replaced as of
        ``ConvexLimit.opened``."""
        limit, part = self._convex_rows[row]
        found = limit.opened(self.numbers[part], faces)
        return None if found is None else self.with_part(part, found)

    def part_of(self, row: int) -> slice:
        """Where the numbers of the body of one of these rows are."""
        return self._convex_rows[row][-1]

    @cached_property
    def _convex_rows(self) -> list[tuple[ConvexLimit, slice]]:
        """Of each of these rows its limit and the place of the numbers of its body."""
        found = list[tuple[ConvexLimit, slice]]()
        for each in self._placed:
            if isinstance(each.limit, ConvexLimit):
                own, rows = each.numbers, each.rows
                size = (own.stop - own.start) // (rows.stop - rows.start)
                parts = pairwise(range(own.start, own.stop + 1, size))
                found += [(each.limit, slice(*part)) for part in parts]
        return found

    def with_part(self, place: slice, part: Array) -> Array:
        """All numbers, some of them replaced."""
        numbers = self.numbers.copy()
        numbers[place] = part
        return numbers

    @cached_property
    def divided(self) -> Placed[DividedLimit] | None:
        """The limit that permits several regions, if there is one."""
        found = self._first(DividedLimit)
        has_several = found and found.limit.regions(self.numbers[found.numbers]) > 1
        return found if has_several else None

    def _first(self, kind: type[_L]) -> Placed[_L] | None:
        """The first limit of a kind, if there is one."""
        return next((each for each in self._placed if isinstance(each.limit, kind)), None)

    @cached_property
    def bound_exponents(self) -> Array:
        """n of every row that is f(motion) / boundⁿ near the bound, (rows,): 1 for a torque, 2 for
        the square of a norm. NaN for other rows, such as those of ranges."""
        function, rng = self.constraints.bound_exponents, np.random.default_rng(1)
        motions = rng.uniform(0.5, 1.5, (2, function.size1_in(0)))
        one, other = (np.array(function(motion, self.numbers)).ravel() for motion in motions)
        known = np.isfinite(one) & np.isclose(one, other, rtol=1e-9, atol=0)
        return np.where(known, one, np.nan)

    def upper(self, name: str) -> Array | None:
        """The upper bounds of a limit, by its name; None where it does not exist."""
        found = (each.rows for each in self._placed if each.limit.name == name)
        return next((self.bounds[1][rows] for rows in found), None)


@lru_cache(maxsize=64)
def _bounds(constraints: Constraints, numbers: Numbers) -> tuple[Array, Array, Array]:
    """``SceneLimits.bounds`` and ``scales``, found once for all moves of a robot: a few per cent
    of a plan."""
    found = [np.array(side).ravel() for side in constraints.bounds_of_rows(np.array(numbers))]
    for side in found:
        side.setflags(write=False)
    return found[0], found[1], found[2]


_KNOWN: dict[Constraints, Constraints] = {}


def _shared(constraints: Constraints) -> Constraints:
    """One object for all that are equal, so that what is derived from it is derived once.

    Raises ValueError for a limit that says another order than that of its rows.
    """
    if constraints not in _KNOWN:
        constraints.require_orders()
        _KNOWN[constraints] = constraints
    return _KNOWN[constraints]
