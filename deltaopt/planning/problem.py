"""What a planner needs of a problem, whatever its variables are."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.mechanisms.delta_functions import DeltaFunctions
from deltaopt.planning.nlp import Program, Solution
from deltaopt.planning.scales import Scales
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.trajectory import PiecewisePolynomial, Trajectory

Array = NDArray[np.float64]


class Problem(Protocol):
    """A problem on a mesh, ready to be solved for scenes of a robot."""

    @property
    def mesh(self) -> Array:
        """Lengths of the intervals as fractions of the duration, (N,)."""
        ...

    @property
    def program(self) -> Program:
        """The nonlinear program; its parameters are ``Scales.vector`` and the mechanism's."""
        ...

    def pack(self, trajectory: Trajectory, scales: Scales) -> Array:
        """The variables that describe a motion on this mesh."""
        ...

    def unpack(
        self, z: Array, scales: Scales
    ) -> tuple[PiecewisePolynomial, PiecewisePolynomial | None]:
        """The motion of the platform that the variables describe, m and s; and that of all
        coordinates, m, rad and s, where it does not follow from the platform's."""
        ...

    def bounds(self, scales: Scales) -> tuple[Array, Array]:
        """Of the variables, for a scene."""
        ...

    def prices(self, solution: Solution) -> Array:
        """Fraction of the duration per fraction of a limit, (N, points, 3 or 6): torques, then
        limited speeds; positive at the upper limit, negative at the lower."""
        ...


class Posed(Protocol):
    """A formulation's equations for a mechanism, differentiated once."""

    def on(self, mesh: Array) -> Problem:
        """The problem on a mesh."""
        ...


class Pose(Protocol):
    """A way to write the minimum-time problem as a nonlinear program."""

    @property
    def name(self) -> str: ...

    def of(
        self, functions: DeltaFunctions, transcription: PiecewiseAcceleration, *, speed: bool
    ) -> Posed:
        """Its equations for a mechanism; ``speed``: whether motor speeds are limited."""
        ...
