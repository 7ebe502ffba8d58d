"""All limits of a scene together, as normalised constraint rows, and what follows from them.

Nothing here knows which limits there are. Rows are in the order of the limits; every array with a
last axis of rows is in that order, everywhere.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.limit import (
    SX,
    Bounds,
    ConvexLimit,
    Described,
    Instant,
    Limit,
    Numbers,
    PhasedLimit,
)

Array = NDArray[np.float64]
Integers = NDArray[np.intp]
Truths = NDArray[np.bool]

_EXPONENTS = (0, 1, 2, 4)
"""With which power of the speed a quantity may change: position, speed, torque or acceleration, and
squares of the latter."""
MIXED = -1
"""Stands for the exponent of a row that mixes several powers of the speed, or is no power at all:
τ + μ θ̇, ‖ẍ - g‖², a torque with friction."""
_TRIED = 8
"""Motions at random of which it is found how rows change with the speed: more than one, since a
quantity with a kink, such as |τ₁ - τ₂|, is as smooth as any other on one side of it."""


@dataclass(frozen=True)
class Constraints:
    """The limits of a scene without their numbers: each item's limit, and how many numbers it has.

    Hashable: scenes that differ in numbers only share what is derived and compiled.
    """

    items: tuple[tuple[Limit, int], ...]
    motors: int = 3

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
        return zip(self.limits, self._split(numbers), strict=True)

    def _split(self, numbers: SX) -> list[SX]:
        ends = np.cumsum([0, *(size for _, size in self.items)]).tolist()
        return [numbers[a:b] for a, b in pairwise(ends)]

    def item_of(self, row: int) -> tuple[int, int]:
        """The item that a row belongs to, and which of its rows it is."""
        item = next(i for i, rows in enumerate(self.slices) if row < rows.stop)
        return item, row - self.slices[item].start

    def label(self, row: int) -> str:
        """A row in words: "torque of motor 2"."""
        item, own = self.item_of(row)
        limit, rows = self.limits[item], self.slices[item]
        which = f" {own + 1}" if rows.stop - rows.start > 1 else ""
        return f"{limit.name} of {limit.subject}{which}"

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where the rows of each item are."""
        any_motion, parts = _AnyMotion(self.motors), self.with_numbers(self.numbers())
        ends = np.cumsum([0, *(limit.rows(any_motion, own).numel() for limit, own in parts)])
        return tuple(slice(a, b) for a, b in pairwise(ends.tolist()))

    @property
    def number(self) -> int:
        """How many rows there are."""
        return self.slices[-1].stop if self.slices else 0

    @cached_property
    def orders(self) -> Integers:
        """The order of each row, (rows,)."""
        return self._of_rows([limit.order for limit in self.limits], np.intp)

    def require_orders(self) -> None:
        """Raise ValueError for a limit whose order is not that of what its rows depend on."""
        motion = _AnyMotion(self.motors)
        for limit, own in self.with_numbers(self.numbers()):
            order = motion.order_of(limit.rows(motion, own))
            if limit.order != order:
                raise ValueError(
                    f"the limit {limit.name} says order {limit.order}; by what its rows depend on "
                    f"it is {order} (0: position, 1: velocity, 2: acceleration or torque)"
                )

    @cached_property
    def sides(self) -> Truths:
        """Whether a row has a lower and an upper bound, (rows, 2)."""
        bounds = self._bounds
        return np.stack(
            [
                self._of_rows([b.lower is not None for b in bounds], np.bool),
                self._of_rows([b.upper is not None for b in bounds], np.bool),
            ],
            axis=1,
        )

    def size(self, rows: Array) -> Array:
        """How near rows, (…, rows), are to the nearer of their bounds: 1 at a bound."""
        lower, upper = self.sides.T
        return np.maximum(np.where(upper, rows, -np.inf), np.where(lower, -rows, -np.inf))

    @cached_property
    def closed_sides(self) -> Truths:
        """The same with sides that are out of reach closed, (rows, 2)."""
        closed = self._of_rows([b.out_of_reach for b in self._bounds], np.bool)
        return np.asarray(self.sides | closed[:, None])

    @property
    def _bounds(self) -> list[Bounds]:
        return [limit.bounds(own) for limit, own in self.with_numbers(self.numbers())]

    @cached_property
    def bounds_of_rows(self) -> ca.Function:
        """Numbers of all items -> lower and upper bound and natural size of every row's measure."""
        numbers, found_of = self.numbers(), (list[SX](), list[SX](), list[SX]())
        for (limit, _), rows, own in zip(
            self.items, self.slices, self._split(numbers), strict=True
        ):
            bounds = limit.bounds(own)
            for side, found, none in zip(
                (bounds.lower, bounds.upper, bounds.scale),
                found_of,
                (-np.inf, np.inf, 1.0),
                strict=True,
            ):
                values = SX(none) if side is None else side
                one_for_all = values.numel() == 1
                found.append(
                    ca.repmat(values, rows.stop - rows.start, 1) if one_for_all else values
                )
        return ca.Function("bounds", [numbers], [ca.vertcat(*found) for found in found_of])

    def _of_rows(self, of_items: Sequence[object], kind: type) -> NDArray[Any]:
        """A value of each item, repeated for its rows."""
        counts = [s.stop - s.start for s in self.slices]
        return np.repeat(np.array(of_items, kind), counts)

    @cached_property
    def is_control(self) -> Truths:
        """Of each motor the first row that is a share of its torque and nothing else, (rows,)."""
        motion, numbers = _AnyMotion(self.motors), self.numbers()
        rows = self.rows(motion, numbers)
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
        motion = _AnyMotion(self.motors)
        rows = self.rows(motion, self.numbers())
        return ~np.array(ca.which_depends(rows, motion.tau, 2, True), np.bool)

    @property
    def holds_between_payloads(self) -> bool:
        """Whether a motion that keeps all limits with two payloads is known to keep them with every
        payload between: torques are affine in its mass, so that limits must be convex in them."""
        convex = self._of_rows([limit.convex_in_torque for limit in self.limits], np.bool)
        return bool((self._affine_in_torque | (convex & ~self.sides[:, 0])).all())

    @cached_property
    def slowing_exponents(self) -> Integers:
        """How rows change when a motion is slowed and its torques change as 1/k², (rows,).

        A motion k times as slow has rows r₀ + (r - r₀) / kⁿ, with r₀ those at rest at the same
        place: n, found by trying; 0 where slowing changes nothing; ``MIXED`` where no n fits.
        """
        found = np.full(self.number, MIXED, np.intp)
        still, part, whole = self._slowed([0.0, 0.7, 1.0])
        for n in reversed(_EXPONENTS):
            fits = np.isclose(part - still, 0.7**n * (whole - still), rtol=1e-9, atol=1e-12)
            found[fits.all(axis=0)] = n
        found[np.isclose(whole, still, rtol=0, atol=1e-12).all(axis=0)] = 0
        return found

    @cached_property
    def are_polynomials(self) -> bool:
        """Whether all rows are polynomials of the speed, of the degrees of ``_EXPONENTS`` at most,
        when a motion is slowed and its torques change as 1/k²: found by trying."""
        speeds = np.linspace(0.0, 1.0, 2 * max(_EXPONENTS))
        values = self._slowed(speeds.tolist()).reshape(len(speeds), -1)
        powers = np.vander(speeds, max(_EXPONENTS) + 1)
        left = values - powers @ np.linalg.lstsq(powers, values)[0]
        return bool((np.abs(left) <= 1e-9 * np.maximum(np.abs(values).max(axis=0), 1)).all())

    def _slowed(self, speeds: Sequence[float]) -> Array:
        """Rows of motions at random at some speeds, (speeds, motions, rows)."""
        motion, numbers, s = _AnyMotion(self.motors), self.numbers(), SX.sym("s")
        rows = ca.substitute(self.rows(motion, numbers), motion.everything, motion.slowed(s))
        f = ca.Function("slowed", [s, motion.seeds, numbers], [rows])
        rng = np.random.default_rng(1)
        motions = rng.uniform(-1.5, 1.5, (_TRIED, motion.seeds.numel()))
        p = rng.uniform(0.5, 1.5, self.parameters)
        return np.array([[np.array(f(s, x, p)).ravel() for x in motions] for s in speeds])

    @cached_property
    def bound_exponents(self) -> ca.Function:
        """(an instant, numbers of all items) -> -∂ ln |row| / ∂ ln bound of every row, at it."""
        motion, numbers, more = _AnyMotion(self.motors), self.numbers(), SX.sym("more")
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
        motion = _AnyMotion(self.motors)
        rows = self.rows(motion, self.numbers())
        return np.array(ca.which_depends(rows, motion.tau, 1, True), bool)

    @cached_property
    def of_place(self) -> Truths:
        """Rows of positions that a motion must keep, (rows,): slowing cannot help them."""
        promised = self._of_rows([limit.promised for limit in self.limits], np.bool)
        return np.asarray(promised & (self.orders == 0))

    @cached_property
    def convex(self) -> Truths:
        """Rows of quantities that are convex functions of the position alone, (rows,)."""
        return self._of_rows([isinstance(limit, ConvexLimit) for limit in self.limits], np.bool)

    @cached_property
    def slid_along(self) -> Truths:
        """Rows of positions along which the best motion may slide, (rows,)."""
        return self._of_rows([limit.slid_along for limit in self.limits], np.bool)

    @cached_property
    def ridged(self) -> Truths:
        """Rows of positions whose size may be largest at a kink, (rows,)."""
        return self._of_rows([limit.has_ridges for limit in self.limits], np.bool)

    @cached_property
    def in_phases(self) -> Truths:
        """Rows of positions that hold in some phases of a motion, (rows,)."""
        return self._of_rows([isinstance(limit, PhasedLimit) for limit in self.limits], np.bool)

    @cached_property
    def has_convex(self) -> bool:
        """Whether there are any."""
        return bool(self.convex.any())

    def convex_measures(self, x: SX, numbers: SX) -> SX:
        """The measures of these rows at a position, 3, m."""
        motion = _AnyMotion(self.motors)
        motion.x = x
        parts = self._convex_items(numbers)
        return ca.vertcat(*(limit.measure(motion, own) for limit, own in parts))

    @cached_property
    def edge_radii(self) -> ca.Function:
        """Numbers of all items -> least radii of curvature of their bounds, m."""
        numbers = self.numbers()
        radii = [limit.edge_radii(own) for limit, own in self._convex_items(numbers)]
        return ca.Function("edge_radii", [numbers], [ca.vertcat(*radii)])

    def _convex_items(self, numbers: SX) -> Iterator[tuple[ConvexLimit, SX]]:
        for limit, own in self.with_numbers(numbers):
            if isinstance(limit, ConvexLimit):
                yield limit, own

    def of_order(self, order: int) -> Integers:
        """Indices of the rows of an order."""
        return np.asarray(np.flatnonzero(self.orders == order))


@dataclass(frozen=True)
class Phased:
    """A limit with other numbers in each phase, and where its ``numbers`` and ``rows`` are."""

    limit: PhasedLimit
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
        constraints = Constraints(items, self.constraints.motors)
        return SceneLimits(_shared(constraints), np.concatenate(numbers))

    @property
    def of_items(self) -> list[Array]:
        """The numbers of each item."""
        ends = np.cumsum([size for _, size in self.constraints.items])[:-1]
        return np.split(self.numbers, ends)

    @cached_property
    def phased(self) -> Phased | None:
        """The limit whose numbers differ from phase to phase of the motion, if there is one."""
        begin = 0
        for (limit, size), rows in zip(
            self.constraints.items, self.constraints.slices, strict=True
        ):
            if isinstance(limit, PhasedLimit):
                return Phased(limit, slice(begin, begin + size), rows)
            begin += size
        return None

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bound of every measure in its unit, infinite where there is none."""
        return _bounds(self.constraints, tuple(self.numbers.tolist()))[:2]

    @cached_property
    def scales(self) -> Array:
        """The natural size of every measure in its unit."""
        return _bounds(self.constraints, tuple(self.numbers.tolist()))[2]

    @cached_property
    def edge_radii(self) -> Array:
        """Of the rows of ``Constraints.convex`` the radii of the edges of their bounds, m."""
        return np.array(self.constraints.edge_radii(self.numbers)).ravel()

    @cached_property
    def faces(self) -> tuple[tuple[Array, ...], ...]:
        """Of each row of ``Constraints.convex`` all numbers, with those of its body replaced by
        those of one of its faces, for every face, as of ``ConvexLimit.faces``."""
        return tuple(
            tuple(self._with_part(part, face) for face in limit.faces(self.numbers[own])[row])
            for limit, own, row, part in self._convex_rows
        )

    def opened(self, row: int, faces: Collection[int]) -> Array | None:
        """All numbers with those of the body of one of these rows replaced as of
        ``ConvexLimit.opened``."""
        limit, own, inner, part = self._convex_rows[row]
        found = limit.opened(self.numbers[own], inner, faces)
        return None if found is None else self._with_part(part, found)

    @cached_property
    def _convex_rows(self) -> list[tuple[ConvexLimit, slice, int, slice]]:
        """Of each of these rows its limit, the place of all its numbers, which of its rows it is,
        and the place of the numbers of that."""
        found, begin = list[tuple[ConvexLimit, slice, int, slice]](), 0
        parts = zip(self.constraints.items, self.constraints.slices, strict=True)
        for (limit, size), rows in parts:
            number = rows.stop - rows.start
            if isinstance(limit, ConvexLimit):
                each, own = size // number, slice(begin, begin + size)
                places = (slice(begin + k * each, begin + (k + 1) * each) for k in range(number))
                found += [(limit, own, k, place) for k, place in enumerate(places)]
            begin += size
        return found

    def _with_part(self, place: slice, part: Array) -> Array:
        """All numbers, some of them replaced."""
        numbers = self.numbers.copy()
        numbers[place] = part
        return numbers

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
        parts = zip(self.constraints.limits, self.constraints.slices, strict=True)
        return next((self.bounds[1][rows] for limit, rows in parts if limit.name == name), None)


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


class _AnyMotion:
    """An instant of which every quantity is a symbol of its own."""

    def __init__(self, motors: int) -> None:
        self.x, self.v, self.a = (SX.sym(name, 3) for name in ("x", "v", "a"))
        self.theta, self.dtheta, self.ddtheta, self.tau, self._holding = (
            SX.sym(name, motors) for name in ("theta", "dtheta", "ddtheta", "tau", "holding")
        )
        self.alignment, self.tilt = SX.sym("alignment", motors), SX.sym("tilt", motors)
        self.parallel_margin, self.tilt_margin = SX.sym("parallel"), SX.sym("tilted")
        self.tau_per_payload = SX.sym("tau_per_payload", motors)
        self._holding_per_payload = SX.sym("holding_per_payload", motors)

    @property
    def everything(self) -> SX:
        """All quantities."""
        torques = self.tau_per_payload, self.tau
        return ca.vertcat(*self._positions, *self._rates, *self._second, *torques)

    def order_of(self, rows: SX) -> int:
        """The highest derivative of position that rows depend on; torques are accelerations."""
        by_order = self._positions, self._rates, [*self._second, self.tau, self.tau_per_payload]
        return max(n for n in range(3) if n == 0 or ca.depends_on(rows, ca.vertcat(*by_order[n])))

    @property
    def seeds(self) -> SX:
        """All quantities, and the torques that hold the robot at rest."""
        return ca.vertcat(self.everything, self._holding, self._holding_per_payload)

    def slowed(self, s: SX) -> SX:
        """All quantities of the motion at s times its speed."""
        return ca.vertcat(
            *self._positions,
            *(s * rate for rate in self._rates),
            *(s**2 * rate for rate in self._second),
            self._holding_per_payload + s**2 * (self.tau_per_payload - self._holding_per_payload),
            self._holding + s**2 * (self.tau - self._holding),
        )

    @property
    def _positions(self) -> list[SX]:
        chains = self.x, self.theta, self.alignment, self.tilt
        return [*chains, self.parallel_margin, self.tilt_margin]

    @property
    def _rates(self) -> list[SX]:
        return [self.v, self.dtheta]

    @property
    def _second(self) -> list[SX]:
        return [self.a, self.ddtheta]
