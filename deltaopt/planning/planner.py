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
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.effort_planning import SMOOTH, CostRound, cost_to_minimise, least_cost
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import posed_as
from deltaopt.planning.initial_motion import between
from deltaopt.planning.mesh.mesh_solution import Round, gap_of, round_of
from deltaopt.planning.multistart import Optimum, distinct, first_motions
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import Guess, Pose, Posed
from deltaopt.planning.nlp.scaling import Scales, margin_of_fold
from deltaopt.planning.nlp.transcription import LINEAR, PiecewiseAcceleration
from deltaopt.planning.refinement import Progress, Search
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible, least_opening, reach_at_ends
from deltaopt.scene.objective import Objective, Time
from deltaopt.scene.scene import Limits, Scene

Array = NDArray[np.float64]
Pair = tuple[Vector3, Vector3]
"""Start and goal, m."""

RESOLVED_BELOW = 1e-4
"""Tolerances below this are met by resolving switches: finer meshes cost more and more."""
_OTHER = 3
"""Halves of the intervals of the first mesh where a small gap was not reached: which structure
is read and which intervals are split depends on them."""
_FIRST = 1e-4
"""To which the first mesh is solved at most, whatever the tolerance: it is coarse."""


@dataclass(frozen=True)
class Plan:
    """A motion for a scene that keeps every limit between mesh points too.

    ``gap``: estimated excess of its cost, a duration as a rule, over the least possible, as a
    fraction; ``Round`` and ``least_cost`` say how it is estimated.
    ``rounds``: the meshes it took. ``solve_seconds``: wall time of all of them.
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
    rounds: tuple[Round, ...] | tuple[CostRound, ...]
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
    formulation: Pose | Multiplier | Projected | None = None,
    starts: int = 1,
    seed: int = 1,
    progress: Progress | None = None,
) -> Plan:
    """The best motion of a scene: the fastest, unless its objective is another.

    ``formulation``: a pose (flat by default, forward), or a formulation of the dynamics, which
    is posed in twelve coordinates: multiplier by eq. (37), the others all by eq. (39).
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
    )
    return planner.plan(scene.start, scene.goal, starts=starts, seed=seed, progress=progress)


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
    formulation: Pose | Multiplier | Projected | None = None
    resolved_below: float = RESOLVED_BELOW
    objective: Objective = field(default_factory=Time)

    def __post_init__(self) -> None:
        if not self.tolerance > 0:
            raise ValueError(f"tolerance is {self.tolerance}; it must be greater than 0")
        if self.intervals < 2:
            raise ValueError(f"intervals is {self.intervals}; at least 2 are needed to stop again")

    def plan(
        self,
        start: Vector3,
        goal: Vector3,
        *,
        payload: float | None = None,
        near: Plan | None = None,
        starts: int = 1,
        seed: int = 1,
        progress: Progress | None = None,
    ) -> Plan:
        """The best motion from rest at start to rest at goal (m).

        ``payload``: kg, another than the planner's. ``near``: a plan for similar ends, to
        start from. ``starts``, ``seed``: see ``plan``.

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
        check_feasible(scene)
        tell = progress or (lambda _: None)
        guesses = self._guesses(scene, near, starts, seed)
        if starts == 1:
            return self._plan(scene, next(guesses), tell)
        return self._best(scene, guesses, tell)

    def _best(self, scene: Scene, guesses: Iterator[Guess], tell: Progress) -> Plan:
        """The best of the plans from each first guess."""
        begin = perf_counter()
        plans: list[Plan] = []
        failures: list[NotConverged] = []
        for i, guess in enumerate(guesses, 1):
            tell(f"start {i}:")
            try:
                plans.append(self._plan(scene, guess, tell))
            except NotConverged as error:
                tell(str(error))
                failures.append(error)
        if not plans:
            raise failures[0]
        length = float(np.linalg.norm(np.subtract(scene.goal, scene.start)))
        optima = distinct([(each.trajectory, each.cost, each.gap) for each in plans], length)
        best = min(plans, key=lambda each: each.cost)
        return replace(best, optima=tuple(optima), solve_seconds=perf_counter() - begin)

    def _plan(self, scene: Scene, guess: Guess, tell: Progress) -> Plan:
        """From one first guess."""
        if not isinstance(scene.objective, Time):
            return self._of_least_cost(scene, guess, tell)
        found = self._fastest(scene, guess, tell)
        if found.within_tolerance or self.tolerance >= self.resolved_below:
            return found
        other = replace(self, intervals=_OTHER * self.intervals // 2)
        tell(f"once more, from {other.intervals} intervals:")
        try:
            return quicker(found, other._fastest(scene, guess, tell))
        except NotConverged as error:
            tell(str(error))
            return found

    def _fastest(self, scene: Scene, guess: Guess, tell: Progress) -> Plan:
        """From one first guess and one first mesh."""
        begin = perf_counter()
        model = delta_model(scene.robot, scene.payload)
        search = Search(
            self._posed(model, FASTEST),
            Scales(scene, guess.trajectory.duration, least_opening(scene)),
            model,
            self.tolerance,
            self.tolerance < self.resolved_below,
            tell,
        )
        resolved = search.from_guess(guess, self.intervals)
        attempts, rounds = search.attempts, search.rounds
        best = min(range(len(rounds)), key=lambda i: rounds[i].safe_duration)
        if not resolved:
            attempts[best] = attempts[best].exact()
            rounds[best] = round_of(attempts[: best + 1])
        chosen = resolved or attempts[best]
        if isinf(chosen.safe_factor):
            raise NotConverged(
                "gravity alone exceeds a torque limit somewhere between the points of every mesh",
                chosen.status,
                chosen.trajectory,
            )
        return Plan(
            scene=scene,
            trajectory=chosen.trajectory.slowed(chosen.safe_factor * _for_rounding(scene)),
            formulation=self._pose.name,
            transcription=resolved.name if resolved else self._transcription.name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.status,
            iterations=sum(r.iterations for r in rounds) + (resolved.iterations if resolved else 0),
            solve_seconds=perf_counter() - begin,
            gap=resolved.gap if resolved else gap_of(rounds, best),
            tolerance=self.tolerance,
            rounds=tuple(rounds),
            certificate=resolved.certificate if resolved else search.certificate(attempts[best]),
            resolved=resolved is not None,
        )

    def _of_least_cost(self, scene: Scene, guess: Guess, tell: Progress) -> Plan:
        """From the fastest motion."""
        begin = perf_counter()
        quick = Planner(self.robot, self.payload, self.limits)
        fastest = quick._plan(scene.model_copy(update={"objective": Time()}), guess, lambda _: None)
        cost = cost_to_minimise(scene.objective, scene.torque_limits)
        posed = self._posed(fastest.trajectory.model, cost)
        found = least_cost(posed, fastest, self.intervals, self.tolerance, scene, tell)
        return Plan(
            scene=scene,
            trajectory=found.trajectory,
            formulation=self._pose.name,
            transcription=self._transcription.name,
            intervals=len(found.trajectory.knots) - 1,
            status=found.solution.status,
            iterations=sum(r.iterations for r in found.rounds),
            solve_seconds=perf_counter() - begin,
            gap=found.gap,
            tolerance=self.tolerance,
            rounds=found.rounds,
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

    def _guesses(self, scene: Scene, near: Plan | None, starts: int, seed: int) -> Iterator[Guess]:
        """The plan of similar ends, moved to these; or motions without optimisation."""
        if near is not None:
            model = delta_model(scene.robot, scene.payload)
            moved = between(near.trajectory, model, scene.start, scene.goal)
            yield Guess(moved, near=True, tolerance=self.tolerance)
            starts -= 1
        if starts > 0:
            for motion in first_motions(scene, starts, seed):
                yield Guess(motion, near=False, tolerance=max(_FIRST, self.tolerance))

    @property
    def _speed_is_limited(self) -> bool:
        in_scene = self.limits is not None and self.limits.speed is not None
        return in_scene or self.robot.speed_limits is not None

    def _posed(self, model: DeltaModel, cost: Cost) -> Posed:
        """Built once in a process for all models with the same terms."""
        return _posed(
            self._pose, model.functions, self._transcription, self._speed_is_limited, cost
        )

    @property
    def _pose(self) -> Pose:
        return posed_as(self.formulation or Flat())

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


def _for_rounding(scene: Scene) -> float:
    """Torques near a serial singularity are known to rounding over its distance only, whoever
    computes them."""
    reach = reach_at_ends(scene)
    least = min(margin_of_fold(float(reach[:, 3:].min())), float(reach.min()))
    return 1 + float(np.finfo(float).eps) / least


@lru_cache(maxsize=32)
def _posed(
    pose: Pose,
    functions: DeltaFunctions,
    transcription: PiecewiseAcceleration,
    speed: bool,
    cost: Cost,
) -> Posed:
    return pose.of(functions, transcription, speed=speed, cost=cost)
