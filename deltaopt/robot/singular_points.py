"""Points in or near singularities, where a result does not exist or is found in another way."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.errors import Singular, Singularity
from deltaopt.mechanisms.delta.singularities import margins

NEAR = 1e-2
"""Distance ε from a serial singularity, cos q_{k,3} or sin (q_{k,1} - q_{k,2}), below which other
equations than eq. (55) are used, because its error grows as ε⁻⁵ in accelerations and as ε⁻¹ in
torques at rest (docs/where-methods-fail.md), and faster in moving torques of the short form for
slender bars: model L_I for accelerations, motor angles as independent coordinates for torques."""
SERIAL_LIMIT = 1e-6
"""Distance from a serial singularity below which a moving platform raises Singular. Torques have
three correct digits there at best, for the platform's position determines only the square of the
distance."""
PARALLEL_LIMIT = 1e-12
"""Distance from a parallel singularity, a volume without unit, below which torques raise Singular.
They have four correct digits there."""


_NONE = np.zeros(0)


@dataclass(frozen=True)
class DoubtfulPoints:
    """Points that may be in or near a singularity: their ``places`` among all points, and their
    coordinates ``q``, (n, 12)."""

    places: Index
    q: Array

    def of(self, argument: ArrayLike) -> Array:
        """The rows of these points in an array for all points."""
        return rows_at(argument, self.places)

    @cached_property
    def margins(self) -> Array:
        """Signed distances from singularities, (n, 7): ``singularities.margins``."""
        (found,) = _margins()(self.q, parameters=_NONE)
        return found

    @property
    def near(self) -> Truths:
        """Whether a chain is near a serial singularity, (n,)."""
        return np.asarray(np.any(np.abs(self.margins[:, :6]) < NEAR, axis=1))

    def require_serial(self, moving: Truths | None = None) -> None:
        """Raise Singular if a point, among those ``moving``, is in a serial singularity."""
        singular: Truths = np.abs(self.margins[:, :6]) < SERIAL_LIMIT
        if moving is not None:
            singular &= moving[:, None]
        anywhere: Truths = np.any(singular, axis=1)
        for row, column in np.argwhere(singular)[:1]:
            kind = Singularity.SIDEWAYS if column < 3 else Singularity.IN_LINE
            self._refuse(kind, int(column) % 3 + 1, self.margins[row, column], anywhere)

    def require_parallel(self) -> None:
        """Raise Singular if a point is in a parallel singularity."""
        volumes = self.margins[:, 6]
        singular: Truths = np.abs(volumes) < PARALLEL_LIMIT
        if singular.any():
            self._refuse(Singularity.PARALLEL, None, volumes[np.argmax(singular)], singular)

    def _refuse(
        self, kind: Singularity, chain: int | None, margin: float, singular: Truths
    ) -> None:
        places = self.places[singular]
        raise Singular(kind, chain, float(margin), f"point {places[0]}", places)


def rows_at(argument: ArrayLike, places: Index) -> Array:
    """The rows of an argument at these places; a single point serves all places."""
    rows = np.asarray(argument, dtype=float)
    if rows.ndim == 1:
        return np.broadcast_to(rows, (len(places), len(rows)))
    return np.asarray(rows[places])


def still(rate: Array) -> Truths:
    """Whether velocities or accelerations, (n, 3), are zero, (n,)."""
    return np.asarray(np.all(rate == 0, axis=1))


@cache
def _margins() -> RowFunction:
    """(q, no parameters) -> the seven margins."""
    q = ca.SX.sym("q", 12)
    return RowFunction(ca.Function("margins", [q, ca.SX(0, 1)], [margins(q)]))
