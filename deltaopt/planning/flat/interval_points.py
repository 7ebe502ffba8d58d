"""Where the interior-point method imposes limits in every interval of a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
        """Points with weights that integrate the polynomial through them."""
        powers = np.vander(np.array(fractions), increasing=True).T
        weights = solve(powers, 1 / np.arange(1, len(fractions) + 1))
        assert weights is not None  # points differ
        return cls(tuple(fractions), (0,) * len(fractions), tuple(weights.tolist()))


OF_JERK = Points((0.0, 1 / 3, 2 / 3, 1.0), (0, 1, 1, 2), (1 / 3, 1 / 6, 1 / 6, 1 / 3))
"""Points of cubics in thirds, one or two in each. Their weights integrate the square of jerk, which
is constant in each, exactly."""
OF_ACCELERATION = replace(OF_JERK, weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6))
"""The same points with the weights of the trapezoidal rule, for integrals of what is continuous,
such as torques. They weigh all ends of thirds alike, as the integral of an acceleration does that
is linear between them. By weights of a higher order, which differ, torques that ripple from one end
to the next would cost less than steady ones."""
