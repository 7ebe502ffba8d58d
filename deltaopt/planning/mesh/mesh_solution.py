"""A problem solved on one mesh: its motion, its lost time, and the optimality gap."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.limits.constraints import Constraints
from deltaopt.motion.approach_excess import approach_rows
from deltaopt.motion.loads import Loads, NeededSlowing, loads_inside
from deltaopt.motion.running_cost import cost as cost_of
from deltaopt.motion.sure_bounds import sure_excess
from deltaopt.motion.time_scaling import fractions_of, needed_slowing
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.bends import hidden_cost, missed_cost
from deltaopt.planning.mesh.constraint_tightening import bulge, points_apart, samples_at
from deltaopt.planning.mesh.edges import prices, touching
from deltaopt.planning.mesh.error_estimate import (
    FRACTIONS,
    SAFETY_FACTOR,
    ErrorEstimate,
    error_estimate,
)
from deltaopt.planning.nlp.phases import FacePhases
from deltaopt.planning.nlp.problem import Guess, MeshProgram, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.softening import Softening
from deltaopt.problem.problem import Problem

_CHEAPEST = 0.05
"""Least price of a limit that is exceeded between points, a fraction of the cost per share of it,
where effort or smoothness counts: at the points it may not be active."""
_BESIDE_BODIES = 0.2
"""Of a tolerance: what may be lost beside bodies where phases end on edges."""


def solve_on_mesh(program: MeshProgram, scaling: Scaling, guess: Guess) -> MeshSolution:
    """Solve a program on its mesh, and estimate the lost time and the excess over the limits.

    Raises NotConverged.
    """
    problem = scaling.problem
    solution = program.solve(guess, scaling)
    trajectory = Trajectory(solution.position, problem.model, solution.coordinates)
    loads = loads_inside(problem, trajectory, FRACTIONS)
    slowing, needed = _needed(loads, scaling)
    mesh = program.mesh if solution.mesh is None else solution.mesh
    lost = _lost(mesh, solution, loads, slowing, scaling)
    unused = lost.total
    soft = scaling.softening
    if soft is not None and solution.widths is not None:
        rows, control = loads.rows.copy(), scaling.constraints.is_control
        rows[:, control] = soft.resolved(
            problem, trajectory, solution.widths, FRACTIONS, rows[:, control]
        )
        resolved = replace(loads, rows=rows)
        lost = _lost(mesh, solution, resolved, slowing, scaling)
    has_arrived = solution.left <= guess.tolerance
    found = MeshSolution(
        program, solution, mesh, trajectory, loads, lost, unused, needed, scaling, has_arrived
    )
    if problem.objective.running:
        found = found.with_cost_of_bends()
        if soft is not None and solution.widths is not None and problem.objective.rate.order == 2:
            found = found.with_cost_of_softness(soft, solution.widths)
    if scaling.constraints.slid_along.any():
        found = found.with_price_of_sliding()
    return found.with_sure_bounds() if scaling.constraints.has_convex else found


def _lost(
    mesh: Array, solution: Solved, loads: Loads, slowing: Array, scaling: Scaling
) -> ErrorEstimate:
    """The lost time of a solution on a mesh; ``slowing``: as of ``error_estimate``."""
    constraints = scaling.constraints
    rows = time_costing_rows(constraints)
    return error_estimate(
        mesh,
        solution.multipliers[:, :, rows],
        _by_interval(loads.rows)[:, :, rows],
        constraints.orders[rows] == constraints.order,
        slowing,
        is_fastest=constraints.order == 2 and not scaling.problem.objective.running,
    )


def _needed(loads: Loads, scaling: Scaling) -> tuple[Array, NeededSlowing]:
    """By what factor each interval alone asks the motion to be slowed, (N,), and all together.

    Where an end moves, or effort counts, a motion cannot be slowed: then these say by how much
    limits are exceeded, and stand for what tightening them will cost.
    """
    if scaling.problem.may_be_slowed:
        demands = loads.highest_demands(len(FRACTIONS))
        return loads.slowing(demands), loads.needed(demands.max(axis=0))
    sizes = scaling.constraints.size(_by_interval(loads.rows)).max(axis=1)
    in_time = np.logical_not(scaling.constraints.of_place)
    return np.maximum(sizes[:, in_time].max(axis=1), 1.0), _as_slowing(scaling, sizes.max(axis=0))


def _as_slowing(scaling: Scaling, highest: Array) -> NeededSlowing:
    """The highest sizes of rows, (rows,), of a motion that cannot be slowed, as if it could."""
    constraints = scaling.constraints
    factor = max(1.0, float(highest[~constraints.of_place].max()))
    misplaced = float(highest[constraints.sampled_places].max(initial=0.0)) - 1
    return NeededSlowing(factor, misplaced)


def time_costing_rows(constraints: Constraints) -> Truths:
    """Which rows lose time where a mesh leaves them unused, (rows,).

    All but those of positions: an optimal motion touches a position limit at an instant and leaves
    it again, so that a multiplier there does not mean that time is lost beside it.
    """
    return np.asarray(constraints.orders > 0)


def _by_interval(rows: Array) -> Array:
    """Rows at ``FRACTIONS``, (N · len(FRACTIONS), rows), as (N, len(FRACTIONS), rows)."""
    return rows.reshape(-1, len(FRACTIONS), rows.shape[1])


@dataclass(frozen=True)
class MeshSolution:
    """A problem solved on one mesh; its motion is not slowed yet.

    ``mesh``: lengths of the intervals, fractions of the duration, (N,). ``scaling``: units and
    tightened limits of the problem. ``loads``: constraint rows at ``FRACTIONS`` of the intervals.
    ``lost``: the estimated loss of time to the mesh. ``unused``: the same with what softer friction
    loses, without what slowing costs. ``needed``: by which factor the motion must be slowed to keep
    every limit; of all instants if ``is_exact``, else of samples.
    ``excess``: as of ``sure_excess``, and ``beside``: what is lost beside each of these limits,
    (rows,); None without such. ``has_arrived``: whether the solver left no more than was asked for.
    ``gap``: the estimated optimality gap, as of ``with_gap``.
    """

    program: MeshProgram
    solution: Solved
    mesh: Array
    trajectory: Trajectory
    loads: Loads
    lost: ErrorEstimate
    unused: float
    needed: NeededSlowing
    scaling: Scaling
    has_arrived: bool
    is_exact: bool = False
    excess: Array | None = None
    beside: Array | None = None
    gap: float = inf

    @property
    def problem(self) -> Problem:
        """What was solved."""
        return self.scaling.problem

    @cached_property
    def cost(self) -> float:
        """Value of the scene's objective for the motion as it is, in the objective's unit."""
        return cost_of(self.problem, self.trajectory)

    @cached_property
    def price_of_limits(self) -> float:
        """What tightening all limits costs at most, as a fraction of the cost per share of them: of
        a duration no more than that share."""
        if not self.problem.objective.running:
            return 1.0
        rows = time_costing_rows(self.scaling.constraints)
        return max(1.0, float(np.abs(self.solution.multipliers[:, :, rows]).sum()))

    def with_cost_of_bends(self) -> MeshSolution:
        """This solution with what it costs that polynomials do not bend as the best torques do, and
        with what limits that are exceeded cost by their price."""
        objective = self.problem.objective
        missed = missed_cost(self.trajectory, objective, self.scaling.constraints.order)
        found = self._with_unused(objective.running / self.cost * missed)
        prices = np.abs(self.solution.multipliers).sum(axis=(0, 1))
        excess = np.maximum(self.sizes.max(axis=1) - 1, 0.0)
        exceeded = np.asarray(excess @ np.maximum(prices, _CHEAPEST))
        return replace(found, lost=replace(found.lost, exceeded=exceeded))

    def with_cost_of_softness(self, soft: Softening, widths: Array) -> MeshSolution:
        """This solution with what it costs that torques are not those that its mesh sees, on which
        friction changes its sign over ``widths``, rad/s, (N, motors)."""
        objective = self.problem.objective
        hidden = soft.hidden(self.problem, self.trajectory, widths, FRACTIONS)
        lost = hidden_cost(self.trajectory, hidden, FRACTIONS, objective)
        lost *= objective.running / self.cost
        at_least = soft.is_least(widths).all(axis=1)
        found = self._with_unused(np.where(at_least, 0.0, lost))
        return replace(found, unused=found.unused + float(lost[at_least].sum()))

    def with_sure_bounds(self) -> MeshSolution:
        """This solution with the ``excess`` over limits that are convex in the position, and with
        what it costs that these were tightened.

        Where the motion touches a body it might come nearer by what is left at its nearest
        instant. Around an edge whose radius is less than the points are apart it might come nearer
        at the points as well.
        """
        excess = sure_excess(self.problem, self.trajectory.position)
        constraints, limits = self.scaling.constraints, self.scaling.limits
        size = self.sizes[:, :, constraints.convex]
        apart = points_apart(self.problem, self.trajectory, self.mesh)[:, None]
        sharp = apart / np.maximum(limits.edge_radii, apart)
        bulges = bulge(self.program.points, size, size.max(axis=1))
        left = np.maximum(1 - size.max(axis=1), 0.0) + bulges * sharp
        lost = prices(self.solution)[:, constraints.convex] * left
        at_bodies = lost.sum(axis=1)
        priced = self._with_unused(at_bodies)
        return replace(
            priced,
            lost=replace(priced.lost, at_bodies=at_bodies),
            needed=self.needed.beside(float(excess.max())),
            excess=excess,
            beside=lost.sum(axis=0),
        )

    def with_price_of_sliding(self) -> MeshSolution:
        """This solution with what it costs that limits that motions slide along were not used up:
        the multiplier at each point times what is left there."""
        rows, at_points = self.scaling.constraints.slid_along, samples_at(self.program.points)
        size = self.sizes[:, at_points][:, :, rows]
        price = np.abs(self.solution.multipliers[:, :, rows])
        return self._with_unused((price * np.maximum(1 - size, 0.0)).sum(axis=(1, 2)))

    def _with_unused(self, unused: Array) -> MeshSolution:
        """This solution with more time lost in each interval, (N,), to limits not used up."""
        return replace(
            self,
            lost=replace(self.lost, unused=self.lost.unused + unused),
            unused=self.unused + float(unused.sum()),
        )

    def presses_beside_bodies(self, tolerance: float) -> bool:
        """Whether faces that stand for bodies hold the motion where these are not, so that more
        than a share of the gap, or of its ``tolerance`` if that is larger, is lost. Of
        stretches of a path the gap alone tells that."""
        if self.beside is None or self.faces is None:
            return False
        most = _BESIDE_BODIES * max(tolerance, self.own_gap)
        return float(self.beside[self.faces.rows].sum()) > most

    @property
    def contacts(self) -> Array:
        """Instants at which the motion touches bodies, as fractions of the duration, (n,)."""
        convex = self.scaling.constraints.convex
        if not convex.any():
            return np.zeros(0)
        pays = touching(self.solution)[:, convex]
        size = self.sizes[:, :, convex]
        begin = np.cumsum(self.mesh) - self.mesh
        times = (begin[:, None] + self.mesh[:, None] * FRACTIONS).ravel()
        found = []
        for row in range(pays.shape[1]):
            edges = np.flatnonzero(np.diff(pays[:, row], prepend=False, append=False)).tolist()
            for first, last in zip(edges[::2], edges[1::2], strict=True):
                samples = slice(first * len(FRACTIONS), last * len(FRACTIONS))
                found.append(times[samples][size[:, :, row].reshape(-1)[samples].argmax()])
        return np.array(sorted(found))

    @cached_property
    def safe_factor(self) -> float:
        """By which the motion must be slowed to keep the limits that slowing helps to keep."""
        return self.needed.factor

    @property
    def exceeding(self) -> float:
        """What it costs to keep the limits that slowing helps to keep, a fraction of the cost."""
        if self.problem.objective.running:
            return float(self.lost.exceeded.max())
        return self.safe_factor - 1

    @property
    def safe_duration(self) -> float:
        """Of the motion slowed until it keeps every limit, s; infinite where a limit of position is
        exceeded."""
        kept = self.needed.keeps_places
        return self.trajectory.duration * self.safe_factor if kept else inf

    @property
    def has_all_multipliers(self) -> bool:
        """Whether the motion is made of cubics and the multipliers of all its limits are known."""
        cubic = self.solution.position.coefficients.shape[1] == 4
        return cubic and self.solution.all_at_points

    @cached_property
    def rows(self) -> Array:
        """Constraint rows inside the intervals, (N, len(FRACTIONS), rows), those of an approach by
        what holds in the phase of each."""
        rows, phased = _by_interval(self.loads.rows), self.scaling.limits.phased
        if phased is not None:
            rows = rows.copy()
            rows[:, :, phased.rows] = approach_rows(self.problem, self.trajectory, FRACTIONS)
        return rows

    @cached_property
    def sizes(self) -> Array:
        """How near these rows are to the nearer of their bounds, 1 at a bound."""
        return self.scaling.constraints.size(self.rows)

    @cached_property
    def own_gap(self) -> float:
        """Estimated optimality gap of the motion, by this mesh alone."""
        return float(self.lost.exceeded.max()) + SAFETY_FACTOR * self.to_be_gained

    @property
    def lost_to_friction(self) -> float:
        """What softer friction loses, a fraction of the cost, where no finer mesh helps."""
        return 0.0 if self.scaling.softening is None else max(0.0, self.unused - self.lost.total)

    @property
    def faces(self) -> FacePhases | None:
        """The phases past edges that the motion was found in; None if there are none."""
        faces = self.scaling.faces
        return None if faces is None else faces.moved(self.program.mesh, self.mesh)

    @property
    def status(self) -> str:
        """The solver's status."""
        return self.solution.status

    @cached_property
    def to_be_gained(self) -> float:
        """Estimated relative gain by finer meshes and by solving this one exactly."""
        return self.unused + self.solution.left

    def as_it_is(self, highest: Array) -> MeshSolution:
        """This solution of a motion that cannot be slowed, from the highest sizes of its rows
        at all instants, (rows,)."""
        return replace(self, needed=_as_slowing(self.scaling, highest), is_exact=True)

    def exact(self) -> MeshSolution:
        """This solution with the safe factor of all instants instead of samples."""
        if self.is_exact:
            return self
        as_sampled = len(fractions_of(self.trajectory)) == len(FRACTIONS)
        known = self.loads if as_sampled else None
        needed = needed_slowing(self.problem, self.trajectory, sampled=known)
        return replace(self, needed=needed, is_exact=True)
