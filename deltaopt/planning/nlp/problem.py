"""Problems as the planner sees them, whatever their variables: costs, solvers, solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.limits.running_cost import Running
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.nlp.scaling import Scaling

IPOPT_FINEST = 300
"""Number of intervals of the finest mesh that is solved by Ipopt: every refinement multiplies its
time by about four, and a plan should not take minutes."""


@dataclass(frozen=True)
class Cost:
    """The cost time · T + running · ∫ r dt, with T and t in the scene's unit of time.

    ``time``, ``running``: the weights; r is the ``rate`` of the running cost, of a jerk in units of
    the scene.
    ``duration_is_given``: whether the duration is no variable; it is the unit of time then, T = 1.
    """

    time: float = 1.0
    running: float = 0.0
    duration_is_given: bool = False
    rate: Running = Running.EFFORT


FASTEST = Cost()
"""Minimum time."""
SMOOTHLY_FASTEST = Cost(running=1e-9, rate=Running.JERK)
"""Minimum time where acceleration is continuous, and the least jerk of the motions that take no
longer: where the duration leaves torques free they would chatter. It costs some 1e-5 of it."""


def effort_of(tau: ca.SX, motors: ca.SX) -> ca.SX:
    """The rate of effort of torques, (m,); weighted, where there are weights of the motors."""
    return ca.dot(motors, tau**2) if motors.numel() else ca.sumsqr(tau)


@dataclass(frozen=True)
class Ipopt:
    """Ipopt, the general interior-point solver that is widely used in trajectory optimisation.

    It solves every formulation, with or without a C compiler.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> slower = deltaopt.plan(scene, solver=deltaopt.ipopt, tolerance=1e-2)
        >>> round(slower.duration, 2)
        0.14
    """

    name: str = "ipopt"


@dataclass(frozen=True)
class InteriorPoint:
    """deltaopt's own interior-point method in compiled C, for the flat formulation.

    Ipopt takes over where there is no C compiler.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> deltaopt.plan(scene, solver=deltaopt.interior_point).status
        'Solve_Succeeded'
    """

    name: str = "interior-point"


Solver = Ipopt | InteriorPoint


@dataclass(frozen=True)
class Guess:
    """A motion that a solver starts from, and the accuracy that is asked for.

    ``near``: whether the motion is a solution of a similar problem, such as that on the mesh
    before. ``tolerance``: of the solution, relative to the duration; the solver may be more exact.
    ``rows``: to which share of their bounds the limits are met; None for ``tolerance``.
    ``multipliers``: as of `Solved`, where the motion solves the problem on this very mesh but for
    limits that were moved by a little; None on another mesh.
    ``on_its_mesh``: whether the motion's knots are among those of this mesh; through a passage that
    is narrower than the spacing of knots elsewhere a solution must not go far from it.
    ``is_trial``: whether others are tried beside it, or a plan is known.
    """

    trajectory: Trajectory
    near: bool
    tolerance: float
    rows: float | None = None
    multipliers: Array | None = None
    on_its_mesh: bool = False
    is_trial: bool = False


@dataclass(frozen=True)
class Solved:
    """The motion that a solver found on a mesh, and the multipliers of its limits.

    ``position``: of the platform, m over s. ``multipliers``: relative increase of the duration per
    unit by which the bound of a normalised row is tightened ("shadow prices"), (N, points, rows):
    positive at an upper bound, negative at a lower one. ``all_at_points``: whether these are all
    multipliers of the motion, given at the problem's points. ``coordinates``: all twelve, m and
    rad, where they do not follow from the platform's position. ``left``: by what fraction of the
    duration the solver's next step would shorten it. ``mesh``: lengths of the intervals as
    fractions of the duration, (N,), where the solver has changed them; None where not. ``widths``:
    of friction in the solver's intervals, as of `Softening`; None where it is as it is.
    """

    position: PiecewisePolynomial
    multipliers: Array
    status: str
    iterations: int
    all_at_points: bool = False
    coordinates: PiecewisePolynomial | None = None
    left: float = 0.0
    mesh: Array | None = None
    widths: Array | None = None


class MeshProgram(Protocol):
    """A nonlinear program on a mesh, which can be solved for many problems of a robot."""

    @property
    def mesh(self) -> Array:
        """Lengths of the intervals as fractions of the duration, (N,)."""

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits are imposed."""

    @property
    def finest(self) -> int:
        """Number of intervals of the finest mesh that is worth its solver's time."""

    @property
    def takes_phases(self) -> bool:
        """Whether its solver finds motions in phases."""

    def solve(self, guess: Guess, scaling: Scaling) -> Solved:
        """Find the best motion on this mesh. Raises NotConverged."""


Formulated = Callable[[Array], MeshProgram]
"""A formulation's equations for a mechanism and its limits, differentiated once: the program on a
mesh of interval lengths, (N,), fractions of the duration."""
