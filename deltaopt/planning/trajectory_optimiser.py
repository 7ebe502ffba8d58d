"""From one first motion to a plan: meshes that are refined, switches, and a motion that is safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from math import inf, isclose, isinf
from typing import TYPE_CHECKING

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import Formulation
from deltaopt.errors import ENDS_AN_ATTEMPT, DeltaOptError, Infeasible, NotConverged
from deltaopt.limits.running_cost import Running
from deltaopt.motion.limit_sensitivity import Multipliers
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory, moving_on
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.effort_planning import (
    SMOOTH,
    Beginning,
    beginnings,
    cost_to_minimise,
    far_and_near,
    fastest,
    in_longer_time,
    least_for_ramps,
    require_possible,
)
from deltaopt.planning.first_motions.around_bodies import leads_past
from deltaopt.planning.first_motions.order_of_merit import (
    CrossesSingularity,
    crosses_singularity,
    intervals_for,
)
from deltaopt.planning.formulations.choice import Flat, ProblemFormulation, Redundant
from deltaopt.planning.journal import Progress
from deltaopt.planning.mesh.first_mesh import motion_on_first_mesh
from deltaopt.planning.mesh.gap import (
    above_least,
    above_relaxed,
    record_of,
    with_cost_of_keeping,
    with_gap,
)
from deltaopt.planning.mesh.kept_limits import kept_or_slowed
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.nlp.problem import Cost, Formulated, Guess, InteriorPoint, Ipopt, Solver
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR, PiecewiseAcceleration
from deltaopt.planning.plan import Plan
from deltaopt.planning.refinement import Refinement
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.scene.feasibility import serial_distances_at_ends
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.settings import RESOLVED_BELOW

if TYPE_CHECKING:
    from deltaopt.planning.switching.resolver import SwitchResolver

_KEPT_DISTANCE = 1e-2
"""Squared distance to the serial singularities, sin² or cos² of an angle, that motions keep if
their start and goal do. Ends that are closer ask for a larger allowance for rounding."""
_LONG_REST = 12.0
"""Given durations over the fastest motion's above which Ipopt plans the least effort: over rests
that are longer the compiled method does not always find its way (up to 12 times it did in 72 of 72
moves of three scenes, at 14 times not always)."""
_FIRST_MESH_TOLERANCE = 1e-4
"""Tightest relative tolerance of the solver on the first mesh. Any tighter is wasted, for the
discretisation error of a coarse mesh is far larger."""
_TRIAL_TOLERANCE = 1e-2
"""The same where no more is asked than how fast about a motion is: of nine in ten ways past bodies
the duration is then within 0.3 %, less than a coarse mesh tells."""


@dataclass(frozen=True)
class TrajectoryOptimiser:
    """Finds the best motion of a scene that can be reached from a first one.

    The settings are those of `Planner`, whose defaults they share.
    """

    tolerance: float = 1e-3
    intervals: int = 16
    transcription: PiecewiseAcceleration | None = None
    formulation: ProblemFormulation | Formulation | None = None
    resolved_below: float = RESOLVED_BELOW
    solver: Solver | None = None

    def plan(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan the best motion from one first guess and one first mesh."""
        objective, given = attempt.scene.objective, attempt.scene.objective.given_duration
        is_free = bool(objective.functional.time)
        takes_as_long = given is not None and isclose(attempt.motion.duration, given)
        is_known = attempt.is_near and (is_free or takes_as_long)
        if isinstance(objective, Time) or is_known:
            return self.fastest(attempt, self.accuracy, report)
        return self._plan_effort(attempt, report)

    @property
    def _is_compiled(self) -> bool:
        """Whether plans are made by the interior-point method."""
        return isinstance(self._solver, InteriorPoint)

    def on_first_mesh(self, attempt: Attempt) -> Trajectory:
        """The fastest motion on the first mesh alone, which may break limits between its points."""
        accuracy = max(self.accuracy, _TRIAL_TOLERANCE)
        guess = Guess(attempt.motion, attempt.is_near, accuracy, is_trial=True)
        scaling = attempt.scaling(attempt.motion, attempt.motion.duration)
        program = self.program(scaling, fastest(attempt.problem))
        return motion_on_first_mesh(program, scaling, guess, attempt.mesh)

    def fastest(self, attempt: Attempt, accuracy: float, report: Progress) -> Plan:
        """Plan the fastest motion, or that of the least time and effort, from one first guess and
        one first mesh, which is solved to a relative tolerance, its ``accuracy``.

        The motion of the chosen mesh is slowed until it keeps every limit at all instants, or
        solved again with tighter limits where it cannot be slowed.
        """
        guess = Guess(
            attempt.motion,
            attempt.is_near,
            accuracy,
            on_its_mesh=attempt.on_twice_its_mesh,
            is_trial=attempt.most < inf,
        )
        scaling = attempt.scaling(attempt.motion, attempt.motion.duration)
        return self._refined(attempt, guess, attempt.mesh, scaling, report)

    def _refined(
        self, attempt: Attempt, guess: Guess, mesh: Array, scaling: Scaling, report: Progress
    ) -> Plan:
        """The plan that meshes lead to from a guess and a first mesh."""
        scene, problem = attempt.scene, attempt.problem
        is_fastest = not problem.objective.running
        refinement = Refinement(
            self.program(scaling, cost_to_minimise(scaling)),
            scaling,
            self.tolerance,
            self._resolver(scaling, report),
            report,
            attempt.most,
            partial(leads_past, scene),
        )
        resolved = refinement.from_guess(guess, mesh)
        meshes = refinement.meshes
        best = _best_of(meshes)
        if not problem.may_be_slowed:
            before = meshes[: best + 1]
            kept = kept_or_slowed(refinement.program, before[-1], self.tolerance)
            meshes, best = [*before, with_gap(kept, before)], best + 1
            report(str(record_of(meshes[best])))
        elif not resolved:
            meshes[best] = with_gap(meshes[best].exact(), meshes[:best])
        last = meshes[best]
        chosen = resolved or last
        if not (resolved or last.needed.keeps_places):
            raise NotConverged(
                "a limit of position is exceeded between the points of every mesh, however much it "
                "is tightened",
                chosen.status,
                chosen.trajectory,
            )
        _require_one_side(problem, chosen.trajectory, chosen.status)
        trajectory = chosen.trajectory
        if not problem.is_at_rest:
            trajectory = moving_on(problem, trajectory)
        elif is_fastest:
            trajectory = safe(scene, trajectory, chosen.safe_factor, chosen.status)
        gap = resolved.gap if resolved else last.gap
        if is_fastest and problem.is_at_rest and not problem.may_be_slowed:
            # Where tightening its limits does not converge, the last mesh's motion is slowed.
            gap = max(gap, above_relaxed(last, meshes[best - 1]))
        if not is_fastest:
            gap = with_cost_of_keeping(gap, last, meshes[best - 1])
            gap = max(gap, above_least(meshes[best - 1], refinement.meshes))
        if problem.least_duration and is_fastest:  # nothing is faster
            gap = min(gap, max(0.0, trajectory.duration / problem.least_duration - 1))
        spent = sum(each.solution.iterations for each in meshes)
        return Plan(
            scene=scene,
            trajectory=trajectory,
            formulation=self.problem_formulation.name,
            transcription=resolved.name if resolved else self._transcription(attempt.problem).name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.status,
            iterations=spent + (resolved.iterations if resolved else 0),
            gap=gap,
            tolerance=self.tolerance,
            meshes=tuple(map(record_of, meshes)),
            certificate=resolved.certificate if resolved else refinement.certificate(last),
            resolved=resolved is not None,
            multipliers=_multipliers(meshes[-1] if resolved else last) if is_fastest else None,
        )

    def _resolver(self, scaling: Scaling, report: Progress) -> SwitchResolver | None:
        """The method that resolves switches; None if the tolerance does not ask for it, or the
        problem's motions have no switches.

        It is imported here, so that plans to usual tolerances start faster.
        """
        if self.tolerance >= self.resolved_below or not scaling.problem.may_switch:
            return None
        from deltaopt.planning.switching.resolver import SwitchResolver

        return SwitchResolver(scaling, self.tolerance, report)

    def _plan_effort(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan for an objective that contains effort, beginning with the fastest motion.

        Raises Infeasible if a given duration is too short or too long.
        """
        fastest = self._before_effort(attempt)
        shortest = fastest.duration
        objective = attempt.scene.objective.after(shortest)
        scene = attempt.scene.model_copy(update={"objective": objective})
        attempt, given = replace(attempt, scene=scene), objective.given_duration
        if given is not None:
            require_possible(given, shortest, fastest.gap)
            is_effort = objective.rate is Running.EFFORT
            if given > _LONG_REST * shortest and self._is_compiled and is_effort:
                return replace(self, solver=Ipopt())._plan_effort(attempt, report)
        duration = given or shortest
        if attempt.problem.is_at_rest:
            guess = fastest.trajectory.slowed(duration / shortest)
        else:
            guess = in_longer_time(attempt.problem, fastest.trajectory, duration)
        scaling = attempt.scaling(guess, duration)
        program = self.program(scaling, cost_to_minimise(scaling))
        intervals = attempt.intervals
        if objective.rate.order == 3 and given is not None:
            intervals = max(intervals, least_for_ramps(given / shortest - 1))
        slowed = Beginning(guess, replace(attempt, motion=guess, intervals=intervals).mesh)
        starts = beginnings(scene, program, scaling, slowed, self.intervals)
        failure: DeltaOptError | None = None
        for start, near in far_and_near(starts, attempt.problem.together):
            first = Guess(start.guess, near, tolerance=self.accuracy)
            try:
                found = self._refined(attempt, first, start.mesh, scaling, report)
            except ENDS_AN_ATTEMPT as error:
                report(str(error))
                failure = failure or error
                continue
            if given is None and found.duration < scene.least_duration:
                report(f"once more, in the {scene.least_duration:.6g} s that rotation takes:")
                alone = objective.alone(scene.least_duration)
                longer = scene.model_copy(update={"objective": alone})
                found = self._plan_effort(replace(attempt, scene=longer), report)
            return replace(found, scene=scene)
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
        first = replace(attempt, scene=quickly, intervals=intervals)
        return quick.fastest(first, self.accuracy, lambda _: None)

    def program(self, scaling: Scaling, cost: Cost) -> Formulated:
        """The program, built once in a process for all problems with the same terms and limits."""
        return _program(
            self.problem_formulation,
            scaling.problem.model.functions,
            self._transcription(scaling.problem),
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
        """The formulation of the problem that a user means: one of the dynamics stands for the
        problem in all twelve coordinates."""
        asked = self.formulation or Flat()
        return Redundant(asked) if isinstance(asked, Formulation) else asked

    @property
    def _solver(self) -> Solver:
        """The solver that was asked for, or else the fastest that the formulation has."""
        return self.solver or self.problem_formulation.solvers[0]()

    def _transcription(self, problem: Problem) -> PiecewiseAcceleration:
        has_effort = problem.objective.running > 0
        return self.transcription or (SMOOTH if has_effort and not self._is_compiled else LINEAR)


def safe(scene: Scene, trajectory: Trajectory, factor: float, status: str) -> Trajectory:
    """A motion slowed by a factor that keeps its limits, and until a fourth axis has turned.

    Raises NotConverged where no factor does.
    """
    if isinf(factor):
        raise NotConverged(
            "a limit is exceeded at rest, such as a torque limit by gravity alone, somewhere "
            "between the points of every mesh",
            status,
            trajectory,
        )
    slowed = trajectory.slowed(factor * _rounding_factor(scene))
    if slowed.duration >= scene.least_duration:
        return slowed
    waiting = safe_factor(
        problem_of(scene), trajectory, at_least=scene.least_duration / trajectory.duration
    )
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


def _require_one_side(problem: Problem, trajectory: Trajectory, status: str) -> None:
    """Raise CrossesSingularity where a motion passes through a parallel singularity."""
    if crosses_singularity(problem, trajectory):
        raise CrossesSingularity(
            "the motion found passes through a parallel singularity, which no torques allow",
            status,
            trajectory,
        )


def _best_of(meshes: Sequence[MeshSolution]) -> int:
    """The index of the fastest mesh solution once it keeps all limits, or of effort that with the
    least gap of those that keep their places. Where slowing helps none, or none keeps its places,
    the finest: others follow from it."""

    def merit(i: int) -> tuple[bool, float, int]:
        found, least = meshes[i], meshes[i].safe_duration
        if found.problem.objective.running:
            least = max(found.gap, above_least(found, meshes))
        return not found.needed.keeps_places, least, -i

    return min(range(len(meshes)), key=merit)


def _multipliers(found: MeshSolution) -> Multipliers | None:
    """Of all limits on a mesh; with resolved switches those of the last mesh before."""
    limits, solution = found.scaling.limits, found.solution
    of_rows = partial(np.abs(solution.multipliers).sum, axis=(0, 1))
    return Multipliers(limits, of_rows) if solution.all_at_points else None


_program = lru_cache(maxsize=64)(ProblemFormulation.of)
