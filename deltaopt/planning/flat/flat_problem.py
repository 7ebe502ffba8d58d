"""The flat problem: the platform's motion and the torques are the only unknowns.

The position of the platform is a flat output of the fully actuated Delta: any smooth motion
of it has joint angles by inverse kinematics and torques by inverse dynamics. So there are no
dynamics to integrate and no redundant coordinates, only limits:

    minimise T (or a `Cost`)   subject to   Cᵀ (Q* + Q)(x, ẋ, ẍ, τ) = 0                     eq. (39)
                              |τ_k| ≤ τ_max,   |θ̇_k(x, ẋ)| ≤ ω_max if there is one
                              sin² (q_{k,1} − q_{k,2})(x) ≥ a margin

The last keeps the motion inside its assembly mode: at the serial singularities, where a chain
folds or stretches, x no longer says where the elbow is, and many a fastest motion would go
there (see ``scales``).

The torques stay variables at every point, since A(x)ᵀ τ = F is cheaper than its inverse and
the slack of an inequality in Ipopt is a variable anyway.

Variables are scaled by the scene: lengths by the distance D from start to goal, time by the
baseline's duration, torques and speeds by their limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import Motion, PiecewisePolynomial, Trajectory
from deltaopt.planning.flat.interior_point import (
    Boundary,
    InteriorPoint,
    InteriorPointSolution,
    Phase,
    Settings,
    interior_point,
)
from deltaopt.planning.flat.point_problem import PointProblem, Sides
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import IPOPT_FINEST, Guess, Solved, solved_by_ipopt
from deltaopt.planning.nlp.program import (
    Layout,
    Options,
    PointFunction,
    Points,
    Program,
    RunningCost,
    Solution,
)
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

Array = NDArray[np.float64]

FAR = Settings(barrier=0.2, closest=0.3)
NEAR = Settings(barrier=0.1, closest=0.01)
"""How the interior-point method begins, from a guess that is far from or near a solution."""
_FROM_FAR = (FAR, Settings(barrier=0.5, closest=0.6), Settings(barrier=3.0, closest=0.6))
_FROM_NEAR = (NEAR, Settings(barrier=3.0, closest=0.6), FAR)
"""Where it does not get through from there, another beginning mostly does, far sooner than
Ipopt, which comes last."""
_FINEST = 4000
"""Intervals of the finest mesh that is worth its time by the interior-point method."""


@dataclass(frozen=True)
class ScaledEquations:
    """The equations at a point as expressions in scaled variables, each of the order of one.

    ``y``: X - x_start, V, A in units of D; τ in units of its limits; T in units of the
    baseline's duration, 13. ``p``: ``Scales.vector``, then the mechanism's parameters.
    ``force``: eq. (39) in units of the largest torque at the elbow, 3. ``opening``: how far
    the chains are from the margin of their fold, 3. ``speed`` and ``acceleration``: θ̇ in units
    of its limit and its derivative in units of limit / T, 3, or None where speed is unlimited.
    ``rate``: of the running cost, 1; for a robot its effort τᵀτ, N²m².
    """

    y: ca.SX
    p: ca.SX
    force: ca.SX
    opening: ca.SX
    speed: ca.SX | None
    acceleration: ca.SX | None
    rate: ca.SX = field(default_factory=lambda: ca.SX(0))

    @classmethod
    def of(cls, functions: DeltaFunctions, *, speed: bool) -> ScaledEquations:
        """For a mechanism; ``speed``: whether motor speeds are limited."""
        terms = functions.terms.symbols()
        y, scales = ca.SX.sym("y", 13), ca.SX.sym("scales", 12 if speed else 9)
        origin, length, time, torque = scales[:3], scales[3], scales[4], scales[5:8]
        T = time * y[12]
        x, v, a = origin + length * y[:3], length * y[3:6] / T, length * y[6:9] / T**2
        force, opening, dtheta, ddtheta = functions.explicit_equations(
            x, v, a, torque * y[9:12], terms.vector()
        )
        return cls(
            y=y,
            p=ca.vertcat(scales, terms.vector()),
            force=force * 2 * terms.a2 / ca.mmax(torque),
            opening=opening - scales[8],
            speed=dtheta / scales[9:12] if speed else None,
            acceleration=ddtheta * T / scales[9:12] if speed else None,
            rate=ca.sumsqr(torque * y[9:12]),
        )

    def point_function(self, *rows: ca.SX | None) -> PointFunction:
        """Those of the rows that there are."""
        present = [row for row in rows if row is not None]
        function = ca.Function("motion", [self.y, self.p], [ca.vertcat(*present)])
        return PointFunction("motion", function)

    @property
    def motion(self) -> PointFunction:
        """Rows of the flat problem at a point: force, opening, and speed if it is limited."""
        return self.point_function(self.force, self.opening, self.speed)

    @property
    def running_cost(self) -> PointFunction:
        """(y, h), p -> h r: what the rate r costs over a time h in the baseline's duration."""
        h = ca.SX.sym("h")
        function = ca.Function("running", [ca.vertcat(self.y, h), self.p], [h * self.rate])
        return PointFunction("running cost", function)


@lru_cache(maxsize=8)
def equations(functions: DeltaFunctions, *, speed: bool) -> PointFunction:
    """``ScaledEquations.motion`` of a mechanism."""
    return ScaledEquations.of(functions, speed=speed).motion


@dataclass(frozen=True)
class Flat:
    """Minimal coordinates: the default.

    ``from_far``, ``from_near``: how the interior-point method begins from a first guess and from
    the solution of a similar problem; the next where it does not get through from one.
    """

    name: str = "flat"
    from_far: tuple[Settings, ...] = _FROM_FAR
    from_near: tuple[Settings, ...] = _FROM_NEAR

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        *,
        speed: bool,
        cost: Cost = FASTEST,
    ) -> FlatEquations:
        running = None
        if cost.running:
            running = ScaledEquations.of(functions, speed=speed).running_cost
        rows = equations(functions, speed=speed)
        return FlatEquations(rows, transcription, cost, running, self)


@dataclass(frozen=True)
class FlatEquations:
    """The flat problem's equations at a point, to be put on a mesh.

    ``running``: (X, V, A, τ, T, h), p -> what a running cost adds in a time h, if there is one.
    """

    equations: PointFunction
    transcription: PiecewiseAcceleration
    cost: Cost = FASTEST
    running: PointFunction | None = None
    pose: Flat = Flat()

    def on(self, mesh: Array) -> FlatProblem:
        return FlatProblem(
            self.equations, self.transcription, mesh, self.cost, self.running, self.pose
        )


@lru_cache(maxsize=16)
def _method(equations: PointFunction, points: tuple[float, ...]) -> InteriorPoint | None:
    """The interior-point method for the rows of ``ScaledEquations.motion``.

    An opening, a squared sine less its margin, is at least 0 and at most 1: 1 less it has limits
    on both sides like all other rows.
    """
    y, tau = ca.SX.sym("y", 10), ca.SX.sym("tau", 3)
    p = ca.SX.sym("p", equations.function.size1_in(1))
    r = equations.function(ca.vertcat(y[:9], tau, y[9]), p)
    rows = ca.vertcat(tau, 1 - r[3:6], r[6:])
    sides = (Sides.BOTH,) * rows.numel()
    problem = PointProblem(
        coordinates=3, derivatives=2, y=y, tau=tau, p=p, force=r[:3], rows=rows, sides=sides
    )
    return interior_point(problem, points)


@dataclass(frozen=True)
class FlatProblem:
    """The flat problem on a mesh of interval fractions (N,), ready to be solved for scenes.

    Variables: for every interval X_i, V_i, A_i0 … A_id, then τ at each of its points; last
    X_N, V_N and T.
    """

    equations: PointFunction
    transcription: PiecewiseAcceleration
    mesh: Array
    cost: Cost = FASTEST
    running: PointFunction | None = None
    pose: Flat = Flat()

    @property
    def intervals(self) -> int:
        return len(self.mesh)

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits hold."""
        return self.transcription.points

    @property
    def finest(self) -> int:
        """Intervals of the finest mesh that is worth its time."""
        return IPOPT_FINEST if self._interior_point is None else _FINEST

    @property
    def _motion_size(self) -> int:
        return 6 + 3 * len(self.transcription.nodes)

    @property
    def _block(self) -> int:
        return self._motion_size + 3 * len(self.transcription.points)

    @property
    def n_variables(self) -> int:
        return self.intervals * self._block + 7

    @cached_property
    def program(self) -> Program:
        """For Ipopt with the planner's options."""
        return self.program_with({})

    def program_with(self, options: Options) -> Program:
        """Rows: continuity of X and V; at every point eq. (39), openings, limited speeds."""
        cost = np.zeros(self.n_variables)
        cost[-1] = self.cost.time
        speeds = np.ones(self.equations.function.size1_out(0) - 6)
        lower = np.concatenate([np.zeros(6), -speeds])
        upper = np.concatenate([np.zeros(3), np.full(3, np.inf), speeds])
        points = Points(self.equations, self._point_layout(), lower, upper)
        return Program(cost, self._continuity_layout(), [points], options, self._running_cost())

    def _running_cost(self) -> RunningCost | None:
        """∫ r dt by Lobatto's rule at the nodes of every interval."""
        if self.running is None:
            return None
        t, zero, y = self.transcription, np.zeros(1), self._point_layout()
        N, points = self.intervals, len(t.points)
        at = np.arange(N * points * 13).reshape(N, points, 13)
        at = at[:, np.searchsorted(t.points, t.nodes)]
        rows = np.append(at, at[:, :, -1:], axis=2).ravel()  # h: T, shared out by weights
        layout = Layout(y.columns[rows], y.weights[rows])
        quadrature = self.cost.running * self.mesh[:, None] * t.quadrature
        return RunningCost(Points(self.running, layout, zero, zero), quadrature.ravel())

    def solve(self, guess: Guess, scales: Scales, parameters: Array) -> Solved:
        """By the interior-point method in machine code; by Ipopt where that does not do."""
        for begin in self.pose.from_near if guess.near else self.pose.from_far:
            settings = replace(begin, tolerance=guess.tolerance)
            found = self.from_inside(guess, scales, parameters, settings)
            if found is not None and found.solved:
                (phase,) = found.phases
                prices = phase.multipliers / phase.duration
                return Solved(
                    self._cubics(phase.knots, phase.duration, scales),
                    np.delete(prices, np.s_[3:6], axis=2),
                    found.status,
                    found.iterations,
                    found.spent,
                    left=found.left,
                    opening_prices=prices[:, :, 3:6],
                )
        if guess.near and IPOPT_FINEST < self.intervals <= self.finest:  # Ipopt takes minutes
            raise NotConverged(
                f"the interior-point method does not converge on {self.intervals} intervals",
                "No_Progress",
                guess.trajectory,
            )
        return solved_by_ipopt(self, self.program, guess, scales, parameters)

    def from_inside(
        self, guess: Guess, scales: Scales, parameters: Array, settings: Settings
    ) -> InteriorPointSolution | None:
        """By the interior-point method; None where there is no machine code for it."""
        method = self._interior_point
        if method is None:
            return None
        p = np.concatenate([scales.whole.vector(), parameters])
        rows = len(method.problem.sides)
        shares, share = scales.shares(self.intervals), np.ones((self.intervals, rows))
        share[:, :3], share[:, 6:] = shares[:, :3], shares[:, 3 : rows - 3]
        knots, T = self._at_knots(guess.trajectory, scales)
        phase = Phase(self.mesh, p, share, knots, T)
        ends = Boundary.at_rest(knots[0, :3]), Boundary.at_rest(knots[-1, :3])
        return method.solve([phase], ends, settings)

    @property
    def _interior_point(self) -> InteriorPoint | None:
        """Accelerations linear in an interval make a motion of cubics; it is the fastest."""
        if self.transcription.degree != 1 or self.cost != FASTEST:
            return None
        return _method(self.equations, tuple(self.transcription.points.tolist()))

    def _at_knots(self, guess: Trajectory, scales: Scales) -> tuple[Array, float]:
        """X and V at the knots, (N + 1, 6), and T."""
        T = guess.duration
        times = T * np.concatenate([[0.0], np.cumsum(self.mesh)])
        return scales.states(guess.position, times, T), T / scales.time

    def _cubics(self, knots: Array, duration: float, scales: Scales) -> PiecewisePolynomial:
        """The motion of cubics between scaled knots (X, V), in m and s."""
        T = duration * scales.time
        x = scales.origin + scales.length * knots[:, :3]
        v = scales.length / T * knots[:, 3:]
        return PiecewisePolynomial.hermite(T * np.append(0.0, np.cumsum(self.mesh)), x, v)

    def pack(self, trajectory: Trajectory, scales: Scales) -> Array:
        """The variables that describe a motion on this mesh, torques within their limits."""
        T = trajectory.duration
        knots = T * np.concatenate([[0.0], np.cumsum(self.mesh)])
        at_knots = trajectory(knots)
        X = (at_knots.x - scales.origin) / scales.length
        V = at_knots.v * T / scales.length
        A = self._inside(trajectory, self.transcription.nodes).a * T**2 / scales.length
        A = self._meeting(X, V, A.reshape(self.intervals, -1, 3))
        tau = self._inside(trajectory, self.transcription.points).tau / scales.torques
        N = self.intervals
        blocks = [X[:-1], V[:-1], A.reshape(N, -1), np.clip(tau, -1, 1).reshape(N, -1)]
        return np.concatenate([np.hstack(blocks).ravel(), X[-1], V[-1], [T / scales.time]])

    def _meeting(self, X: Array, V: Array, A: Array) -> Array:
        """A with the least change after which every interval ends where the next begins.

        Otherwise a guess may leave the workspace just before a goal that lies at its end.
        """
        position, velocity, _ = self.transcription.weights(1.0, self.mesh)
        weights = np.stack([position, velocity], axis=1)  # (N, 2, degree + 3)
        ends = np.stack([X[1:], V[1:]], axis=1)
        combined = np.concatenate([X[:-1, None], V[:-1, None], A], axis=1)
        return np.asarray(A + np.linalg.pinv(weights[..., 2:]) @ (ends - weights @ combined))

    def _inside(self, trajectory: Trajectory, c: Array) -> Motion:
        """The motion at fractions of this mesh's intervals, ends from just inside."""
        begin = np.concatenate([[0.0], np.cumsum(self.mesh)[:-1]])
        inside = np.clip(c, 1e-9, 1 - 1e-9)
        fractions = (begin[:, None] + self.mesh[:, None] * inside).ravel()
        return trajectory(trajectory.duration * fractions)

    def unpack(self, z: Array, scales: Scales) -> PiecewisePolynomial:
        """The motion that the variables describe, in m and s."""
        blocks = z[:-7].reshape(self.intervals, self._block)
        X, V = blocks[:, :3], blocks[:, 3:6]
        A = blocks[:, 6 : self._motion_size].reshape(self.intervals, -1, 3)
        coefficients = self.transcription.coefficients(X, V, A, self.mesh)
        return scales.polynomial(self.mesh, coefficients, z[-1] * scales.time)

    def bounds(self, scales: Scales) -> tuple[Array, Array]:
        """Start and goal, torques within limits, a positive or the given duration."""
        upper = np.full(self.n_variables, np.inf)
        shape = (self.intervals, len(self.transcription.points), 3)
        torques = np.broadcast_to(scales.torque_share, shape).reshape(self.intervals, -1)
        upper[:-7].reshape(self.intervals, self._block)[:, self._motion_size :] = torques
        lower = -upper
        lower[:6] = upper[:6] = scales.at_start
        lower[-7:-1], upper[-7:-1] = scales.at_goal
        lower[-1] = 1e-3
        if self.cost.duration_is_given:
            lower[-1] = upper[-1] = 1.0
        return lower, upper

    def prices(self, solution: Solution) -> Array:
        """Fraction of the duration per fraction of a limit, (N, points, 3 or 6): torques, then
        limited speeds; positive at the upper limit, negative at the lower."""
        N, points = self.intervals, len(self.transcription.points)
        torque = solution.bound_multipliers[:-7].reshape(N, self._block)[:, self._motion_size :]
        speed = solution.row_multipliers[6 * N :].reshape(N, points, -1)[:, :, 6:]
        prices = np.concatenate([torque.reshape(N, points, 3), speed], axis=2)
        return np.asarray(prices / solution.z[-1])

    def _columns(self) -> NDArray[np.intp]:
        """Variables that interval i combines, per component: (N, 3, degree + 3)."""
        first = self._block * np.arange(self.intervals)[:, None, None]
        component = np.arange(3)[:, None]
        steps = 3 * np.arange(self.transcription.degree + 3)
        return np.asarray(first + component + steps, dtype=np.intp)

    def _point_layout(self) -> Layout:
        """y = (X, V, A, τ, T) at every point of every interval."""
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
        """X and V at the end of an interval less those at the beginning of the next."""
        N, k = self.intervals, self.transcription.degree + 3
        weights = np.full((N, 2, 3, k + 1), -1.0)
        columns = np.zeros((N, 2, 3, k + 1), dtype=np.intp)
        for j, part in enumerate(self.transcription.weights(1.0, self.mesh)[:2]):
            weights[:, j, :, :k] = part[:, None]
            columns[:, j, :, :k] = self._columns()
            columns[:, j, :, k] = self._block * np.arange(1, N + 1)[:, None] + 3 * j + np.arange(3)
        return Layout(columns.reshape(-1, k + 1), weights.reshape(-1, k + 1))
