"""The flat formulation: the platform's motion and the torques are the only unknowns.

The position of the platform is a flat output of the fully actuated Delta: any smooth motion of it
determines the joint angles by inverse kinematics and the torques by inverse dynamics. So there are
neither differential equations to integrate nor redundant coordinates, only limits:

    minimise T (or a `Cost`)   subject to   Cᵀ (Q* + Q)(x, ẋ, ẍ, τ) = 0                     eq. (39)
                                            the rows of the scene's limits within their bounds

For Ipopt the torques are variables at every point: A(x)ᵀ τ = F is cheaper to differentiate than
its inverse, and Ipopt would add a slack variable for each inequality anyway. The interior-point
method eliminates them.

Variables are scaled by the scene: lengths by the distance from start to goal, time by the duration
of the first guess, torques by their limits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import NotConverged
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Motion, Trajectory
from deltaopt.planning.flat.equations import PointEquations, point_equations
from deltaopt.planning.flat.interior_point import (
    Boundary,
    CompiledMethod,
    InteriorPointSolution,
    Phase,
    Settings,
    interior_point,
)
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.phases import parts
from deltaopt.planning.nlp.problem import IPOPT_FINEST, Guess, InteriorPoint, Ipopt, Solved, Solver
from deltaopt.planning.nlp.program import (
    IpoptSolution,
    Layout,
    Options,
    Points,
    Program,
    RunningCost,
)
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
class Flat:
    """The formulation in the platform's coordinates alone, which is the default."""

    name: str = "flat"

    @property
    def solvers(self) -> tuple[type[Ipopt] | type[InteriorPoint], ...]:
        """Kinds of solver that can be asked for, the default first."""
        return InteriorPoint, Ipopt

    def of(
        self,
        functions: Functions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost = FASTEST,
        solver: Solver = _FAST,
    ) -> FlatEquations:
        """Its equations for a mechanism under limits."""
        return FlatEquations(point_equations(functions, constraints), transcription, cost, solver)


@dataclass(frozen=True)
class FlatEquations:
    """The equations of the flat problem, from which problems on meshes are made."""

    equations: PointEquations
    transcription: PiecewiseAcceleration
    cost: Cost = FASTEST
    solver: Solver = _FAST

    def on(self, mesh: Array) -> FlatProblem:
        """The problem on a mesh of interval lengths, (N,), fractions of the duration."""
        return FlatProblem(self.equations, self.transcription, mesh, self.cost, self.solver)


@dataclass(frozen=True)
class FlatProblem:
    """The flat problem on a mesh of interval lengths, (N,), fractions of the duration.

    Variables for Ipopt, in order, for every interval: X_i, V_i, A_i0 … A_id, then τ at each of its
    points; after all intervals X_N, V_N and T.
    """

    equations: PointEquations
    transcription: PiecewiseAcceleration
    mesh: Array
    cost: Cost = FASTEST
    solver: Solver = _FAST

    @property
    def constraints(self) -> Constraints:
        """The kinds of limit of the scenes that it can be solved for."""
        return self.equations.constraints

    @property
    def intervals(self) -> int:
        """The number N of intervals."""
        return len(self.mesh)

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits are imposed."""
        return self.transcription.points

    @property
    def finest(self) -> int:
        """Number of intervals of the finest mesh that is worth its solver's time."""
        return IPOPT_FINEST if self._interior_point is None else _FINEST

    @property
    def takes_phases(self) -> bool:
        """Whether its solver finds motions in phases."""
        return self._interior_point is not None

    @property
    def _motion_size(self) -> int:
        return 6 + 3 * len(self.transcription.nodes)

    @property
    def _block(self) -> int:
        return self._motion_size + 3 * len(self.transcription.points)

    @property
    def n_variables(self) -> int:
        """The number of variables for Ipopt."""
        return self.intervals * self._block + 7

    @cached_property
    def program(self) -> Program:
        """The nonlinear program for Ipopt, with the options that the planner uses."""
        return self.program_with({})

    def program_with(self, options: Options, ends: Ends | None = None) -> Program:
        """The nonlinear program for Ipopt, with other options.

        Its rows are the continuity of X and V, what ``ends`` that move ask for, and at every point
        eq. (39) and the limits that are not bounds on a single torque.
        """
        cost = np.zeros(self.n_variables)
        cost[-1] = self.cost.time
        sides = self.constraints.sides[self.equations.of_motion]
        lower = np.concatenate([np.zeros(3), np.where(sides[:, 0], -1.0, -np.inf)])
        upper = np.concatenate([np.zeros(3), np.where(sides[:, 1], 1.0, np.inf)])
        points = Points(self.equations.point_function, self._point_layout(), lower, upper)
        linear = self._continuity_layout()
        if ends is not None:
            linear = linear.joined(self._end_layout(ends))
        return Program(cost, linear, [points], options, self._running_cost())

    def _end_layout(self, ends: Ends) -> Layout:
        """Rows that are zero where V at an end that moves is T times its velocity, and X at a goal
        on a belt T times the belt's: the origin is where that goal is at the time 0."""
        start, goal = ends
        last = self.n_variables - 7
        given = [(3, start.state[1]), (last + 3, goal.state[1]), (last, goal.drift)]
        rows = [
            (first + k, float(rate[k])) for first, rate in given if rate.any() for k in range(3)
        ]
        columns = np.array([[column, self.n_variables - 1] for column, _ in rows], dtype=np.intp)
        return Layout(columns, np.array([[1.0, -rate] for _, rate in rows]))

    def _program_for(self, scaling: Scaling) -> Program:
        """The nonlinear program for Ipopt of a scene: one of its own where an end moves."""
        at_rest = scaling.problem.is_at_rest
        return self.program if at_rest else self.program_with({}, ends(scaling))

    def _running_cost(self) -> RunningCost | None:
        """The running cost ∫ r dt by Lobatto's rule at the nodes of every interval, if any."""
        if not self.cost.running:
            return None
        t, zero, y = self.transcription, np.zeros(1), self._point_layout()
        N, points = self.intervals, len(t.points)
        at = np.arange(N * points * 13).reshape(N, points, 13)
        at = at[:, np.searchsorted(t.points, t.nodes)]
        rows = np.append(at, at[:, :, -1:], axis=2).ravel()  # h: T, shared out by weights
        layout = Layout(y.columns[rows], y.weights[rows])
        quadrature = self.cost.running * self.mesh[:, None] * t.quadrature
        return RunningCost(
            Points(self.equations.running_cost, layout, zero, zero), quadrature.ravel()
        )

    def solve(self, guess: Guess, scaling: Scaling, parameters: Array) -> Solved:
        """Find the best motion on this mesh, by the compiled interior-point method by default.

        Ipopt solves it if it was asked for, if there is no C compiler, and, on coarse meshes from
        first motions, if the method does not converge. Raises NotConverged.
        """
        method = self._interior_point
        begins: tuple[Settings, ...] = _FROM_NEAR if guess.near else _FROM_FAR
        if guess.multipliers is not None:
            begins = ALMOST, *begins
        elif guess.on_its_mesh:
            begins = CLOSE, *begins
        for begin in begins:
            if method is None:
                break
            settings = replace(begin, tolerance=guess.tolerance, rows=guess.rows)
            given = guess if begin is ALMOST else replace(guess, multipliers=None)
            found = self._by_interior_point(method, given, scaling, parameters, settings)
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
        if method is not None and (self.intervals > _IPOPT_INSTEAD or sooner_else):
            raise NotConverged(
                f"the interior-point method does not converge on {self.intervals} intervals",
                "No_Progress",
                guess.trajectory,
            )
        if scaling.gates:
            raise NotConverged(
                "motions in phases are planned by the interior-point method alone, which "
                "does not converge here, or is not compiled",
                "No_Progress",
                guess.trajectory,
            )
        return self._by_ipopt(guess, scaling, parameters)

    def _by_interior_point(
        self,
        method: CompiledMethod,
        guess: Guess,
        scaling: Scaling,
        parameters: Array,
        settings: Settings,
    ) -> InteriorPointSolution:
        """Run the interior-point method from a guess."""
        if scaling.gates:
            return self._in_phases(method, guess, scaling, parameters, settings)
        knots, T = self._at_knots(guess.trajectory, scaling)
        shares = np.ascontiguousarray(scaling.shares(self.intervals))
        p, prices = scaling.parameters(parameters), guess.multipliers
        phase = Phase(
            self.mesh,
            p,
            shares,
            knots,
            T,
            duration_is_given=self.cost.duration_is_given,
            multipliers=None if prices is None else self._known(T, prices),
        )
        return method.solve([phase], ends(scaling), settings, self._weights)

    @property
    def _weights(self) -> tuple[float, float]:
        return self.cost.time, self.cost.running

    def _known(self, duration: float, prices: Array) -> Array:
        """Multipliers of a guess for the method, from those of `Solved`: fractions of a running
        cost, which the method itself knows, or in units of the duration."""
        return prices if self.cost.running else duration * prices

    def _in_phases(
        self,
        method: CompiledMethod,
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
        return method.solve(
            phases,
            [start, *between, goal],
            settings,
            self._weights,
            sum_is_given=self.cost.duration_is_given,
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

    @cached_property
    def _interior_point(self) -> CompiledMethod | None:
        """The compiled interior-point method; None where it does not apply or cannot be compiled.

        It is for motions of cubics: accelerations linear in every interval.
        """
        if self.transcription.degree != 1 or isinstance(self.solver, Ipopt):
            return None
        e = self.equations
        problem = e.point_problem_of_effort if self.cost.running else e.point_problem
        return interior_point(problem, tuple(self.transcription.points.tolist()))

    def _by_ipopt(self, guess: Guess, scaling: Scaling, parameters: Array) -> Solved:
        z, p = self.pack(guess.trajectory, scaling), scaling.parameters(parameters)
        program = self._program_for(scaling)
        share = scaling.shares_at(self.intervals, self.points).reshape(-1, self.constraints.number)
        of_motion = share[:, self.equations.of_motion]
        shares = np.hstack([np.ones((len(share), 3)), of_motion]).ravel()
        found = program.solve(z, *self.bounds(scaling), p, shares)
        return Solved(
            self.unpack(found.z, scaling),
            self.multipliers(found),
            found.status,
            found.iterations,
            found.spent,
            all_at_points=True,
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

    def pack(self, trajectory: Trajectory, scaling: Scaling) -> Array:
        """The variables that approximate a motion on this mesh, torques clipped to their limits."""
        T = trajectory.duration
        knots = T * np.concatenate([[0.0], np.cumsum(self.mesh)])
        at_knots = trajectory(knots)
        X = (at_knots.x - scaling.origin) / scaling.length
        V = at_knots.v * T / scaling.length
        A = self._inside(trajectory, self.transcription.nodes).a * T**2 / scaling.length
        A = self._continuous(X, V, A.reshape(self.intervals, -1, 3))
        tau = self._inside(trajectory, self.transcription.points).tau / scaling.torque
        N = self.intervals
        blocks = [X[:-1], V[:-1], A.reshape(N, -1), np.clip(tau, -1, 1).reshape(N, -1)]
        return np.concatenate([np.hstack(blocks).ravel(), X[-1], V[-1], [T / scaling.time]])

    def _continuous(self, X: Array, V: Array, A: Array) -> Array:
        """Accelerations A, (N, degree + 1, 3), changed least such that the motion is continuous.

        Otherwise the guess may leave the workspace shortly before a goal on its boundary.
        """
        position, velocity, _ = self.transcription.weights(1.0, self.mesh)
        weights = np.stack([position, velocity], axis=1)  # (N, 2, degree + 3)
        ends = np.stack([X[1:], V[1:]], axis=1)
        combined = np.concatenate([X[:-1, None], V[:-1, None], A], axis=1)
        return np.asarray(A + np.linalg.pinv(weights[..., 2:]) @ (ends - weights @ combined))

    def _inside(self, trajectory: Trajectory, c: Array) -> Motion:
        """The motion at fractions c of this mesh's intervals; at 0 and 1 just inside of them."""
        begin = np.concatenate([[0.0], np.cumsum(self.mesh)[:-1]])
        inside = np.clip(c, 1e-9, 1 - 1e-9)
        fractions = (begin[:, None] + self.mesh[:, None] * inside).ravel()
        return trajectory(trajectory.duration * fractions)

    def unpack(self, z: Array, scaling: Scaling) -> PiecewisePolynomial:
        """The motion that the variables describe, in m and s."""
        blocks = z[:-7].reshape(self.intervals, self._block)
        X, V = blocks[:, :3], blocks[:, 3:6]
        A = blocks[:, 6 : self._motion_size].reshape(self.intervals, -1, 3)
        coefficients = self.transcription.coefficients(X, V, A, self.mesh)
        return scaling.polynomial(self.mesh, coefficients, z[-1] * scaling.time)

    def bounds(self, scaling: Scaling) -> tuple[Array, Array]:
        """Bounds of the variables: start and goal, torques, and the duration."""
        upper = np.full(self.n_variables, np.inf)
        torques = scaling.shares(self.intervals)[:, None, self.constraints.is_control]
        shape = (self.intervals, len(self.points), 3)
        filled = np.broadcast_to(torques, shape).reshape(self.intervals, -1)
        upper[:-7].reshape(self.intervals, self._block)[:, self._motion_size :] = filled
        lower = -upper
        for where, end in zip((slice(0, 6), slice(-7, -1)), ends(scaling), strict=True):
            by_rows = np.repeat([end.drift.any(), end.state[1].any()], 3)
            free = end.free.ravel() | by_rows
            lower[where] = np.where(free, -np.inf, end.state.ravel())
            upper[where] = np.where(free, np.inf, end.state.ravel())
        lower[-1] = 1e-3
        if self.cost.duration_is_given:
            lower[-1] = upper[-1] = 1.0
        return lower, upper

    def multipliers(self, solution: IpoptSolution) -> Array:
        """Multipliers of the limits as of ``Solved``, (N, points, rows)."""
        N, points = self.intervals, len(self.points)
        found = np.empty((N, points, self.constraints.number))
        torque = solution.bound_multipliers[:-7].reshape(N, self._block)[:, self._motion_size :]
        found[:, :, self.constraints.is_control] = torque.reshape(N, points, 3)
        rows = 3 + len(self.equations.of_motion)
        nonlinear = solution.row_multipliers[-N * points * rows :]  # the linear ones come first
        of_motion = nonlinear.reshape(N, points, rows)[:, :, 3:]
        found[:, :, self.equations.of_motion] = of_motion
        return np.asarray(found / solution.z[-1])

    def _columns(self) -> NDArray[np.intp]:
        """Indices of the variables that determine each component in an interval, (N, 3,
        degree + 3)."""
        first = self._block * np.arange(self.intervals)[:, None, None]
        component = np.arange(3)[:, None]
        steps = 3 * np.arange(self.transcription.degree + 3)
        return np.asarray(first + component + steps, dtype=np.intp)

    def _point_layout(self) -> Layout:
        """The layout of y = (X, V, A, τ, T) at every point of every interval."""
        c, N, k = self.transcription.points, self.intervals, self.transcription.degree + 3
        weights = np.zeros((N, len(c), 13, k))
        columns = np.full((N, len(c), 13, k), self.n_variables - 1)
        for j, part in enumerate(self.transcription.weights(c, self.mesh[:, None])):
            weights[:, :, 3 * j : 3 * j + 3] = part[:, :, None]
            columns[:, :, 3 * j : 3 * j + 3] = self._columns()[:, None]
        weights[:, :, 9:, 0] = 1.0
        torques = self._motion_size + np.arange(3 * len(c)).reshape(-1, 3)
        columns[:, :, 9:12, 0] = self._block * np.arange(N)[:, None, None] + torques
        return Layout(columns.reshape(-1, k), weights.reshape(-1, k))

    def _continuity_layout(self) -> Layout:
        """The layout of continuity: X and V where an interval ends less those at the beginning of
        the next."""
        N, k = self.intervals, self.transcription.degree + 3
        weights = np.full((N, 2, 3, k + 1), -1.0)
        columns = np.zeros((N, 2, 3, k + 1), dtype=np.intp)
        for j, part in enumerate(self.transcription.weights(1.0, self.mesh)[:2]):
            weights[:, j, :, :k] = part[:, None]
            columns[:, j, :, :k] = self._columns()
            columns[:, j, :, k] = self._block * np.arange(1, N + 1)[:, None] + 3 * j + np.arange(3)
        return Layout(columns.reshape(-1, k + 1), weights.reshape(-1, k + 1))
