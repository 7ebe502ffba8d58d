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

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import NotConverged
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.flat.interior_point import (
    Boundary,
    CompiledMethod,
    InteriorPointSolution,
    Phase,
    Settings,
    interior_point,
)
from deltaopt.planning.nlp.cost import Cost
from deltaopt.planning.nlp.phases import parts
from deltaopt.planning.nlp.problem import Formulated, Guess, InteriorPoint, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.problem.boundary import Boundary as Asked

Array = NDArray[np.float64]

Ends = tuple[Boundary, Boundary]
_FAST = InteriorPoint()

FAR = Settings(barrier=0.2, closest=0.3)
NEAR = Settings(barrier=0.1, closest=0.01)
CLOSE = Settings(barrier=0.01, closest=0.001)
ALMOST = Settings(barrier=3e-4, closest=3e-4, iterations=12)
"""Barrier parameter and distance from the bounds where the interior-point method begins, from a
guess that is far from a solution, near one, one on this very mesh, or one but for limits that were
moved, whose multipliers are known. A larger barrier is safer, a smaller one saves iterations. From
the last one three iterations are usual, and after these twelve a motion that keeps its limits will
do."""
_FROM_FAR = (FAR, Settings(barrier=0.5, closest=0.6), Settings(barrier=3.0, closest=0.6))
_FROM_NEAR = (NEAR, Settings(barrier=3.0, closest=0.6), FAR)
"""Settings to begin with, in order. Where the method does not converge with the first, another
mostly does, in far less time than Ipopt, which comes last."""
_IPOPT_INSTEAD = 100
"""Number of intervals of the finest mesh that Ipopt is given where the method does not converge. On
finer ones another mesh or another first motion succeeds sooner; and where matrices are nearly
singular a single factorization of Ipopt's may take minutes."""
_FINEST = 4000
"""Number of intervals of the finest mesh that is solved by the interior-point method; its time is
proportional to the number."""


def boundary(asked: Asked, scaling: Scaling, accuracy: float = 0.0) -> Boundary:
    """A boundary of the problem in scaled units. A sphere is smaller by the share to which the
    solver meets its rows, its ``accuracy``, so that it is not left."""
    in_sphere = asked.within > 0
    free = np.array([[each or in_sphere for each in asked.free], [asked.is_passed] * 3])
    place = scaling.place(asked.position)
    state = np.array([np.where(asked.free, 0.0, place), scaling.velocity(asked.velocity)])
    radius = asked.within / scaling.length * (1 - accuracy)
    return Boundary(state, free, scaling.velocity(asked.belt), radius)


def ends(scaling: Scaling) -> Ends:
    """Where the motion begins and ends, in scaled units."""
    return boundary(scaling.problem.start, scaling), boundary(scaling.problem.goal, scaling)


@dataclass(frozen=True)
class FlatEquations:
    """The equations of the flat problem, compiled, from which problems on meshes are made.

    ``by_ipopt``: the same problem for Ipopt, which is tried where the method does not converge.
    """

    method: CompiledMethod
    transcription: PiecewiseAcceleration
    cost: Cost
    by_ipopt: Formulated

    def on(self, mesh: Array) -> FlatProblem:
        """The problem on a mesh of interval lengths, (N,), fractions of the duration."""
        return FlatProblem(self, mesh)


def compiled_flat(
    equations: PointEquations,
    transcription: PiecewiseAcceleration,
    cost: Cost,
    by_ipopt: Formulated,
) -> FlatEquations | None:
    """The equations with the interior-point method compiled for them; None where it cannot be."""
    e = equations
    problem = e.point_problem_of_effort if cost.running else e.point_problem
    method = interior_point(problem, tuple(transcription.points.tolist()))
    return None if method is None else FlatEquations(method, transcription, cost, by_ipopt)


@dataclass(frozen=True)
class FlatProblem:
    """The flat problem on a mesh of interval lengths, (N,), fractions of the duration."""

    equations: FlatEquations
    mesh: Array

    @property
    def intervals(self) -> int:
        """The number N of intervals."""
        return len(self.mesh)

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits are imposed."""
        return self.equations.transcription.points

    @property
    def finest(self) -> int:
        """Number of intervals of the finest mesh that is worth its solver's time."""
        return _FINEST

    @property
    def takes_phases(self) -> bool:
        """Whether its solver finds motions in phases."""
        return True

    def solve(self, guess: Guess, scaling: Scaling, parameters: Array) -> Solved:
        """Find the best motion on this mesh, by the compiled interior-point method.

        On coarse meshes, from first motions, Ipopt solves it where the method does not converge.
        Raises NotConverged.
        """
        begins: tuple[Settings, ...] = _FROM_NEAR if guess.near else _FROM_FAR
        if guess.multipliers is not None:
            begins = ALMOST, *begins
        elif guess.on_its_mesh:
            begins = CLOSE, *begins
        for begin in begins:
            settings = replace(begin, tolerance=guess.tolerance, rows=guess.rows)
            given = guess if begin is ALMOST else replace(guess, multipliers=None)
            found = self._by_interior_point(given, scaling, parameters, settings)
            if found.solved and len(found.phases) > 1:
                return self._of_phases(found, scaling, settings.row_tolerance)
            if found.solved:
                (phase,) = found.phases
                return Solved(
                    self._cubics(phase.knots, phase.duration, scaling),
                    phase.multipliers / found.cost,
                    found.status,
                    found.iterations,
                    found.spent,
                    all_at_points=True,
                    left=found.left,
                )
        sooner_else = guess.near or guess.is_trial  # on another mesh, or from another motion
        if self.intervals > _IPOPT_INSTEAD or sooner_else:
            raise NotConverged(
                f"the interior-point method does not converge on {self.intervals} intervals",
                "No_Progress",
                guess.trajectory,
            )
        if scaling.gates:
            raise NotConverged(
                "motions in phases are planned by the interior-point method alone, which "
                "does not converge here",
                "No_Progress",
                guess.trajectory,
            )
        return self.equations.by_ipopt.on(self.mesh).solve(guess, scaling, parameters)

    def _by_interior_point(
        self,
        guess: Guess,
        scaling: Scaling,
        parameters: Array,
        settings: Settings,
    ) -> InteriorPointSolution:
        """Run the interior-point method from a guess."""
        if scaling.gates:
            return self._in_phases(guess, scaling, parameters, settings)
        knots, T = self._at_knots(guess.trajectory, scaling)
        shares = np.ascontiguousarray(scaling.shares(self.intervals))
        p, prices = scaling.parameters(parameters), guess.multipliers
        phase = Phase(
            self.mesh,
            p,
            shares,
            knots,
            T,
            duration_is_given=self.equations.cost.duration_is_given,
            multipliers=None if prices is None else self._known(T, prices),
        )
        return self.equations.method.solve([phase], ends(scaling), settings, self._weights)

    @property
    def _weights(self) -> tuple[float, float]:
        return self.equations.cost.time, self.equations.cost.running

    def _known(self, duration: float, prices: Array) -> Array:
        """Multipliers of a guess for the method, from those of `Solved`: fractions of a running
        cost, which the method itself knows, or in units of the duration."""
        return prices if self.equations.cost.running else duration * prices

    def _in_phases(
        self,
        guess: Guess,
        scaling: Scaling,
        parameters: Array,
        settings: Settings,
    ) -> InteriorPointSolution:
        """Run the interior-point method from a guess, in a phase from each gate to the next.

        Each phase has a duration of its own; position and velocity are continuous between them.
        """
        motion = guess.trajectory
        shares, prices = scaling.shares(self.intervals), guess.multipliers
        first, last = motion.knots[[0, -1]]
        instants = np.array([first, *scaling.passes(motion), last])
        passed = (instants[1:-1] - first) / motion.duration
        phases = []
        for own, (begin, end), p in zip(
            parts(self.mesh, passed),
            pairwise(instants.tolist()),
            scaling.parameters_in_phases(parameters),
            strict=True,
        ):
            T, mesh = end - begin, self.mesh[own] / self.mesh[own].sum()
            times = begin + T * np.concatenate([[0.0], np.cumsum(mesh)])
            knots = scaling.states(motion.position, times, T)
            share = np.ascontiguousarray(shares[own])
            total = motion.duration / scaling.time
            known = None if prices is None else self._known(total, prices[own])
            phases.append(Phase(mesh, p, share, knots, T / scaling.time, multipliers=known))
        between = (boundary(gate, scaling, settings.row_tolerance) for gate in scaling.gates)
        start, goal = ends(scaling)
        return self.equations.method.solve(
            phases,
            [start, *between, goal],
            settings,
            self._weights,
            sum_is_given=self.equations.cost.duration_is_given,
        )

    def _of_phases(self, found: InteriorPointSolution, scaling: Scaling, accuracy: float) -> Solved:
        """The solution in phases as one motion on a mesh, whose fractions have changed."""
        smaller_spheres = 2 * accuracy * found.sphere_multipliers.sum()  # what they cost
        total = sum(phase.duration for phase in found.phases)
        start = found.phases[0]
        times, places = [np.zeros(1)], [start.knots[:1, :3]]
        rates = [start.knots[:1, 3:] / start.duration]
        begin, first = 0.0, 0
        for phase in found.phases:
            own = self.mesh[first : first + len(phase.knots) - 1]
            times.append(begin + phase.duration * np.cumsum(own) / own.sum())
            places.append(phase.knots[1:, :3])
            rates.append(phase.knots[1:, 3:] / phase.duration)
            begin, first = begin + phase.duration, first + len(own)
        knots = np.concatenate(times)
        position = PiecewisePolynomial.hermite(
            scaling.time * knots,
            scaling.origin + scaling.length * np.vstack(places),
            scaling.length / scaling.time * np.vstack(rates),
        )
        multipliers = np.concatenate([phase.multipliers for phase in found.phases])
        return Solved(
            position,
            multipliers / found.cost,
            found.status,
            found.iterations,
            found.spent,
            all_at_points=True,
            left=found.left + smaller_spheres / found.cost,
            mesh=np.diff(knots) / total,
        )

    def _at_knots(self, guess: Trajectory, scaling: Scaling) -> tuple[Array, float]:
        """Scaled X and V of a guess at the knots, (N + 1, 6), and its scaled duration."""
        T = guess.duration
        times = T * np.concatenate([[0.0], np.cumsum(self.mesh)])
        return scaling.states(guess.position, times, T), T / scaling.time

    def _cubics(self, knots: Array, duration: float, scaling: Scaling) -> PiecewisePolynomial:
        """The motion of cubics between scaled (X, V) at the knots, (N + 1, 6), in m and s."""
        T = duration * scaling.time
        x = scaling.origin + scaling.length * knots[:, :3]
        v = scaling.length / T * knots[:, 3:]
        return PiecewisePolynomial.hermite(T * np.append(0.0, np.cumsum(self.mesh)), x, v)
