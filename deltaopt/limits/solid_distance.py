"""The signed distance from a solid, of a place and of a line: expressions, and a compiled function.

Along a line the distance from a convex body is a convex function, whose least value is where its
slope changes sign: bisection finds about where, and one step of Newton's method then gives that
place, and how it moves with the line, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.limits.limit import SX, Numbers
from deltaopt.robot.solids import Solid

OF_SOLID = 17
"""Numbers of a solid: axes, centre, half lengths, whether it is round, radius."""
AXES, CENTRE, HALF, IS_ROUND, RADIUS = slice(0, 9), slice(9, 12), slice(12, 15), 15, 16
"""Where these are among them."""
TINY = 1e-24
"""Stands for a squared distance of 0, m², where a root would have no derivative."""
_BISECTIONS = 12
"""Of a line: its nearest place is then known to a four-thousandth of it, from where one step of
Newton's method leads to rounding. Each is some forty operations for each pair and instant."""
_CLOSELY = 50
"""The same where a motion is looked at and not optimised: to rounding, for the step may lead across
a kink, and inside of a solid there is none."""
_LEAST_BEND = 1e-9
"""Of the squared length: least curvature of the squared distance along a line, where it is beside a
side of a body that it is parallel to, and every place is as near."""


def numbers_of_solid(solid: Solid) -> Numbers:
    """A solid as so many numbers as ``OF_SOLID`` says."""
    axes = tuple(component for axis in solid.axes for component in axis)
    return (*axes, *solid.centre, *solid.half, float(solid.is_cylinder), solid.radius)


def distance_from_solid(x: SX, own: SX) -> SX:
    """Signed distance of a point (3, m) from a solid, by its numbers."""
    axes, centre, half = ca.reshape(own[AXES], 3, 3).T, own[CENTRE], own[HALF]
    is_round, radius = own[IS_ROUND], own[RADIUS]
    u = axes @ (x - centre)
    across = root(u[0] ** 2 + is_round * u[1] ** 2)
    beyond = ca.vertcat(across, (1 - is_round) * ca.fabs(u[1]), ca.fabs(u[2])) - half
    outside = root(ca.sumsqr(ca.vertcat(*map(positive, ca.vertsplit(beyond)))))
    nearest = larger(larger(beyond[0], beyond[1]), beyond[2])
    return outside - positive(-nearest) - radius


@lru_cache(maxsize=1)
def nearest_on_line() -> RowFunction:
    """(begin and end of a line, numbers of a solid) -> at which share of the line, from 0 to 1, it
    is nearest to the solid, the signed distance there, m, and the gradient of that, a unit vector.
    """
    begin, end, x = (SX.sym(name, 3) for name in ("begin", "end", "x"))
    solid = SX.sym("solid", OF_SOLID)
    share, distance = nearest_share(begin, end, solid, _CLOSELY), distance_from_solid(x, solid)
    distance -= root(SX(0))  # what the distance is too large by inside of a solid
    found = ca.substitute(
        [distance, ca.gradient(distance, x)], [x], [begin + share * (end - begin)]
    )
    return RowFunction.of("nearest", [begin, end, solid], [share, *found])


@dataclass(frozen=True, eq=False)
class _Line:
    """A line in the axes of a solid: where it begins, its way to its end, and the solid."""

    begin: SX
    way: SX
    solid: SX

    def beyond(self, share: SX) -> tuple[list[SX], list[SX], SX]:
        """At a share of the line: by how much it is beyond the solid's sides, the rates of these
        by the share, and the rate of the first of these rates, which of a cylinder is not
        constant."""
        half, is_round, u, way = self.solid[HALF], self.solid[IS_ROUND], self.begin, self.way
        u = u + share * way
        across = root(u[0] ** 2 + is_round * u[1] ** 2)
        rate = (u[0] * way[0] + is_round * u[1] * way[1]) / across
        bend = (way[0] ** 2 + is_round * way[1] ** 2 - rate**2) / across
        far = across - half[0], (1 - is_round) * ca.fabs(u[1]) - half[1], ca.fabs(u[2]) - half[2]
        rates = [rate, (1 - is_round) * _sign(u[1]) * way[1], _sign(u[2]) * way[2]]
        return list(far), rates, bend

    def slope(self, share: SX) -> SX:
        """A number with the sign of the distance's rate by the share."""
        far, rates, _ = self.beyond(share)
        outside = sum((positive(a) * rate for a, rate in zip(far, rates, strict=True)), SX(0))
        farthest, inside = selected(far, rates, 1)
        is_outside = farthest > 0
        return where(is_outside, outside) + where(ca.logic_not(is_outside), inside)


def nearest_share(begin: SX, end: SX, solid: SX, bisections: int = _BISECTIONS) -> SX:
    """At which share of a line, from 0 to 1, it is nearest to a solid, by the numbers of that."""
    axes, centre = ca.reshape(solid[AXES], 3, 3).T, solid[CENTRE]
    line = _Line(axes @ (begin - centre), axes @ (end - begin), solid)
    share, step = SX(0.5), 0.25
    for _ in range(bisections):
        recedes = line.slope(share) > 0
        share = share + step - where(recedes, SX(2 * step))
        step /= 2
    far, rates, bend = line.beyond(share)
    away = [positive(a) for a in far]
    slope = sum((a * rate for a, rate in zip(away, rates, strict=True)), SX(0))
    curvature = sum((where(a > 0, r**2) for a, r in zip(far, rates, strict=True)), away[0] * bend)
    share = share - slope / larger(curvature, _LEAST_BEND * ca.sumsqr(line.way))
    share = positive(share)
    return 1 - positive(1 - share)


def _sign(value: SX) -> SX:
    return where(value > 0, SX(2)) - 1


def root(square: SX) -> SX:
    """A square root with a derivative at 0."""
    return ca.sqrt(larger(square, SX(TINY)))


def positive(value: SX) -> SX:
    """A value, or 0 where it is negative."""
    return where(value > 0, value)


def larger(one: SX, other: SX) -> SX:
    """The larger of two values."""
    return where(other < one, one) + where(ca.logic_not(other < one), other)


def selected(values: list[SX], data: list[SX], sign: int) -> tuple[SX, SX]:
    """The largest (sign 1) or smallest (-1) of values, and the data that belong to it."""
    best, chosen = values[0], data[0]
    for value, own in zip(values[1:], data[1:], strict=True):
        better = sign * best < sign * value
        best = best + where(better, value - best)
        chosen = chosen + where(better, own - chosen)
    return best, chosen


def where(condition: SX, value: SX) -> SX:
    """A value where a condition holds, otherwise 0, whatever the value is there."""
    return ca.if_else(condition, value, 0)
