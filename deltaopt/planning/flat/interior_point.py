"""An interior-point method for motions of least time or of least cost, in machine code.

What makes it fast is what a general solver cannot know: the motion between two knots is a
polynomial there, so nothing is left to be continuous; torques are functions of the motion, so
no equation is left either; four points are evaluated at once, in the lanes of a vector; and
the KKT system is block tridiagonal with a narrow border: see ``problem.c``.

What happens at a point (equations of motion, limits) is a `PointProblem`; a motion is a list of
`Phase` values between `PhaseBoundary` values.
"""

from __future__ import annotations

import ctypes
import logging
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.compile import library
from deltaopt.codegen.dense_solver import solve
from deltaopt.codegen.simd_c import LANES
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.flat.method_source import source
from deltaopt.planning.flat.point_problem import PointProblem

STATUS = (
    "Solve_Succeeded",
    "Maximum_Iterations_Exceeded",
    "No_Progress",
    "Singular",
    "Invalid_Number_Detected",
)
"""By the number that ``solve`` returns; Ipopt's words where it has them."""


_LOG = logging.getLogger(__name__)
"""Iterations are told at the level DEBUG, and cost nothing otherwise."""
_TRACED = 4
"""Numbers of each iteration, as in ``problem.c``."""


@dataclass(frozen=True)
class IntervalPoints:
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


OF_JERK = IntervalPoints((0.0, 1 / 3, 2 / 3, 1.0), (0, 1, 1, 2), (1 / 3, 1 / 6, 1 / 6, 1 / 3))
"""Points of cubics in thirds, one or two in each. Their weights integrate the square of jerk, which
is constant in each, exactly."""
OF_ACCELERATION = replace(OF_JERK, weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6))
"""The same points with the weights of the trapezoidal rule, for integrals of what is continuous,
such as torques. They weigh all ends of thirds alike, as the integral of an acceleration does that
is linear between them. By weights of a higher order, which differ, torques that ripple from one end
to the next would cost less than steady ones."""
AT_BOTH_ENDS = IntervalPoints(
    (0.0, 1 / 6, 1 / 3, 1 / 3, 2 / 3, 2 / 3, 5 / 6, 1.0),
    (0, 0, 0, 1, 1, 2, 2, 2),
    (1 / 6, 0.0, 1 / 6, 1 / 6, 1 / 6, 1 / 6, 0.0, 1 / 6),
)
"""Both ends of each of these cubics, and the middles of two of them: a row of jerk that changes
much within one, as a rate of a torque does where an arm with Coulomb friction turns back, is seen
on both sides of where jerk jumps. Their weights integrate exactly, and by the trapezoidal rule, as
those above."""


@dataclass(frozen=True)
class Settings:
    """When the method starts, and when it stops.

    ``tolerance``: it stops when complementarity and the last change of the cost are below
    this fraction of the cost, and every row is met to it, or to ``rows``. ``barrier``:
    complementarity at the start, as a fraction of the cost. ``closest``: at the start no row is
    closer to its bound than this fraction of the bound. ``iterations``: the most it does.
    ``smooth``: of how much smoothness counts, so that of motions that are about equally good the
    smoothest is found: the weight of what ``unevenness`` of ``rows.c`` adds up.
    """

    tolerance: float = 1e-5
    barrier: float = 0.2
    closest: float = 0.3
    iterations: int = 60
    rows: float | None = None
    smooth: float = 0.0

    @property
    def row_tolerance(self) -> float:
        """To which every row is met, as a share of its limit."""
        return self.tolerance if self.rows is None else self.rows


@dataclass(frozen=True)
class PhaseBoundary:
    """What is known of the state where a phase begins or ends: each component fixed or free.

    ``state``: position, velocity (and acceleration, for cubics in thirds), (derivatives,
    coordinates), in constant units; what is free there is of no account. ``free``: which components
    are, the same shape; where two phases meet they are continuous. ``drift``: velocity of a
    position that moves, (coordinates,); ``state`` then has the position at the time 0 of the whole
    motion. ``radius``: of a sphere about the position in ``state`` that a free position must be in;
    0 without one.
    """

    state: Array
    free: Truths
    drift: Array
    radius: float = 0.0


@dataclass(frozen=True)
class Phase:
    """A part of a motion, with a guess of its knots and duration, or with those that were found.

    ``mesh``: intervals as fractions of the phase's duration, (N,). ``p``: parameters of the point
    problem. ``share``: of the rows' limits that may be used, (N, rows); infinite: this row has no
    limit there. ``knots``: X, V (and A) in units of the phase's duration, (N + 1, unknowns).
    ``duration_is_given``: it stays as in the guess. ``multipliers``: of the rows at every point,
    (N, points, rows), cost per share of a limit, positive at an upper limit and negative at a
    lower: of a solution near the guess, to begin from; empty to begin from those that the barrier
    alone asks for. All phases of a motion have them or none. ``own``: parameters of each
    interval's own, in place of those in p, (N, …).
    """

    mesh: Array
    p: Array
    share: Array
    knots: Array
    duration: float
    duration_is_given: bool = False
    multipliers: Array = field(default_factory=lambda: np.empty(0))
    own: Array = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class InteriorPointSolution:
    """Where the method ended. ``sphere_multipliers``: one for each boundary, cost per share of the
    squared radius; 0 where there is no sphere. ``cost``: what is minimised. ``left``: by what
    fraction of it Newton's next step would change it."""

    phases: tuple[Phase, ...]
    sphere_multipliers: Array
    cost: float
    left: float
    status: str
    iterations: int

    @property
    def solved(self) -> bool:
        return self.status == STATUS[0]


class _Settings(ctypes.Structure):
    _fields_ = (
        ("tolerance", ctypes.c_double),
        ("rows", ctypes.c_double),
        ("barrier", ctypes.c_double),
        ("closest", ctypes.c_double),
        ("iterations", ctypes.c_int64),
        ("trace", ctypes.c_void_p),
        ("is_warm", ctypes.c_int64),
        ("smooth", ctypes.c_double),
    )


class _Report(ctypes.Structure):
    _fields_ = (
        ("cost", ctypes.c_double),
        ("complementarity", ctypes.c_double),
        ("dual", ctypes.c_double),
        ("primal", ctypes.c_double),
        ("iterations", ctypes.c_int64),
    )


class _Workspace(threading.local):
    """Memory of a thread for the method: the largest so far, kept from call to call, since fresh
    pages cost more than the solution. A call lets other threads run, so each has its own."""

    memory: Array = np.empty(0)

    def at_least(self, size: int) -> Array:
        if size > self.memory.nbytes:
            self.memory = np.empty(-(-size // 8))
        return self.memory


_WORKSPACE = _Workspace()


@dataclass(frozen=True)
class CompiledMethod:
    """The method for one point problem; limits hold at ``points`` of every interval."""

    code: ctypes.CDLL
    problem: PointProblem = field(repr=False)
    points: IntervalPoints

    def solve(
        self,
        phases: Sequence[Phase],
        boundaries: Sequence[PhaseBoundary],
        settings: Settings,
        weights: tuple[float, float] = (1.0, 0.0),
        *,
        sum_is_given: bool = False,
    ) -> InteriorPointSolution:
        """The best motion through phases in their order, from their guesses: the fastest, unless
        the problem has a running cost.

        ``boundaries``: the start, where each phase but the last meets the next, and the goal.
        ``weights``: of the duration and of the running cost, if the problem has one.
        ``sum_is_given``: whether the phases together take as long as those of the guess.
        """
        counts = [len(phase.mesh) for phase in phases]
        flags = np.array(
            [
                *counts,
                *[phase.duration_is_given for phase in phases],
                *np.concatenate([boundary.free.ravel() for boundary in boundaries]),
            ],
            dtype=np.int64,
        )
        numbers = np.concatenate(
            [
                *[phase.mesh for phase in phases],
                *[phase.own.ravel() for phase in phases],
                *[phase.share.ravel() for phase in phases],
                *[phase.p for phase in phases],
                *[boundary.state.ravel() for boundary in boundaries],
                *[boundary.drift for boundary in boundaries],
                [boundary.radius for boundary in boundaries],
                [*weights, sum_is_given],
            ]
        )
        motion = np.concatenate(
            [*[phase.knots.ravel() for phase in phases], [phase.duration for phase in phases]]
        )
        points = self.points
        rule = np.array([*points.fractions, *points.thirds, *points.weights])
        rows = sum(counts) * len(points.fractions) * len(self.problem.sides)
        has_sphere = np.array([boundary.radius > 0 for boundary in boundaries])
        multipliers = np.empty(rows + int(has_sphere.sum()))
        known = [_usable(phase) for phase in phases if phase.multipliers.size]
        if known:
            multipliers[:rows] = np.concatenate(known)
        arrays = flags, rule, numbers, motion, multipliers
        status, report = self.run(len(counts), arrays, settings, is_warm=bool(known))
        of_spheres = np.zeros(len(boundaries))
        of_spheres[has_sphere] = multipliers[rows:]
        return InteriorPointSolution(
            tuple(self._found(phases, motion, multipliers[:rows])),
            of_spheres,
            report.cost,
            report.dual,
            STATUS[status],
            report.iterations,
        )

    def run(
        self, phases: int, arrays: Sequence[NDArray[Any]], settings: Settings, *, is_warm: bool
    ) -> tuple[int, _Report]:
        """Call the compiled method.

        ``arrays``: flags, rule, numbers, motion and multipliers as ``solve`` in
        ``interior_point.c`` takes them; it overwrites the last two. ``is_warm``: whether
        multipliers are given to begin from.
        """
        n = int(arrays[0][:phases].sum())
        size = self.code.workspace(ctypes.c_int64(n), ctypes.c_int64(phases))
        report = _Report()
        watched = _LOG.isEnabledFor(logging.DEBUG)
        trace = np.zeros((settings.iterations + 1, _TRACED)) if watched else None
        asked = _Settings(
            **vars(settings) | {"rows": settings.row_tolerance},
            trace=None if trace is None else trace.ctypes.data,
            is_warm=is_warm,
        )
        status = self.code.solve(
            ctypes.c_int64(phases),
            *map(_pointer, arrays),
            ctypes.byref(asked),
            ctypes.byref(report),
            _pointer(_WORKSPACE.at_least(size)),
        )
        if trace is not None:
            _log(trace[: report.iterations + 1], n, STATUS[status])
        return status, report

    def _found(self, phases: Sequence[Phase], motion: Array, multipliers: Array) -> Iterator[Phase]:
        """The phases of a guess with what was found for them."""
        knots = motion[: -len(phases)].reshape(-1, self.problem.unknowns)
        durations = motion[-len(phases) :].tolist()
        rows = multipliers.reshape(-1, len(self.points.fractions), len(self.problem.sides))
        first = 0
        for q, (phase, duration) in enumerate(zip(phases, durations, strict=True)):
            end = first + len(phase.mesh)
            own, found = knots[first + q : end + q + 1], rows[first:end]
            yield replace(phase, knots=own, duration=duration, multipliers=found)
            first = end


def _usable(phase: Phase) -> Array:
    """Multipliers of a guess per share of what may be used of the limits, in one row; 0 where a row
    has no limit."""
    share = np.where(np.isfinite(phase.share), phase.share, 0.0)
    return (phase.multipliers * share[:, None]).ravel()


def _log(trace: Array, intervals: int, status: str) -> None:
    """Say what every iteration did, (iterations, ``_TRACED``), to whoever wants to know.

    A cost that is a duration is in the problem's unit of time, as a rule that of the straight line.
    """
    columns = "cost in the problem's unit, complementarity, shift, halvings"
    _LOG.debug("interior-point method on %d intervals: %s", intervals, columns)
    for number, (duration, left, shift, halvings) in enumerate(trace.tolist()):
        line = f"{number:4d}  {duration:.9f}  {left:9.2e}  {shift:9.2e}  {halvings:3.0f}"
        _LOG.debug("%s", line)
    _LOG.debug("%s", status)


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def interior_point(problem: PointProblem, points: IntervalPoints) -> CompiledMethod | None:
    """The method for a point problem; None without machine code."""
    if len(points.fractions) % LANES:
        return None
    built = library(source(problem, len(points.fractions)))
    if built is None:
        return None
    code = ctypes.CDLL(str(built))
    code.workspace.restype = ctypes.c_int64
    return CompiledMethod(code, problem, points)
