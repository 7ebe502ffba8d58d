"""All limits of a scene together, as normalised constraint rows, and what follows from them.

Nothing here knows which limits there are. Rows are in the order of the limits; every array with a
last axis of rows is in that order, everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.limits.limit import SX, Bounds, ConvexLimit, Instant, Limit
from deltaopt.limits.running_cost import Running
from deltaopt.mechanisms.instant import AnyInstant

Kind = TypeVar("Kind", bound=np.generic)

MIXED = -1
"""Stands for the exponent of a row that mixes several powers of the speed, or is no power at all:
τ + μ θ̇, ‖ẍ - g‖², a torque with friction."""


@dataclass(frozen=True)
class Alike:
    """The rows of an item that are one function of the position and of numbers of their own each.

    ``rows``: which they are. ``numbers``: where those of all are, one row's after the other's.
    ``own``: symbols for those of one row, of which, and of the position, ``row`` and ``measure``
    are the one function.
    """

    rows: range
    numbers: slice
    own: SX
    row: SX
    measure: SX


def _of_limits(of: Callable[[Limit], object], kind: type[Kind]) -> cached_property[NDArray[Kind]]:
    """A property: what each limit says, repeated for its rows, (rows,)."""

    def found(constraints: Constraints) -> NDArray[Kind]:
        return constraints.of_rows([of(limit) for limit in constraints.limits], kind)

    return cached_property(found)


def _exponent(limit: Limit) -> int:
    if limit.order == 0:
        return 0
    powers = limit.powers or ()
    return powers[0] if len(powers) == 1 else MIXED


@dataclass(frozen=True)
class Constraints:
    """The limits of a scene without their numbers: each item's limit, and how many numbers it has.

    Hashable: scenes that differ in numbers only share what is derived and compiled. ``cost``: what
    the motion is to have a rate of, beside what limits ask for.
    """

    items: tuple[tuple[Limit, int], ...]
    motors: int = 3
    cost: Running = Running.EFFORT

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Computed once: caches look constraints up often."""
        return hash((self.items, self.motors, self.cost))

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limit of each item, in the order of the rows."""
        return tuple(limit for limit, _ in self.items)

    @property
    def parameters(self) -> int:
        """How many numbers they need."""
        return sum(size for _, size in self.items)

    def numbers(self) -> SX:
        """Symbols for the numbers of all items."""
        return SX.sym("limits", self.parameters)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        """All rows at an instant, normalised: lower bounds at -1, upper bounds at 1; (rows,)."""
        return ca.vertcat(*(limit.rows(motion, own) for limit, own in self.with_numbers(numbers)))

    def measures(self, motion: Instant, numbers: SX) -> SX:
        """What people read, item by item, each in its unit."""
        parts = self.with_numbers(numbers)
        return ca.vertcat(*(limit.measure(motion, own) for limit, own in parts))

    def with_numbers(self, numbers: SX) -> Iterator[tuple[Limit, SX]]:
        """Every item's limit, and its own of these numbers."""
        return zip(self.limits, [numbers[own] for own in self.places], strict=True)

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Where the numbers of each item are."""
        ends = np.cumsum([0, *(size for _, size in self.items)])
        return tuple(starmap(slice, pairwise(ends.tolist())))

    def item_of(self, row: int) -> tuple[int, int]:
        """The item that a row belongs to, and which of its rows it is."""
        item = next(i for i, rows in enumerate(self.slices) if row < rows.stop)
        return item, row - self.slices[item].start

    def label(self, row: int) -> str:
        """A row in words: "torque of motor 2"."""
        return " of ".join(self.named(row))

    def named(self, row: int) -> tuple[str, str]:
        """The limit and the subject of a row: ("torque", "motor 2")."""
        item, own = self.item_of(row)
        limit, rows = self.limits[item], self.slices[item]
        return limit.name, limit.subjects(rows.stop - rows.start)[own]

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where the rows of each item are."""
        any_motion, parts = AnyInstant(self.motors), self.with_numbers(self.numbers())
        ends = np.cumsum([0, *(limit.rows(any_motion, own).numel() for limit, own in parts)])
        return tuple(starmap(slice, pairwise(ends.tolist())))

    @property
    def number(self) -> int:
        """How many rows there are."""
        return self.slices[-1].stop if self.slices else 0

    orders = _of_limits(lambda limit: limit.order, np.intp)
    """The order of each row, (rows,)."""

    @cached_property
    def order(self) -> int:
        """2, where acceleration may jump; 3 where its rate is limited, or costs, so that it does
        not."""
        return max(self.cost.order, int(self.orders.max(initial=2)))

    def require_orders(self) -> None:
        """Raise ValueError for a limit whose order is not that of what its rows depend on."""
        motion = AnyInstant(self.motors)
        for limit, own in self.with_numbers(self.numbers()):
            order = motion.order_of(limit.rows(motion, own))
            if limit.order != order:
                raise ValueError(
                    f"the limit {limit.name} says order {limit.order}; by what its rows depend on "
                    f"it is {order} (0: position, 1: velocity, 2: acceleration or torque, 3: their "
                    "rates)"
                )

    @cached_property
    def sides(self) -> Truths:
        """Whether a row has a lower and an upper bound, (rows, 2)."""
        given = [(b.lower is not None, b.upper is not None) for b in self._bounds]
        return self.of_rows(given, np.bool).reshape(-1, 2)

    def size(self, rows: Array, which: Sequence[int] | slice = slice(None)) -> Array:
        """How near rows, (…, rows), are to the nearer of their bounds: 1 at a bound. ``which``: the
        indices of these rows."""
        lower, upper = self.sides[which].T
        return np.maximum(np.where(upper, rows, -np.inf), np.where(lower, -rows, -np.inf))

    @cached_property
    def closed_sides(self) -> Truths:
        """Whether a row has a lower and an upper bound, or one that is out of reach, (rows, 2)."""
        closed = self.of_rows([b.out_of_reach for b in self._bounds], np.bool)
        return np.asarray(self.sides | closed[:, None])

    @property
    def _bounds(self) -> list[Bounds]:
        return [limit.bounds(own) for limit, own in self.with_numbers(self.numbers())]

    @cached_property
    def bounds_of_rows(self) -> ca.Function:
        """Numbers of all items -> lower and upper bound and natural size of every row's measure."""
        numbers, found = self.numbers(), (list[SX](), list[SX](), list[SX]())
        for (limit, own), rows in zip(self.with_numbers(numbers), self.slices, strict=True):
            bounds, ones = limit.bounds(own), SX.ones(rows.stop - rows.start)
            lower = -np.inf if bounds.lower is None else bounds.lower
            upper = np.inf if bounds.upper is None else bounds.upper
            for each, side in zip(found, (lower, upper, bounds.scale), strict=True):
                each.append(side * ones)
        return ca.Function("bounds", [numbers], [ca.vertcat(*each) for each in found])

    def of_rows(self, of_items: Sequence[object], kind: type) -> NDArray[Any]:
        """A value of each item, repeated for its rows."""
        counts = [s.stop - s.start for s in self.slices]
        return np.repeat(np.array(of_items, kind), counts, axis=0)

    @property
    def _any_rows(self) -> tuple[AnyInstant, SX]:
        """A motion of symbols, and its rows."""
        motion = AnyInstant(self.motors)
        return motion, self.rows(motion, self.numbers())

    @cached_property
    def is_control(self) -> Truths:
        """Of each motor the first row that is a share of its torque and nothing else, (rows,)."""
        motion, rows = self._any_rows
        slope = ca.jacobian(rows, motion.everything)
        by_torque = ca.jacobian(rows, motion.tau)
        alone = np.array(
            [slope[i, :].nnz() == by_torque[i, :].nnz() == 1 for i in range(self.number)]
        )
        alone &= self._affine_in_torque
        first = {int(by_torque[i, :].T.row()[0]): i for i in np.flatnonzero(alone)[::-1].tolist()}
        return np.isin(np.arange(self.number), list(first.values()))

    @property
    def _affine_in_torque(self) -> Truths:
        """Rows that are affine functions of the torques, (rows,)."""
        motion, rows = self._any_rows
        torques = ca.vertcat(motion.tau, motion.dtau)
        return ~np.array(ca.which_depends(rows, torques, 2, True), np.bool)

    @property
    def holds_between_payloads(self) -> bool:
        """Whether a motion that keeps all limits with two payloads is known to keep them with every
        payload between: torques are affine in its mass, and so must be limits in them."""
        return bool(self._affine_in_torque.all())

    slowing_exponents = _of_limits(_exponent, np.intp)
    """How rows change when a motion is slowed and its torques change as 1/k², (rows,).

    A motion k times as slow has rows r₀ + (r - r₀) / kⁿ, with r₀ those at rest at the same place:
    n, as limits declare it; 0 where slowing changes nothing; ``MIXED`` of several powers, and where
    they are not known.
    """

    @property
    def are_polynomials(self) -> bool:
        """Whether all rows are polynomials of the speed when a motion is slowed and its torques
        change as 1/k²."""
        return all(limit.order == 0 or limit.powers is not None for limit in self.limits)

    @cached_property
    def bound_exponents(self) -> ca.Function:
        """(an instant, numbers of all items) -> -∂ ln |row| / ∂ ln bound of every row, at it."""
        motion, numbers, more = AnyInstant(self.motors), self.numbers(), SX.sym("more")
        raised = []
        for limit, own in self.with_numbers(numbers):
            bounds = limit.bounds(own)
            sides = [side for side in (bounds.lower, bounds.upper) if side is not None]
            of_bounds = ca.which_depends(ca.vertcat(*sides), own, 1, False)
            raised.append(own * (1 + more * SX(list(map(int, of_bounds)))))
        rows = ca.substitute(self.rows(motion, numbers), numbers, ca.vertcat(*raised))
        slopes = ca.substitute(-ca.jacobian(rows, more) / rows, more, 0)
        return ca.Function("exponents", [motion.everything, numbers], [ca.densify(slopes)])

    @cached_property
    def of_torque(self) -> Truths:
        """Rows that depend on the torques, (rows,)."""
        motion, rows = self._any_rows
        torques = ca.vertcat(motion.tau, motion.dtau)
        return np.array(ca.which_depends(rows, torques, 1, True), bool)

    @cached_property
    def has_torque_rates(self) -> bool:
        """Whether the cost, or any row, depends on the rates of the torques."""
        motion, rows = self._any_rows
        in_rows = ca.depends_on(rows, ca.vertcat(motion.dtau, motion.dtau_per_payload))
        return self.cost is Running.TORQUE_RATE or bool(in_rows)

    @cached_property
    def of_place(self) -> Truths:
        """Rows of positions that a motion must keep, (rows,): slowing cannot help them."""
        return np.asarray(self.promised & (self.orders == 0))

    promised = _of_limits(lambda limit: limit.promised, np.bool)
    """Rows of limits that a verified motion keeps, (rows,)."""

    convex = _of_limits(lambda limit: isinstance(limit, ConvexLimit), np.bool)
    """Rows of quantities that are convex functions of the position alone, (rows,)."""

    @property
    def sampled_places(self) -> Truths:
        """Rows of positions for which there is no sure bound, so that samples must do, (rows,)."""
        return np.asarray(self.of_place & ~self.convex)

    slid_along = _of_limits(lambda limit: limit.slid_along, np.bool)
    """Rows of positions along which the best motion may slide, (rows,)."""

    ridged = _of_limits(lambda limit: limit.has_ridges, np.bool)
    """Rows of positions whose size may be largest at a kink, (rows,)."""

    @cached_property
    def has_convex(self) -> bool:
        """Whether there are any."""
        return bool(self.convex.any())

    def alike(self, x: SX, first: int = 0) -> Iterator[Alike]:
        """The convex rows, item by item, as functions of the position x, 3, m; ``first``: where the
        numbers of the limits begin among those that ``Alike.numbers`` is about."""
        motion = AnyInstant(self.motors)
        motion.x = x
        for limit, place, rows in zip(self.limits, self.places, self.slices, strict=True):
            if isinstance(limit, ConvexLimit):
                which = range(rows.start, rows.stop)
                numbers = slice(first + place.start, first + place.stop)
                own = SX.sym("own", (place.stop - place.start) // len(which))
                row, measure = limit.rows(motion, own), limit.measure(motion, own)
                yield Alike(which, numbers, own, row, measure)

    def of_order(self, order: int) -> Index:
        """Indices of the rows of an order."""
        return np.asarray(np.flatnonzero(self.orders == order))
