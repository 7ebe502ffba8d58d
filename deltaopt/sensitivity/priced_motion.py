"""Motions that are the best on a mesh, with the price of every limit at every point.

At an optimum the Lagrangian, the cost and the rows of the limits at their prices,

    ln C + Σ λ (row - bound)

does not change to first order with the motion, whatever a mesh can make of it. So how the least
cost depends on a number of a robot or a scene is how the Lagrangian of *this* motion does: rows are
evaluated, and nothing is solved. Where ends, or points on the way, move, the motion is led there by
quintics, at fixed instants.

Where torques jump, at knots of a plan with resolved switches, phases of the mesh meet, with
durations of their own: otherwise an instant of switching could not follow a change within its mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import NotConverged, SceneError, if_possible
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.approach_excess import approach_rows
from deltaopt.motion.extrema import everywhere
from deltaopt.motion.loads import LoadsOfMotion
from deltaopt.motion.running_cost import cost as cost_of
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.effort_planning import cost_to_minimise
from deltaopt.planning.mesh.constraint_tightening import first_tightening
from deltaopt.planning.mesh.error_estimate import split
from deltaopt.planning.nlp.phases import FacePhases, joined
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.plan import Plan
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from deltaopt.problem.boundary import ANYWHERE, Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.scene import Scene

_INTERVALS, _SIZES = 400, (0.5, 0.6, 0.8, 1.0)
"""Intervals of the finest mesh, or twice those of the plan; and the sizes of all of them, shares of
it. A mesh errs as an instant of switching lies between its knots: by as much up as down over
several that divide an interval otherwise."""
_ACCURACIES = (1e-3, 1e-5, 1e-7, 1e-9)
"""Relative tolerances to which meshes are solved: the last, or where it is not met from the plan's
motion, one after the other as far as they are. Beside sharp edges, and where friction changes its
sign between points, small ones may not be."""
_KNOWN = 1e-3
"""Accuracy that leaves a mesh out where two others are known better."""
_SLOWER = 1e-5
"""By what share a motion is slowed to see whether its prices are right."""
_JUMP = 1e-3
"""Of the largest acceleration: the least jump at a knot that is an instant of switching."""
_ANOTHER = 1e-4
"""Share of a cost by which it is another one, beside twice the gap that a plan tells."""
_SHARP, _PAID = 1e-3, 1e-4
"""Radius of a sharp edge, m, and the price of a body that matters, share of the cost per scale."""
_NOT_KNOWN = "is not priced point by point"


@dataclass(frozen=True, eq=False)
class PricedMotion:
    """The motion of least cost on a mesh.

    ``fractions``: of every interval, where limits are imposed. ``prices``: of the rows there, by
    what share the cost grows per unit by which a bound is tightened, (N, points, rows), negative at
    lower bounds. ``solved``: the relative tolerance to which it is the best.
    """

    problem: Problem
    motion: Trajectory
    fractions: Array
    prices: Array
    solved: float

    @cached_property
    def accuracy(self) -> float:
        """Share of the cost to which its dependence is known: as it was solved, and as the
        Lagrangian does not change where the motion is slower, which is one change of many."""
        if not self.problem.is_at_rest:
            return self.solved
        motions = (self.motion.slowed(1 + by) for by in (-_SLOWER, _SLOWER))
        faster, slower = (self._lagrangian(self.problem, each) for each in motions)
        return max(self.solved, abs(slower - faster) / (2 * _SLOWER))

    @cached_property
    def cost(self) -> float:
        """Of the motion, in the objective's unit."""
        return cost_of(self.problem, self.motion)

    def of_job(self, scene: Scene) -> float:
        """ln C of the best motion of a scene that differs by little, but for a constant: to first
        order in what differs.

        Not a number where its equations are others, or a motion that is led to other ends leaves
        the workspace.
        """
        problem = problem_of(scene)
        alike = problem.model.functions is self.problem.model.functions
        if not alike or problem.limits.constraints != self.problem.limits.constraints:
            return nan
        return self._lagrangian(problem, Trajectory(self._led_to(problem), problem.model))

    def _lagrangian(self, problem: Problem, motion: Trajectory) -> float:
        """The cost, as a share of this motion's, and the rows of the limits at their prices."""
        priced = float((self.prices * self._rows(problem, motion)).sum())
        return cost_of(problem, motion) / self.cost + priced

    def _led_to(self, problem: Problem) -> PiecewisePolynomial:
        """The position, led to the boundaries of another problem."""
        position = self.motion.position
        instants = boundary_instants(self.problem, self.motion)
        boundaries = self.problem.boundaries, problem.boundaries
        each = zip(*boundaries, position.at(instants), instants.tolist(), strict=True)
        shifts = np.array([_shift(*one) for one in each])
        if not shifts.any():
            return position
        bend = PiecewisePolynomial.hermite(instants, *shifts.transpose(1, 0, 2))
        knots = position.knots[:: problem.together]
        x, v, a = (bend.at(knots, order) for order in range(3))
        if problem.together > 1:
            bend = PiecewisePolynomial.in_thirds(knots, x, v, a)
        else:
            bend = PiecewisePolynomial.hermite(knots, x, v)
        return replace(position, coefficients=position.coefficients + bend.coefficients)

    def _rows(self, problem: Problem, motion: Trajectory) -> Array:
        """Rows of a problem at the points, (N, points, rows)."""
        places = everywhere(len(self.prices), self.fractions)
        rows = LoadsOfMotion(problem, motion)(*places).rows.reshape(self.prices.shape)
        phased = problem.limits.phased
        if phased is not None:
            rows[:, :, phased.rows] = approach_rows(problem, motion, self.fractions)
        return rows


def _shift(before: Boundary, after: Boundary, x: Array, t: float) -> Array:
    """By how much position, velocity and acceleration change, (3, 3), where a motion is at ``x``
    (m) at the time ``t`` (s), from one boundary to another."""
    shift = np.subtract(
        [after.position, after.velocity, after.acceleration],
        [before.position, before.velocity, before.acceleration],
    )
    shift[0] += t * np.subtract(after.belt, before.belt)
    if before.within:
        shift[0] += (after.within / before.within - 1) * (x - before.position)
    shift[0] = np.where(before.free, 0.0, shift[0])
    if before.is_passed:
        shift[1:] = 0.0
    return np.asarray(shift)


def priced_motions(found: Plan) -> list[PricedMotion]:
    """The best motions near that of a plan, on some meshes that divide its own.

    Raises SceneError for a scene whose prices are not known, and NotConverged.
    """
    _require_prices(found)
    shares = joined(found.trajectory.shares, problem_of(found.scene).together)
    finest = max(_INTERVALS, 2 * len(shares)) * shares
    each = [_priced(found, split(shares, np.ceil(n * finest).astype(int))) for n in _SIZES]
    _require_round(each[-1])
    well = [one for one in each if one.accuracy <= _KNOWN]
    each = well if len(well) > 1 else each
    longer = each[-1].cost / found.cost - 1
    if abs(longer) > 2 * found.gap + _ANOTHER:
        raise NotConverged(
            f"on finer meshes the cost is {longer:.1e} of itself from the plan's, farther than its "
            f"gap, {found.gap:.1e}: what prices limits would have there is not known",
            "Elsewhere",
            each[-1].motion,
        )
    return each


def _require_round(found: PricedMotion) -> None:
    """Raise SceneError where a motion goes around a sharp edge: which way that pushes it changes
    within less than a number can be changed by."""
    limits = found.problem.limits
    if not limits.constraints.has_convex:
        return
    paid = np.abs(found.prices[:, :, limits.constraints.convex]).sum(axis=(0, 1)) > _PAID
    if paid[limits.edge_radii < _SHARP].any():
        expected = f"a tool with a radius of {1e3 * _SHARP:g} mm at least, for sensitivities"
        problem = "has a sharp edge that the tool's point goes around"
        raise SceneError(None, "keep_out", None, expected, problem)


def _require_prices(found: Plan) -> None:
    scene = found.scene
    if scene.follows_path:
        raise SceneError(None, "path", str(scene.path), "none, or a tube about it", _NOT_KNOWN)
    if scene.objective.given_duration is not None or scene.objective.rate.order == 3:
        expected = "time, for the sensitivities of a plan"
        raise SceneError(None, "objective", str(scene.objective), expected)
    if found.duration <= scene.least_duration * (1 + _ANOTHER):
        expected = "a rotation that is done before the motion is, for sensitivities"
        raise SceneError(None, "rotation", None, expected, "sets the duration")
    limits = () if found.multipliers is None else found.multipliers.limits.constraints.limits
    if any(limit.own_measure is OwnMeasure.LINKS for limit in limits):
        raise SceneError(None, "robot_keeps_clear", "true", "false, for sensitivities", _NOT_KNOWN)


def _priced(plan: Plan, mesh: Array) -> PricedMotion:
    """The best motion on a mesh near that of a plan."""
    scene, motion = plan.scene, plan.trajectory
    attempt = Attempt(scene, motion, len(mesh))
    problem, optimiser = attempt.problem, TrajectoryOptimiser()
    scaling = attempt.scaling(motion, motion.duration)
    if plan.resolved:
        scaling = _with_switches(scaling, motion)
    mesh = split(mesh, problem.together)
    scaling = first_tightening(scaling, motion, mesh)
    program = optimiser.program(scaling, cost_to_minimise(scaling))(mesh)
    found, solved = None, 1.0
    for accuracy in (_ACCURACIES[-1], *_ACCURACIES):
        guess = Guess(motion, near=True, tolerance=accuracy, on_its_mesh=True)
        other = if_possible((NotConverged,), program.solve, guess, scaling)
        if other is not None:
            found, solved = other, accuracy
            motion = Trajectory(other.position, problem.model)
        if found is not None and (other is None or solved == _ACCURACIES[-1]):
            break
    if found is None or not found.all_at_points:
        raise NotConverged("limits have no prices on a finer mesh", "No_Prices", motion)
    return PricedMotion(problem, motion, program.points, found.multipliers, solved)


def _with_switches(scaling: Scaling, motion: Trajectory) -> Scaling:
    """A scaling with phases that meet where the acceleration of a motion jumps."""
    a = motion.accelerations_at_ends
    jumps = np.linalg.norm(a[2::2] - a[1:-1:2], axis=1) > _JUMP * np.abs(a).max()
    instants = np.cumsum(motion.shares)[:-1][jumps]
    if not len(instants):
        return scaling
    numbers = np.tile(scaling.limits.numbers, (len(instants) + 1, 1))
    faces = np.zeros(int(scaling.constraints.convex.sum()), bool)  # of no body
    phases = FacePhases(instants, (ANYWHERE,) * len(instants), numbers, faces)
    return replace(scaling, faces=phases)
