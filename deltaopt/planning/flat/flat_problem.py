"""The flat formulation: the platform's motion and the torques are the only unknowns.

The position of the platform is a flat output of the fully actuated Delta: any smooth motion of it
determines the joint angles by inverse kinematics and the torques by inverse dynamics. So there are
neither differential equations to integrate nor redundant coordinates, only limits:

    minimise T (or a `Cost`)   subject to   Cᵀ (Q* + Q)(x, ẋ, ẍ, τ) = 0                     eq. (39)
                                            the rows of the scene's limits within their bounds

The interior-point method eliminates the torques; for Ipopt (`formulations`) they are variables at
every point, for A(x)ᵀ τ = F is cheaper to differentiate than its inverse, and Ipopt would add a
slack variable for each inequality anyway.

Variables are scaled by the scene: lengths by the distance from start to goal, time by the duration
of the first guess, torques by their limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise
from typing import ClassVar

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import NotConverged
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.flat.interior_point import (
    AT_BOTH_ENDS,
    OF_ACCELERATION,
    OF_JERK,
    CompiledMethod,
    InteriorPointSolution,
    IntervalPoints,
    Phase,
    PhaseBoundary,
    Settings,
    interior_point,
)
from deltaopt.planning.nlp.phases import joined, parts
from deltaopt.planning.nlp.problem import Cost, Guess, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.problem.boundary import Boundary

FAR = Settings(barrier=0.2, closest=0.3)
NEAR = Settings(barrier=0.1, closest=0.01)
TRIAL = Settings(barrier=3.0, closest=0.1)
CLOSE = Settings(barrier=0.01, closest=0.001)
ALMOST = Settings(barrier=3e-4, closest=3e-4, iterations=12)
"""Barrier parameter and distance from the bounds where the interior-point method begins, from a
guess that is far from a solution, near one, past bodies but perhaps far, one on this very mesh, or
one but for limits that were moved, whose multipliers are known. A larger barrier is safer, a
smaller one saves iterations. From the last one three iterations are usual, and after these twelve
a motion that keeps its limits will do."""
_SAFEST = Settings(barrier=3.0, closest=0.6)
"""Far from all bounds, whatever the guess."""
_FROM_FAR = (FAR, Settings(barrier=0.5, closest=0.6), replace(_SAFEST, iterations=200))
_FROM_NEAR = (NEAR, _SAFEST)
_FOR_TRIAL = (TRIAL, _SAFEST, NEAR)
"""Settings to begin with, in order. Of 264 meshes on which ways past boxes and shelves were told
apart the first solves 233 from near. Begun as trials as many of them are solved, but from rest to
rest motions leave the side of a body: on a line of 200 problems past a sphere 8 steps were flips,
not 2. Where an end moves, ways are farther off: as trials such a line has 1 flip, not 17. Where the
method does not converge with the first, another mostly does, but near a guess: there the second
ends one solve in seven, and a third one in fifty of the rest. From far away the last has time:
where motions are slow and motors strong, as those of a massless robot at the edge of its workspace,
first meshes take 60 to 200 iterations."""
_CREEPING = 180
"""Iterations from a near guess where Coulomb friction is softer: reversals drift along a flat
valley. Other beginnings would creep through it once more, from farther away."""
_ALONG_A_VALLEY = 8000
"""Iterations from a guess of little effort, a far one where the duration is free: motions that wait
where little torque holds the arms are reached along a curved valley. Of 88 motions in 1.2 to 11.5
times the fastest one's duration 15 cost 1.9 to 5.6 times as much with 60, for the method then found
another motion, and with 2000 some that took 5000 cost up to three times as much."""
_EXACT, _SMOOTH = 1e-4, 0.05
"""Relative tolerance from which on the fastest motion is to be smooth where many are about as fast,
and how much that counts, as a share of the tolerance. With less the method creeps along the valley
in which they lie, and every mesh ends at another motion. What it costs is part of the gap."""


def boundary(asked: Boundary, scaling: Scaling, accuracy: float = 0.0) -> PhaseBoundary:
    """A boundary of the problem in scaled units. A sphere is smaller by the share to which the
    solver meets its rows, its ``accuracy``, so that it is not left."""
    in_sphere = asked.within > 0
    place = [each or in_sphere for each in asked.free]
    order = scaling.constraints.order
    free = np.array([place, *[[asked.is_passed] * 3] * (order - 1)])
    state = np.array(
        [
            np.where(asked.free, 0.0, scaling.place(asked.position)),
            scaling.rate(asked.velocity, 1),
            scaling.rate(asked.acceleration, 2),
        ][:order]
    )
    radius = asked.within / scaling.length * (1 - accuracy)
    return PhaseBoundary(state, free, scaling.rate(asked.belt, 1), radius)


def compiled_flat(
    equations: PointEquations, transcription: PiecewiseAcceleration, cost: Cost
) -> Callable[[Array], FlatProblem] | None:
    """The problem on a mesh of interval lengths, (N,), fractions of the duration, with the
    interior-point method compiled for its equations; None where it cannot be."""
    alike = Cost(running=float(cost.running != 0), rate=cost.rate)
    method = _method(equations, transcription, alike)
    return None if method is None else partial(FlatProblem, method, transcription, cost)


@lru_cache(maxsize=64)
def _method(
    equations: PointEquations, transcription: PiecewiseAcceleration, cost: Cost
) -> CompiledMethod | None:
    """The method for all costs that differ in their weights alone, written out once in a
    process."""
    problem = equations.point_problem(cost)
    points = IntervalPoints.of(transcription.points.tolist())
    if problem.derivatives == 3:
        points = OF_JERK if cost.rate.order == 3 else OF_ACCELERATION
        if equations.rates_peak:
            points = AT_BOTH_ENDS
    return interior_point(problem, points)


_DIGITS = 9
"""Decimals of places in thirds: thirds are no binary fractions."""


class _EndsOfThirds:
    """How multipliers at the points of an interval add up to those at both ends of each third:
    weights, (3, 2, points) each. ``one_sided``: of rows that jump from one third to the next.
    ``shared``: of rows that do not, which both thirds share. ``back``: from ends to points."""

    def __init__(self, points: IntervalPoints) -> None:
        """Those of some points; one inside a third belongs to both of its ends."""
        thirds = np.array(points.thirds)
        place = (3 * np.array(points.fractions) - thirds).round(_DIGITS)  # in its third, 0 to 1
        of_third = np.arange(3)[:, None, None] == thirds
        self.one_sided = np.where(of_third, np.array([1 - place, place]), 0.0)
        self.shared = self.one_sided.copy()
        for before in (0, 1):
            both = self.one_sided[before, 1] + self.one_sided[before + 1, 0]
            self.shared[before, 1] = self.shared[before + 1, 0] = both / 2
        own = self.one_sided == 1
        self.back = np.where(own.any(axis=2, keepdims=True), own, self.shared > 0).astype(float)


_ends_of_thirds = lru_cache(maxsize=8)(_EndsOfThirds)
"""Of all meshes with the same points."""


@dataclass(frozen=True)
class FlatProblem:
    """The flat problem on a mesh of interval lengths, (N,), fractions of the duration.

    Where acceleration is continuous, three intervals of equal length after each other are the
    thirds of an interval of the interior-point method.
    """

    method: CompiledMethod
    transcription: PiecewiseAcceleration
    cost: Cost
    mesh: Array
    finest: ClassVar[int] = 4000
    """Number of intervals of the finest mesh that is solved: time is proportional to it."""
    takes_phases: ClassVar[bool] = True

    @property
    def together(self) -> int:
        """How many intervals of the mesh are one of the method: the thirds of its cubics."""
        return 3 if self.method.problem.derivatives == 3 else 1

    @property
    def ends(self) -> _EndsOfThirds:
        """What multipliers at the method's points are at the ends of thirds."""
        return _ends_of_thirds(self.method.points)

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits are imposed."""
        return self.transcription.points if self.together == 1 else np.array([0.0, 1.0])

    def solve(self, guess: Guess, scaling: Scaling) -> Solved:
        """Find the best motion on this mesh, by the compiled interior-point method.

        Raises NotConverged: another mesh or another first motion mostly leads to a plan then, and
        sooner than another solver on this one would.
        """
        problem, cost, begins = scaling.problem, self.cost, self._settings(guess, scaling)
        accuracy = begins[0].row_tolerance
        start, goal = boundary(problem.start, scaling), boundary(problem.goal, scaling)
        between = [boundary(gate, scaling, accuracy) for gate in scaling.gates]
        for settings in begins:
            phases = self._phases(guess, scaling)
            found = self.method.solve(
                phases,
                [start, *between, goal],
                settings,
                (cost.time, cost.running),
                sum_is_given=cost.duration_is_given and len(phases) > 1,
            )
            if found.solved:
                return self._solved(found, scaling, accuracy)
            if found.iterations >= _CREEPING:
                break
            guess = replace(guess, multipliers=None)
        raise NotConverged(
            f"the interior-point method does not converge on {len(self.mesh)} intervals",
            "No_Progress",
            guess.trajectory,
        )

    def _settings(self, guess: Guess, scaling: Scaling) -> list[Settings]:
        """The settings to begin with from a guess, one after the other until one leads to a
        solution. Multipliers that are known are for the first."""
        begins: tuple[Settings, ...] = _FROM_NEAR if guess.near else _FROM_FAR
        if guess.is_trial and not scaling.problem.is_at_rest:
            begins = _FOR_TRIAL
        elif self.cost.duration_is_given or (self.cost.running and not guess.near):
            begins = replace(begins[0], iterations=_ALONG_A_VALLEY), *begins[1:]
        elif guess.near and scaling.softening is not None:
            begins = replace(NEAR, iterations=_CREEPING), *_FROM_NEAR[1:]
        if guess.multipliers is not None:
            begins = ALMOST, *begins
        elif guess.on_its_mesh:
            begins = CLOSE, *begins
        exact = guess.tolerance <= _EXACT and not self.cost.running and scaling.faces is None
        smooth = _SMOOTH * guess.tolerance if exact else 0.0
        asked = partial(replace, tolerance=guess.tolerance, rows=guess.rows, smooth=smooth)
        return [asked(each) for each in begins]

    def _phases(self, guess: Guess, scaling: Scaling) -> list[Phase]:
        """A guess for the interior-point method, in a phase from each gate to the next.

        Each phase has a duration of its own; position and velocity are continuous between them.
        """
        motion, cost = guess.trajectory, self.cost
        mesh, prices = self.mesh, guess.multipliers
        unused = scaling.constraints.convex & np.isneginf(scaling.limits.bounds[0])
        shares = np.where(unused, np.inf, scaling.shares(len(self.mesh)))
        total = motion.duration / scaling.time
        if self.together > 1:
            mesh = joined(mesh, self.together)
            shares = shares.reshape(len(mesh), self.together, -1).min(axis=1)
        known = np.empty(0) if prices is None else self._known(total, prices)
        soft = _widths(motion, scaling, mesh)
        if not scaling.gates:
            p = scaling.parameters
            states = self._states(motion, scaling, 0.0, motion.duration, mesh)
            return [Phase(mesh, p, shares, states, total, cost.duration_is_given, known, soft)]
        instants, phases = scaling.instants(motion), []
        for own, (begin, end), p in zip(
            parts(mesh, (instants[1:-1] - instants[0]) / motion.duration),
            pairwise(instants.tolist()),
            scaling.parameters_in_phases,
            strict=True,
        ):
            T, lengths = end - begin, mesh[own] / mesh[own].sum()
            states, time = self._states(motion, scaling, begin, T, lengths), T / scaling.time
            phases.append(
                Phase(lengths, p, shares[own], states, time, multipliers=known[own], own=soft[own])
            )
        return phases

    def _states(
        self, motion: Trajectory, scaling: Scaling, begin: float, T: float, mesh: Array
    ) -> Array:
        """Scaled states of a motion at the knots of a phase that begins and lasts so long, s."""
        times = begin + T * np.concatenate([[0.0], mesh.cumsum()])
        return scaling.states(motion.position, times, T, self.method.problem.derivatives)

    def _known(self, duration: float, prices: Array) -> Array:
        """Multipliers of a guess for the method, from those of `Solved`: fractions of a running
        cost, which the method itself knows, or in units of the duration."""
        if self.together == 1:
            return prices if self.cost.running else duration * prices
        of_thirds = prices.reshape(-1, 3, 2, prices.shape[2])
        return np.asarray(np.einsum("tep,ntem->npm", self.ends.back, of_thirds))

    def _solved(self, found: InteriorPointSolution, scaling: Scaling, accuracy: float) -> Solved:
        """The solution as one motion, on a mesh whose fractions phases have changed."""
        smaller_spheres = 2 * accuracy * found.sphere_multipliers.sum()  # what they cost
        times, states = [np.zeros(1)], list[Array]()
        is_one = len(found.phases) == 1
        own = found.phases[0].duration if is_one else 1.0  # a motion's own unit of time
        for phase in found.phases:
            begin, T = times[-1][-1], phase.duration / own
            times.append(begin + T * phase.mesh.cumsum())
            knots = phase.knots.reshape(len(phase.knots), -1, 3)
            knots = knots / T ** np.arange(self.method.problem.derivatives)[:, None]
            states.append(knots[1:] if states else knots)
        knots = np.concatenate(times)
        time = own * scaling.time
        units = scaling.length / time ** np.arange(self.method.problem.derivatives)
        x, *rates = (units[:, None] * np.concatenate(states)).transpose(1, 0, 2)
        curve = PiecewisePolynomial.in_thirds if self.together > 1 else PiecewisePolynomial.hermite
        position = curve(time * knots, scaling.origin + x, *rates)
        multipliers = np.concatenate([phase.multipliers for phase in found.phases])
        return Solved(
            position,
            self._of_intervals(multipliers, scaling) / found.cost,
            found.status,
            found.iterations,
            all_at_points=True,
            left=float(found.left + smaller_spheres / found.cost),
            widths=np.concatenate([phase.own for phase in found.phases]).repeat(
                self.together, axis=0
            ),
            mesh=None if is_one else np.diff(position.knots) / position.knots[-1],
        )

    def _of_intervals(self, multipliers: Array, scaling: Scaling) -> Array:
        """Multipliers at the points of intervals, (N, points, rows), from those of the method."""
        if self.together == 1:
            return multipliers
        jumps = scaling.constraints.orders == 3
        ends = self.ends
        shared = np.einsum("tep,npm->ntem", ends.shared, multipliers)
        one_sided = np.einsum("tep,npm->ntem", ends.one_sided, multipliers)
        found: Array = np.where(jumps, one_sided, shared)
        return found.reshape(-1, 2, multipliers.shape[2])


def _widths(motion: Trajectory, scaling: Scaling, mesh: Array) -> Array:
    """As of `Softening`: 0 for friction as it is, and of no motor without any."""
    if scaling.softening is not None:
        return scaling.softening.widths(motion, mesh)
    return np.zeros((len(mesh), scaling.constraints.motors * bool(scaling.problem.model.layers)))
