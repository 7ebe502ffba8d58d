"""Switch resolution: arcs of free length between switches, smooth inside.

Where a motor is at a limit all along an arc it is held there, at every node of polynomials of
high degree; where the arcs end is a variable. Nothing is smeared then, and the error falls
exponentially with the degree. Lengths of time are variables, so the integration of the
acceleration is no longer linear and stands as rows, with position and velocity at all nodes
as variables. For a node c of an interval that is the m-th part of an arc of length h:

    X_c = X_0 + (h/m) c V_0 + (h/m)² Σ_j l̿_j(c) A_j
    V_c = V_0 + (h/m) Σ_j l̄_j(c) A_j

A motor at its speed limit is held by θ̇ = ±ω where the arc begins and θ̈ = 0 along it: θ̇ = ±ω
at every node would leave its acceleration undetermined between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.nlp.points import Layout, PointFunction, Points
from deltaopt.planning.nlp.program import IpoptProgram, IpoptSolution, Options
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.switching.arc_mesh import parts_of
from deltaopt.planning.switching.structure import SwitchingStructure

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

OPTIONS: Options = {
    "ipopt.tol": 1e-11,
    "ipopt.mu_init": 1e-6,
    "ipopt.mu_strategy": "monotone",
    "ipopt.bound_push": 1e-8,
    "ipopt.bound_frac": 1e-8,
    "ipopt.bound_relax_factor": 1e-10,  # by default every limit is widened by 1e-8
    "ipopt.max_iter": 100,
    # By symmetry a row may imply another: multipliers are not unique then, and those of the
    # last step may have wrong signs. The least-squares ones share the symmetry.
    "ipopt.recalc_y": "yes",
    # Two motors that switch together leave more rows than variables; CasADi would say so.
    "inputs_check": False,
}


def integration() -> tuple[PointFunction, PointFunction]:
    """Rows of position and of velocity: (X_c - X_0, c V_0, Σ l̿ A, h) and (V_c - V_0, Σ l̄ A, h).

    The lengths of intervals enter scaled by the layout; p is not used.
    """
    e, w, u, h = (ca.SX.sym(name) for name in "ewuh")
    return (
        PointFunction("position", _function([e, w, u, h], e - h * w - h**2 * u)),
        PointFunction("velocity", _function([e, u, h], e - h * u)),
    )


def _function(y: list[ca.SX], row: ca.SX) -> ca.Function:
    return ca.Function("row", [ca.vertcat(*y), ca.SX.sym("p", 0)], [row])


@dataclass(frozen=True)
class ArcProblem:
    """A structure to be solved for its switches.

    Variables: for every interval X, V at its beginning, X, V at its inner nodes, then A and
    τ at all its nodes; last X, V at the goal, the lengths of the arcs, and a constant 1.
    Velocities and accelerations are in units of the baseline's duration.
    """

    equations: PointEquations
    structure: SwitchingStructure
    degree: int

    @cached_property
    def transcription(self) -> PiecewiseAcceleration:
        return PiecewiseAcceleration(self.degree, between=())

    @cached_property
    def parts(self) -> Integers:
        """Into how many intervals each arc is cut, (arcs,)."""
        return parts_of(self.structure.lengths)

    @cached_property
    def arc(self) -> Integers:
        """The arc of each interval, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @property
    def intervals(self) -> int:
        return int(self.parts.sum())

    @property
    def _block(self) -> int:
        return 12 * self.degree + 6

    @property
    def n_variables(self) -> int:
        return self.intervals * self._block + 6 + len(self.parts) + 1

    @property
    def _first_length(self) -> int:
        return self.n_variables - 1 - len(self.parts)

    @cached_property
    def _states(self) -> Integers:
        """Where X begins at each node of each interval, (n, degree + 1); V follows."""
        d, begin = self.degree, self._block * np.arange(self.intervals)[:, None]
        return np.hstack([begin + 6 * np.arange(d), begin + self._block])

    @cached_property
    def _accelerations(self) -> Integers:
        """Where A begins, (n, degree + 1)."""
        begin = self._block * np.arange(self.intervals)[:, None] + 6 * self.degree
        return np.asarray(begin + 3 * np.arange(self.degree + 1))

    @property
    def _torques(self) -> Integers:
        """Where τ begins, (n, degree + 1)."""
        return self._accelerations + 3 * (self.degree + 1)

    @cached_property
    def program(self) -> IpoptProgram:
        cost = np.zeros(self.n_variables)
        cost[self._first_length : -1] = 1.0
        position, velocity = integration()
        zero = np.zeros(1)
        points = [
            Points(self.rows, self._node_layout(), *self._row_bounds()),
            Points(position, self._position_layout(), zero, zero),
            Points(velocity, self._velocity_layout(), zero, zero),
        ]
        none = np.zeros((0, 1))
        return IpoptProgram(cost, Layout(none.astype(np.intp), none), points, OPTIONS)

    @cached_property
    def rows(self) -> PointFunction:
        """Equations of motion, position limits, velocity limits and their derivatives by time."""
        e = self.equations
        position, velocity = (e.rows[self._of_order(order)] for order in (0, 1))
        X, V, A = (e.y[3 * i : 3 * i + 3] for i in range(3))
        rate = ca.jtimes(velocity, X, V) + ca.jtimes(velocity, V, A)
        rows = ca.vertcat(e.force, position, velocity, rate)
        return PointFunction("arcs", ca.Function("arcs", [e.y, e.parameters.vector], [rows]))

    def _of_order(self, order: int) -> list[int]:
        return [int(i) for i in self.equations.constraints.of_order(order)]

    def _row_bounds(self) -> tuple[Array, Array]:
        """Of equations of motion, positions, velocities and their rates at every node, (n · nodes,
        rows)."""
        shape = (self.intervals, self.degree + 1, 3)
        zero, free = np.zeros(shape), np.full(shape, np.inf)
        lower, upper = [zero], [zero]
        if self._of_order(0):
            lower, upper = [zero, zero - 1], [zero, free]
        if self._of_order(1):
            held = self.structure.state(1)[self.arc][:, None]  # (n, 1, 3)
            begins = np.zeros(shape, dtype=bool)
            begins[:, 0] = True
            begins[1:, 0] = (
                self.structure.state(1)[self.arc[1:]] != self.structure.state(1)[self.arc[:-1]]
            )
            at_limit = np.where(held != 0, held, 1.0)
            speed_lower = np.where(held == 0, -1.0, np.where(begins, at_limit, -np.inf))
            speed_upper = np.where(held == 0, 1.0, np.where(begins, at_limit, np.inf))
            bend = np.where(np.broadcast_to(held, shape) != 0, 0.0, np.inf)
            lower, upper = [*lower, speed_lower, -bend], [*upper, speed_upper, bend]
        rows = 3 * len(lower)
        return tuple(np.concatenate(b, axis=2).reshape(-1, rows) for b in (lower, upper))  # type: ignore[return-value]

    def bounds(self, scaling: Scaling) -> tuple[Array, Array]:
        """Start and goal, torques held or within limits, arcs not negative."""
        upper = np.full(self.n_variables, np.inf)
        lower = -upper
        held = np.broadcast_to(
            self.structure.control[self.arc][:, None], (self.intervals, self.degree + 1, 3)
        )
        at = self._torques[..., None] + np.arange(3)
        lower[at] = np.where(held != 0, held, -1)
        upper[at] = np.where(held != 0, held, 1)
        goal = self.intervals * self._block
        lower[:6] = upper[:6] = np.append(
            scaling.place(scaling.problem.start.position), np.zeros(3)
        )
        lower[goal : goal + 6] = upper[goal : goal + 6] = scaling.at_goal
        lower[self._first_length : -1] = 0.0
        lower[-1] = upper[-1] = 1.0
        return lower, upper

    def pack(self, trajectory: Trajectory, scaling: Scaling) -> Array:
        """Variables from a motion of about this structure."""
        d, nodes = self.degree, self.transcription.nodes
        lengths = self.structure.lengths * trajectory.duration
        interval = (lengths / self.parts)[self.arc]
        begin = np.concatenate([[0.0], np.cumsum(interval)[:-1]])
        inside = np.clip(nodes, 1e-6, 1 - 1e-6)
        motion = trajectory((begin[:, None] + interval[:, None] * inside).ravel())
        n, D, T = self.intervals, scaling.length, scaling.time
        z = np.zeros(self.n_variables)
        three = np.arange(3)
        at = self._states[:, :d, None] + three
        z[at] = ((motion.x - scaling.origin) / D).reshape(n, d + 1, 3)[:, :d]
        z[at + 3] = (motion.v * T / D).reshape(n, d + 1, 3)[:, :d]
        z[self._accelerations[..., None] + three] = (motion.a * T**2 / D).reshape(n, d + 1, 3)
        z[self._torques[..., None] + three] = (motion.tau / scaling.torque).reshape(n, d + 1, 3)
        at_end = trajectory([trajectory.knots[-1]])
        z[n * self._block :][:3] = (at_end.x[0] - scaling.origin) / D
        z[n * self._block :][3:6] = at_end.v[0] * T / D
        z[self._first_length : -1] = lengths / T
        z[-1] = 1.0
        lower, upper = self.bounds(scaling)
        return np.clip(z, lower, upper)

    def lengths(self, z: Array) -> Array:
        """Lengths of the arcs in units of the baseline's duration, (arcs,)."""
        return z[self._first_length : -1]

    def interval_lengths(self, z: Array) -> Array:
        """Lengths of the intervals in the same unit, (n,)."""
        return np.asarray((self.lengths(z) / self.parts)[self.arc])

    def accelerations(self, z: Array) -> Array:
        """A at all nodes, (n, degree + 1, 3)."""
        return np.asarray(z[self._accelerations[..., None] + np.arange(3)])

    def control_multipliers(self, solution: IpoptSolution, p: Array) -> Array:
        """Multipliers of the torques' bounds at the nodes, (n, degree + 1, 3), by stationarity of
        the Lagrangian: Ipopt leaves variables that are fixed out of its problem."""
        slopes = [self.program._solver.get_function(f"nlp_{name}") for name in ("grad_f", "jac_g")]
        gradient, J = (slope(solution.z, p)[1] for slope in slopes)
        of_bounds = -(gradient + J.T @ solution.row_multipliers).full().ravel()
        at = self._torques[..., None] + np.arange(3)
        return np.asarray(of_bounds[at])

    def _node_layout(self) -> Layout:
        """y = (X, V, A, τ, 1) at every node."""
        n, d = self.intervals, self.degree
        columns = np.zeros((n, d + 1, 13), dtype=np.intp)
        columns[..., :6] = self._states[..., None] + np.arange(6)
        columns[..., 6:9] = self._accelerations[..., None] + np.arange(3)
        columns[..., 9:12] = self._torques[..., None] + np.arange(3)
        columns[..., 12] = self.n_variables - 1
        return Layout(columns.reshape(-1, 1), np.ones((columns.size, 1)))

    def _position_layout(self) -> Layout:
        """y = (X_c - X_0, c V_0, Σ l̿ A, h/m) for the nodes after the first, per component."""
        position, _, _ = self.transcription.weights(self.transcription.nodes[1:], 1.0)
        return self._integration_layout(position[:, 1:], velocity=False)

    def _velocity_layout(self) -> Layout:
        """y = (V_c - V_0, Σ l̄ A, h/m) for the nodes after the first, per component."""
        _, velocity, _ = self.transcription.weights(self.transcription.nodes[1:], 1.0)
        return self._integration_layout(velocity[:, 1:], velocity=True)

    def _integration_layout(self, weights: Array, *, velocity: bool) -> Layout:
        """``weights``: of V_0 and A_j at the nodes after the first, (degree, degree + 2)."""
        n, d, of = self.intervals, self.degree, 3 if velocity else 0
        ny = 3 if velocity else 4
        columns = np.zeros((n, d, 3, ny, d + 1), dtype=np.intp)
        values = np.zeros(columns.shape)
        three = np.arange(3)
        columns[..., 0, 0] = self._states[:, 1:, None] + of + three
        columns[..., 0, 1] = self._states[:, :1, None] + of + three
        values[..., 0, 0], values[..., 0, 1] = 1.0, -1.0
        if not velocity:
            columns[..., 1, 0] = self._states[:, :1, None] + 3 + three
            values[..., 1, 0] = weights[:, None, 0]
        columns[..., -2, :] = self._accelerations[:, None, None, :] + three[:, None]
        values[..., -2, :] = weights[:, None, 1:]
        columns[..., -1, 0] = (self._first_length + self.arc)[:, None, None]
        values[..., -1, 0] = (1.0 / self.parts[self.arc])[:, None, None]
        return Layout(columns.reshape(-1, d + 1), values.reshape(-1, d + 1))
