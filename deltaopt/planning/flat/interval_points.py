"""Where the interior-point method imposes limits in every interval of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from deltaopt.codegen.dense_solver import solve


@dataclass(frozen=True)
class Points:
    """Where limits hold in every interval: ``fractions`` of it; in which of its ``thirds`` each is,
    of cubics that meet there, at whose ends jerk jumps; and ``weights`` of integrals over it."""

    fractions: tuple[float, ...]
    thirds: tuple[int, ...]
    weights: tuple[float, ...]

    @classmethod
    def of(cls, fractions: Sequence[float]) -> Self:
        """Points with weights that integrate the polynomial through them; an interval of cubics in
        thirds counts as one polynomial."""
        powers = np.vander(np.array(fractions), increasing=True).T
        weights = solve(powers, 1 / np.arange(1, len(fractions) + 1))
        assert weights is not None  # points differ
        return cls(tuple(fractions), (0,) * len(fractions), tuple(weights.tolist()))


THIRDS = Points((0.0, 1 / 3, 2 / 3, 1.0), (0, 1, 1, 2), (1 / 3, 1 / 6, 1 / 6, 1 / 3))
"""Points of cubics in thirds, one or two in each. Their weights integrate the square of jerk, which
is constant in each, exactly."""
