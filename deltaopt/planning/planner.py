"""From a scene to a motion that is safe, and known to be nearly the best for its objective."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isinf
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import DeltaOptError, NotConverged
from deltaopt.files.validated_record import Vector3
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.effort_planning import (
    SMOOTH,
    CostIteration,
    cost_to_minimise,
    minimise_effort,
    scaling_to_duration,
)
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import problem_formulation
from deltaopt.planning.mesh.mesh_solution import Iteration, gap_of, iteration_of
from deltaopt.planning.multistart import Optimum, distinct, first_motions
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import FormulatedProblem, Guess, ProblemFormulation, Solver
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR, PiecewiseAcceleration
from deltaopt.planning.refinement import Progress, Refinement, Resolver
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible, serial_distances_at_ends
from deltaopt.scene.objective import Objective, Time
from deltaopt.scene.scene import Limits, Scene

Array = NDArray[np.float64]
Pair = tuple[Vector3, Vector3]
"""Start and goal, m."""

RESOLVED_BELOW = 1e-4
"""Tolerances below this are met by resolving switches: finer meshes cost more and more."""
_RETRY_HALVES = 3
"""Halves of the intervals of the first mesh where a small gap was not reached: which structure
is read and which intervals are split depends on them."""
_KEPT_DISTANCE = 1e-2
"""Squared distance to a serial singularity that motions keep if their ends do."""
_FIRST_MESH_TOLERANCE = 1e-4
"""To which the first mesh is solved at most, whatever the tolerance: it is coarse."""


@dataclass(frozen=True)
class Plan:
    """A motion for a scene that keeps every limit between mesh points too.

    ``gap``: estimated excess of its cost, a duration as a rule, over the least possible, as a
    fraction; ``Iteration`` and ``minimise_effort`` say how it is estimated.
    ``meshes``: those it took. ``solve_seconds``: wall time of all of them.
    ``resolved``: whether its switches are. ``certificate``: how well Pontryagin's condition is
    met, by the prices on the arcs, or on the mesh where these tell.
    ``optima``: the distinct local minima that several starts led to, best first.
    """

    scene: Scene
    trajectory: Trajectory
    formulation: str
    transcription: str
    intervals: int
    status: str
    iterations: int
    solve_seconds: float
    gap: float
    tolerance: float
    meshes: tuple[Iteration, ...] | tuple[CostIteration, ...]
    certificate: Certificate | None
    resolved: bool = False
    optima: tuple[Optimum, ...] = ()

    @property
    def duration(self) -> float:
        """From start to goal, s."""
        return self.trajectory.duration

    @property
    def cost(self) -> float:
        """What the scene's objective measures, in its unit."""
        return cost_of(self.scene, self.trajectory)

    def save(self, directory: str | Path) -> list[Path]:
        """Verify, and write trajectory.csv, plan.json and plan.png; their paths."""
        from deltaopt.output.plan_files import (
            save,  # lies to the right: a convenience, not a dependence
        )
        from deltaopt.verify.verification import verify

        found = verify(self.scene, self.trajectory)
        return save(Path(directory), self.scene, self.trajectory, found, self)

    @property
    def within_tolerance(self) -> bool:
        """Whether the gap is as small as was asked for."""
        return self.gap <= self.tolerance


def plan(
    scene: Scene,
    *,
    tolerance: float = 1e-3,
    intervals: int = 16,
    transcription: PiecewiseAcceleration | None = None,
    formulation: ProblemFormulation | Multiplier | Projected | None = None,
    solver: Solver | None = None,
    starts: int = 1,
    seed: int = 1,
    progress: Progress | None = None,
) -> Plan:
    """The best motion of a scene: the fastest, unless its objective is another.

    ``formulation``: of the problem (flat by default, forward), or one of the dynamics, which
    stands for the problem in twelve coordinates: multiplier by eq. (37), the others by eq. (39).
    ``solver``: `InteriorPoint` or `Ipopt`; the first by default where the formulation has it.
    ``tolerance``: of the optimality gap. ``intervals``: of the first mesh, refined where time
    is given away until the gap is within the tolerance; below ``RESOLVED_BELOW`` the switches
    are resolved. ``starts``: from how many first guesses, all but the first of them random by
    ``seed``; the best motion is the plan. ``progress``: told after every mesh.

    Raises Unreachable, Infeasible or NotConverged.
    """
    planner = Planner(
        scene.robot,
        scene.payload,
        scene.limits,
        tolerance,
        intervals,
        transcription,
        formulation,
        objective=scene.objective,
        solver=solver,
    )
    return planner.plan_scene(scene, starts=starts, seed=seed, progress=progress)


@dataclass(frozen=True)
class Planner:
    """Plans for one robot. What does not depend on start, goal and payload is built once.

    ``payload``: kg, where a plan is not given one. ``tolerance``: of the optimality gap.
    ``intervals``: of the first mesh, refined until the gap is within the tolerance.
    ``resolved_below``: tolerances below this are met by resolving switches.
    ``objective``: what plans are the best in.
    """

    robot: Robot
    payload: float | None = None
    limits: Limits | None = None
    tolerance: float = 1e-3
    intervals: int = 16
    transcription: PiecewiseAcceleration | None = None
    formulation: ProblemFormulation | Multiplier | Projected | None = None
    resolved_below: float = RESOLVED_BELOW
    objective: Objective = field(default_factory=Time)
    solver: Solver | None = None

    def __post_init__(self) -> None:
        if not self.tolerance > 0:
            raise ValueError(f"tolerance is {self.tolerance}; it must be greater than 0")
        if self.solver and not isinstance(self.solver, self._formulation.solvers):
            raise ValueError(
                f"solver is {self.solver.name}, which solves the flat formulation only; "
                f"{self._formulation.name} is solved by ipopt"
            )
        if self.intervals < 2:
            raise ValueError(f"intervals is {self.intervals}; at least 2 are needed to stop again")

    def plan(
        self,
        start: Vector3,
        goal: Vector3,
        *,
        payload: float | None = None,
        starts: int = 1,
        seed: int = 1,
        progress: Progress | None = None,
    ) -> Plan:
        """The best motion from rest at start to rest at goal (m).

        ``payload``: kg, another than the planner's. ``starts``, ``seed``: see ``plan``.

        Raises Unreachable, Infeasible or NotConverged.
        """
        scene = Scene(
            robot=self.robot,
            payload=self.payload if payload is None else payload,
            start=start,
            goal=goal,
            limits=self.limits,
            objective=self.objective,
        )
        return self.plan_scene(scene, starts=starts, seed=seed, progress=progress)

    def plan_scene(
        self, scene: Scene, *, starts: int = 1, seed: int = 1, progress: Progress | None = None
    ) -> Plan:
        """The best motion of a scene, with this planner's settings.

        ``starts``, ``seed``: see ``plan``. Raises Unreachable, Infeasible or NotConverged.
        """
        check_feasible(scene)
        report = progress or (lambda _: None)
        guesses = self._guesses(scene, starts, seed)
        if starts == 1:
            return self._plan(scene, next(guesses), report)
        return self._best(scene, guesses, report)

    def _best(self, scene: Scene, guesses: Iterator[Guess], report: Progress) -> Plan:
        """The best of the plans from each first guess."""
        begin = perf_counter()
        plans: list[Plan] = []
        failures: list[NotConverged] = []
        for i, guess in enumerate(guesses, 1):
            report(f"start {i}:")
            try:
                plans.append(self._plan(scene, guess, report))
            except NotConverged as error:
                report(str(error))
                failures.append(error)
        if not plans:
            raise failures[0]
        length = float(np.linalg.norm(np.subtract(scene.goal, scene.start)))
        optima = distinct([(each.trajectory, each.cost, each.gap) for each in plans], length)
        best = min(plans, key=lambda each: each.cost)
        return replace(best, optima=tuple(optima), solve_seconds=perf_counter() - begin)

    def _plan(self, scene: Scene, guess: Guess, report: Progress) -> Plan:
        """From one first guess."""
        if not isinstance(scene.objective, Time):
            return self._plan_effort(scene, guess, report)
        found = self._fastest(scene, guess, report)
        if found.within_tolerance or self.tolerance >= self.resolved_below:
            return found
        other = replace(self, intervals=_RETRY_HALVES * self.intervals // 2)
        report(f"once more, from {other.intervals} intervals:")
        try:
            return quicker(found, other._fastest(scene, guess, report))
        except NotConverged as error:
            report(str(error))
            return found

    def _fastest(self, scene: Scene, guess: Guess, report: Progress) -> Plan:
        """From one first guess and one first mesh."""
        begin = perf_counter()
        model = delta_model(scene.robot, scene.payload)
        scaling = Scaling(scene, guess.trajectory.duration)
        refinement = Refinement(
            self._problem(model, scaling, FASTEST),
            scaling,
            model,
            self.tolerance,
            self._resolver(scaling, model, report),
            report,
        )
        resolved = refinement.from_guess(guess, self.intervals)
        solutions, iterations = refinement.solutions, refinement.iterations
        best = min(range(len(iterations)), key=lambda i: iterations[i].safe_duration)
        if not resolved:
            solutions[best] = solutions[best].exact()
            iterations[best] = iteration_of(solutions[: best + 1])
        chosen = resolved or solutions[best]
        if isinf(chosen.safe_factor):
            raise NotConverged(
                "a limit is exceeded at rest, such as a torque limit by gravity alone, somewhere "
                "between the points of every mesh",
                chosen.status,
                chosen.trajectory,
            )
        spent = sum(each.iterations for each in iterations)
        return Plan(
            scene=scene,
            trajectory=chosen.trajectory.slowed(chosen.safe_factor * _rounding_factor(scene)),
            formulation=self._formulation.name,
            transcription=resolved.name if resolved else self._transcription.name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.status,
            iterations=spent + (resolved.iterations if resolved else 0),
            solve_seconds=perf_counter() - begin,
            gap=resolved.gap if resolved else gap_of(iterations, best),
            tolerance=self.tolerance,
            meshes=tuple(iterations),
            certificate=resolved.certificate if resolved else refinement.certificate(best),
            resolved=resolved is not None,
        )

    def _resolver(self, scaling: Scaling, model: DeltaModel, report: Progress) -> Resolver | None:
        """What resolves switches, imported where the tolerance asks for it only; None where the
        scene has limits that arcs cannot hold."""
        if self.tolerance >= self.resolved_below:
            return None
        from deltaopt.planning.switching.resolver import resolver

        return resolver(scaling, model, self.tolerance, report)

    def _plan_effort(self, scene: Scene, guess: Guess, report: Progress) -> Plan:
        """From the fastest motion."""
        begin = perf_counter()
        quick = Planner(self.robot, self.payload, self.limits)
        fastest = quick._plan(scene.model_copy(update={"objective": Time()}), guess, lambda _: None)
        scaling = scaling_to_duration(scene, fastest.duration)
        cost = cost_to_minimise(scene.objective, scaling)
        problem = self._problem(fastest.trajectory.model, scaling, cost)
        found = minimise_effort(problem, fastest, self.intervals, self.tolerance, scaling, report)
        return Plan(
            scene=scene,
            trajectory=found.trajectory,
            formulation=self._formulation.name,
            transcription=self._transcription.name,
            intervals=len(found.trajectory.knots) - 1,
            status=found.solution.status,
            iterations=sum(each.iterations for each in found.meshes),
            solve_seconds=perf_counter() - begin,
            gap=found.gap,
            tolerance=self.tolerance,
            meshes=found.meshes,
            certificate=None,
        )

    def plan_many(self, pairs: Sequence[Pair], workers: int = 1) -> list[Plan | DeltaOptError]:
        """A plan for every (start, goal), or why there is none, in their order.

        ``workers``: processes; the results do not depend on their number.
        """
        if workers == 1:
            return [self._plan_or_error(pair) for pair in pairs]
        with ProcessPoolExecutor(workers) as pool:
            chunk = max(1, len(pairs) // (4 * workers))
            return list(pool.map(self._plan_or_error, pairs, chunksize=chunk))

    def _plan_or_error(self, pair: Pair) -> Plan | DeltaOptError:
        try:
            return self.plan(*pair)
        except DeltaOptError as error:
            return error

    def _guesses(self, scene: Scene, starts: int, seed: int) -> Iterator[Guess]:
        """Motions without optimisation."""
        for motion in first_motions(scene, starts, seed):
            yield Guess(motion, near=False, tolerance=max(_FIRST_MESH_TOLERANCE, self.tolerance))

    def _problem(self, model: DeltaModel, scaling: Scaling, cost: Cost) -> FormulatedProblem:
        """Built once in a process for all models with the same terms and limits."""
        return _problem(
            self._formulation,
            model.functions,
            self._transcription,
            scaling.constraints,
            cost,
            self._solver,
        )

    @property
    def _formulation(self) -> ProblemFormulation:
        return problem_formulation(self.formulation or Flat())

    @property
    def _solver(self) -> Solver:
        """The one that was asked for, or the fastest that the formulation has."""
        return self.solver or self._formulation.solvers[0]()

    @property
    def _transcription(self) -> PiecewiseAcceleration:
        usual = LINEAR if isinstance(self.objective, Time) else SMOOTH
        return self.transcription or usual


def quicker(one: Plan, other: Plan) -> Plan:
    """Of two plans for a scene, with the gap that both leave possible if they are near the same
    optimum, and the time that both took."""
    best, worse = sorted((one, other), key=lambda each: each.duration)
    shortest = worse.duration / (1 + worse.gap)
    return replace(
        best,
        gap=min(best.gap, best.duration / shortest - 1) if shortest <= best.duration else best.gap,
        iterations=one.iterations + other.iterations,
        solve_seconds=one.solve_seconds + other.solve_seconds,
    )


def _rounding_factor(scene: Scene) -> float:
    """Torques near a serial singularity are known to rounding over its distance only, whoever
    computes them."""
    least = min(_KEPT_DISTANCE, float(serial_distances_at_ends(scene).min()) / 2)
    return 1 + float(np.finfo(float).eps) / least


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
