"""From one first motion to a plan: meshes that are refined, switches, and a motion that is safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isinf
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import ENDS_AN_ATTEMPT, DeltaOptError, Infeasible, NotConverged
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.limit_sensitivity import MeshMultipliers
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory, moving_on
from deltaopt.planning.effort_planning import (
    SMOOTH,
    Beginning,
    beginnings,
    cost_to_minimise,
    require_possible,
    scaling_to_duration,
)
from deltaopt.planning.first_motions.order_of_merit import (
    CrossesSingularity,
    crosses_singularity,
    intervals_for,
)
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import problem_formulation
from deltaopt.planning.mesh.kept_limits import kept
from deltaopt.planning.mesh.mesh_solution import (
    Iteration,
    MeshSolution,
    gap_of,
    iteration_of,
    motion_on_first_mesh,
)
from deltaopt.planning.mesh.reversals import softer_scenes
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import (
    FormulatedProblem,
    Guess,
    InteriorPoint,
    ProblemFormulation,
    Solver,
)
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR, PiecewiseAcceleration
from deltaopt.planning.plan import Plan, quicker
from deltaopt.planning.refinement import Progress, Refinement, Resolver
from deltaopt.planning.search import Attempt, HeldByMotion
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.feasibility import serial_distances_at_ends
from deltaopt.scene.objective import Effort, Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import MovingEnds

Array = NDArray[np.float64]

RESOLVED_BELOW = 1e-4
"""Tolerance of the optimality gap below which the instants of switching become unknowns of their
own. It trades the cost of switch resolution against that of fine meshes, which grows steeply as
the tolerance falls."""
_RETRY_HALVES = 3
"""A plan that misses a tolerance below ``RESOLVED_BELOW`` is made once more from a first mesh of
3/2 as many intervals. Which switching structure is detected and which intervals are split depends
on the first mesh, so another one may succeed; it costs as much time again."""
_KEPT_DISTANCE = 1e-2
"""Squared distance to the serial singularities, sin² or cos² of an angle, that motions keep if
their start and goal do. Ends that are closer ask for a larger allowance for rounding."""
_FIRST_MESH_TOLERANCE = 1e-4
"""Tightest relative tolerance of the solver on the first mesh. Any tighter is wasted, for the
discretisation error of a coarse mesh is far larger."""


@dataclass(frozen=True)
class TrajectoryOptimiser:
    """Finds the best motion of a scene that can be reached from a first one.

    The settings are those of `Planner`, whose defaults they share.
    """

    tolerance: float = 1e-3
    intervals: int = 16
    transcription: PiecewiseAcceleration | None = None
    formulation: ProblemFormulation | Multiplier | Projected | None = None
    resolved_below: float = RESOLVED_BELOW
    solver: Solver | None = None

    def plan(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan from one first guess; once more from other meshes if the gap was missed."""
        if not isinstance(attempt.scene.objective, Time):
            return self.fastest(attempt, report)
        can_be_softer = self._is_compiled and attempt.scene.task.is_at_rest
        softer = softer_scenes(attempt.scene, attempt.motion) if can_be_softer else ()
        found = self.fastest(replace(attempt, softer=softer), report)
        if softer and not found.within_tolerance:
            report("once more, without knots where arms turn back:")
            found = self._better(found, attempt, report)
        if found.within_tolerance or self.tolerance >= self.resolved_below:
            return found
        other = replace(attempt, intervals=_RETRY_HALVES * attempt.intervals // 2)
        report(f"once more, from {other.intervals} intervals:")
        return self._better(found, other, report)

    def _better(self, found: Plan, attempt: Attempt, report: Progress) -> Plan:
        """The shorter of a plan and another one, if there is another."""
        try:
            return quicker(found, self.fastest(attempt, report))
        except ENDS_AN_ATTEMPT as error:
            report(str(error))
            return found

    @property
    def _is_compiled(self) -> bool:
        """Whether plans are made by the interior-point method. Ipopt takes seconds for a mesh, as
        many with knots at reversals as without."""
        return isinstance(self._solver, InteriorPoint)

    def on_first_mesh(self, attempt: Attempt) -> Trajectory:
        """The fastest motion on the first mesh alone, which may break limits between its points."""
        guess = Guess(attempt.motion, attempt.is_near, self.accuracy, is_trial=True)
        moving = isinstance(attempt.scene.task, MovingEnds)
        extent = attempt.motion.extent if moving else None
        scaling = Scaling(attempt.scene, attempt.motion.duration, extent=extent)
        problem = self._problem(attempt.motion.model, scaling, FASTEST)
        return motion_on_first_mesh(problem, scaling, guess, attempt.intervals)

    def fastest(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan the best motion from one first guess and one first mesh: the fastest, unless the
        scene has another objective.

        The motion of the chosen mesh is slowed until it keeps every limit at all instants, or
        solved again with tighter limits where it cannot be slowed.
        """
        scene = attempt.scene
        if not isinstance(scene.objective, Time):
            return self._plan_effort(attempt, report)
        own = attempt.on_its_mesh
        guess = Guess(attempt.motion, attempt.is_near, attempt.accuracy, on_its_mesh=own)
        scaling = Scaling(
            scene,
            guess.trajectory.duration,
            extent=_extent(scene, guess.trajectory),
            torque_share=attempt.torque_share,
        )
        return self._refined(attempt, guess, attempt.mesh, scaling, report)

    def _refined(
        self, attempt: Attempt, guess: Guess, mesh: Array, scaling: Scaling, report: Progress
    ) -> Plan:
        """The plan that meshes lead to from a guess and a first mesh."""
        begin, scene = perf_counter(), attempt.scene
        model = delta_model(scene.robot, scene.payload)
        moving = isinstance(scene.task, MovingEnds)
        in_phases, is_fastest = bool(scene.task.gates), isinstance(scene.objective, Time)
        refinement = Refinement(
            self._problem(model, scaling, cost_to_minimise(scene.objective, scaling)),
            scaling,
            model,
            self.tolerance,
            self._resolver(scaling, model, report)
            if is_fastest and not (moving or in_phases)
            else None,
            report,
            attempt.softer,
            attempt.most,
        )
        resolved = refinement.from_guess(guess, mesh)
        solutions, iterations = refinement.solutions, refinement.iterations
        best, later = _best_of(solutions, iterations), list[Iteration]()
        if not scene.may_be_slowed:
            later = iterations[best:] if is_fastest else []
            solutions = [
                *solutions[: best + 1],
                kept(refinement.problem, solutions[best], self.tolerance),
            ]
            iterations = [*iterations[: best + 1], iteration_of(solutions)]
            best += 1
            report(str(iterations[-1]))
        elif not resolved:
            solutions[best] = solutions[best].exact()
            iterations[best] = iteration_of(solutions[: best + 1])
        chosen = resolved or solutions[best]
        if not (resolved or solutions[best].needed.keeps_places):
            raise NotConverged(
                "a limit of position is exceeded between the points of every mesh, however much it "
                "is tightened",
                chosen.status,
                chosen.trajectory,
            )
        _require_one_side(scene, chosen.trajectory, chosen.status)
        trajectory = chosen.trajectory
        if moving:
            trajectory = moving_on(scene.task, trajectory)
        elif is_fastest:
            trajectory = _safe(scene, trajectory, chosen.safe_factor, chosen.status)
        gap = resolved.gap if resolved else gap_of([*iterations, *later], best)
        if not is_fastest:  # what it has cost to keep the limits between points
            gap += max(0.0, solutions[best].cost / solutions[best - 1].cost - 1)
        if scene.rotation and is_fastest:  # nothing is faster than what it takes
            gap = min(gap, max(0.0, trajectory.duration / scene.least_duration - 1))
        spent = sum(each.iterations for each in iterations)
        return Plan(
            scene=scene,
            trajectory=trajectory,
            formulation=self.problem_formulation.name,
            transcription=resolved.name if resolved else self._transcription(scene).name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.status,
            iterations=spent + (resolved.iterations if resolved else 0),
            solve_seconds=perf_counter() - begin,
            gap=gap,
            tolerance=self.tolerance,
            meshes=tuple(iterations),
            certificate=resolved.certificate if resolved else refinement.certificate(best),
            resolved=resolved is not None,
            multipliers=_multipliers(solutions[-1] if resolved else solutions[best])
            if is_fastest
            else None,
        )

    def _resolver(self, scaling: Scaling, model: DeltaModel, report: Progress) -> Resolver | None:
        """The method that resolves switches; None if the tolerance does not ask for it.

        It is imported here, so that plans to usual tolerances start faster.
        """
        if self.tolerance >= self.resolved_below:
            return None
        from deltaopt.planning.switching.resolver import resolver

        return resolver(scaling, model, self.tolerance, report)

    def _plan_effort(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan for an objective that contains effort, beginning with the fastest motion.

        Raises Infeasible if a given duration is too short or too long.
        """
        begin, scene = perf_counter(), attempt.scene
        fastest = self._before_effort(attempt)
        shortest, given = fastest.duration, scene.objective.given_duration
        if given is not None:
            require_possible(given, shortest, fastest.gap)
        guess = fastest.trajectory.slowed((given or shortest) / shortest)
        scaling = replace(
            scaling_to_duration(scene, shortest),
            extent=_extent(scene, guess),
            torque_share=attempt.torque_share,
        )
        problem = self._problem(guess.model, scaling, cost_to_minimise(scene.objective, scaling))
        slowed = Beginning(guess, replace(attempt, motion=guess).mesh)
        failure: DeltaOptError | None = None
        for start in beginnings(problem, scaling, slowed, self.intervals):
            first = Guess(start.guess, near=False, tolerance=self.accuracy)
            try:
                found = self._refined(attempt, first, start.mesh, scaling, report)
            except ENDS_AN_ATTEMPT as error:
                report(str(error))
                failure = failure or error
                continue
            if given is None and found.duration < scene.least_duration:
                report(f"once more, in the {scene.least_duration:.6g} s that rotation takes:")
                objective = Effort(duration=scene.least_duration)
                longer = scene.model_copy(update={"objective": objective})
                found = self._plan_effort(replace(attempt, scene=longer), report)
            return replace(found, scene=scene, solve_seconds=perf_counter() - begin)
        assert failure is not None
        if given is None or given >= shortest:
            raise failure
        raise Infeasible(
            f"duration is {given:g} s, as good as the fastest motion's {shortest:.6g} s, and no "
            f"motion was found that takes no longer: {failure}"
        ) from None

    def _before_effort(self, attempt: Attempt) -> Plan:
        """The fastest motion of a scene, to a usual tolerance."""
        quick, scene = TrajectoryOptimiser(), attempt.scene
        quickly = scene.model_copy(update={"objective": Time()})
        intervals = intervals_for(attempt.motion, quick.intervals) or attempt.intervals
        usual = scene.task.is_at_rest and not scene.task.gates
        planned = quick.plan if usual else quick.fastest
        return planned(replace(attempt, scene=quickly, intervals=intervals), lambda _: None)

    def _problem(self, model: DeltaModel, scaling: Scaling, cost: Cost) -> FormulatedProblem:
        """The problem, built once in a process for all models with the same terms and limits."""
        return _problem(
            self.problem_formulation,
            model.functions,
            self._transcription(scaling.scene),
            scaling.constraints,
            cost,
            self._solver,
        )

    @property
    def accuracy(self) -> float:
        """Relative tolerance of the solver on a first mesh."""
        return max(_FIRST_MESH_TOLERANCE, self.tolerance)

    @property
    def problem_formulation(self) -> ProblemFormulation:
        return problem_formulation(Flat() if self.formulation is None else self.formulation)

    @property
    def _solver(self) -> Solver:
        """The solver that was asked for, or else the fastest that the formulation has."""
        return self.solver or self.problem_formulation.solvers[0]()

    def _transcription(self, scene: Scene) -> PiecewiseAcceleration:
        has_effort = not isinstance(scene.objective, Time)
        return self.transcription or (SMOOTH if has_effort and not self._is_compiled else LINEAR)


def _extent(scene: Scene, motion: Trajectory) -> float | None:
    """The unit of length of a scene whose ends move, or that has phases: how far a motion goes."""
    has_own = isinstance(scene.task, MovingEnds) or bool(scene.task.gates)
    return motion.extent if has_own else None


def _safe(scene: Scene, trajectory: Trajectory, factor: float, status: str) -> Trajectory:
    """A motion slowed by a factor that keeps its limits, and until a fourth axis has turned.

    Raises NotConverged where no factor does.
    """
    if isinf(factor):
        raise HeldByMotion(
            "a limit is exceeded at rest, such as a torque limit by gravity alone, somewhere "
            "between the points of every mesh",
            status,
            trajectory,
        )
    slowed = trajectory.slowed(factor * _rounding_factor(scene))
    if slowed.duration >= scene.least_duration:
        return slowed
    waiting = safe_factor(scene, trajectory, at_least=scene.least_duration / trajectory.duration)
    if isinf(waiting):
        raise NotConverged(
            f"the motion takes {slowed.duration:.6g} s, less than rotation does, and slowed until "
            f"then ({scene.least_duration:.6g} s) it exceeds a limit",
            status,
            slowed,
        )
    return trajectory.slowed(waiting)


def _rounding_factor(scene: Scene) -> float:
    """Factor, just above 1, by which a motion is slowed to allow for rounding.

    Near a serial singularity torques are known only to rounding divided by the squared distance
    to it, so that two programs may differ by as much.
    """
    least = min(_KEPT_DISTANCE, float(serial_distances_at_ends(scene).min()) / 2)
    return 1 + float(np.finfo(float).eps) / least


def _require_one_side(scene: Scene, trajectory: Trajectory, status: str) -> None:
    """Raise CrossesSingularity where a motion passes through a parallel singularity."""
    if crosses_singularity(scene, trajectory):
        raise CrossesSingularity(
            "the motion found passes through a parallel singularity, which no torques allow",
            status,
            trajectory,
        )


def _best_of(solutions: Sequence[MeshSolution], iterations: Sequence[Iteration]) -> int:
    """The index of the mesh solution that is fastest once it keeps all limits. Where slowing helps
    none of them, that is the finest one that keeps its places: other attempts follow from why."""

    def merit(i: int) -> tuple[float, bool, int]:
        least = iterations[i].safe_duration if iterations[i].cost is None else iterations[i].gap
        return least, not solutions[i].needed.keeps_places, -i

    return min(range(len(iterations)), key=merit)


def _multipliers(found: MeshSolution) -> MeshMultipliers | None:
    """Of all limits on a mesh; with resolved switches those of the last mesh before."""
    limits, solution = found.scaling.limits, found.solution
    return MeshMultipliers(limits, solution.multipliers) if solution.all_at_points else None


@lru_cache(maxsize=32)
def _problem(
    formulation: ProblemFormulation,
    functions: DeltaFunctions,
    transcription: PiecewiseAcceleration,
    constraints: Constraints,
    cost: Cost,
    solver: Solver,
) -> FormulatedProblem:
    return formulation.of(functions, transcription, constraints, cost, solver)
