"""Planning: from a scene to a motion that keeps every limit and whose optimality gap is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from math import inf, isfinite
from time import perf_counter
from typing import Any

import numpy as np

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import ENDS_AN_ATTEMPT, NO_PLAN, DeltaOptError, Infeasible, if_possible
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Motion, PiecewisePolynomial, Trajectory
from deltaopt.planning.belt_places import PlacesOnBelt
from deltaopt.planning.first_motions.around_bodies import (
    CLEAR,
    clear_motions,
    is_clear,
    name_of_way,
)
from deltaopt.planning.first_motions.belt import not_met
from deltaopt.planning.first_motions.initial_motion import has_time_to_wait
from deltaopt.planning.first_motions.moving_ends import (
    first_moving_motions,
    from_state_to_state,
    intervals_after_waiting,
)
from deltaopt.planning.first_motions.multistart import distinct, first_motions
from deltaopt.planning.first_motions.order_of_merit import first_motion, intervals_for
from deltaopt.planning.first_motions.passages import paths_of_lines
from deltaopt.planning.first_motions.through_gates import through_gates
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.in_flight import finished_first
from deltaopt.planning.links_clear import keeping_links_clear
from deltaopt.planning.nlp.problem import ProblemFormulation, Solver
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.path.path_along import (
    fastest_along,
    near_corners,
    through_corners,
)
from deltaopt.planning.path.path_planning import NAME as ON_PATH
from deltaopt.planning.path.path_planning import PathMotion, fastest_on_path
from deltaopt.planning.plan import Optimum, Plan, TakenWay, quicker
from deltaopt.planning.refinement import Progress
from deltaopt.planning.search import FINER, Attempt, Search
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from deltaopt.planning.ways import NEARLY, fastest_way
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible, require_path_on_one_side
from deltaopt.scene.moving_ends import Anywhere, End, Start, State
from deltaopt.scene.objective import Objective, Time
from deltaopt.scene.scene import Limits, Scene, limits_of
from deltaopt.scene.task import MovingEnds, OnPath, distance
from deltaopt.settings import (
    LEAST_TOLERANCE,
    MOST,
    MOST_INTERVALS,
    RESOLVED_BELOW,
    require_positive,
    require_type,
    require_whole,
)

_ALONG = 1001
"""Instants at which a given path whose plan misses its tolerance is looked at for a singularity."""
_PATHS = 2
"""How many paths of straight lines are planned along where no mesh finds its way: over few places,
and over more of them. Each takes a second or two."""
_IMPROVED, _SHORTER = 4, 1e-4
"""How many plans at most then begin with the motion found, each with that of the one before; and by
what share each must be shorter, or else tell a smaller gap."""
Pair = tuple[Vector3, Vector3]
"""Start and goal, m."""

_USUAL, _ANOTHER_WAY_ABOVE = 1e-3, 3e-3
"""Tolerances of at least the first are to be met, or planning starts again from another first
motion. Where a tighter one is missed it does so above the second: smaller gaps are not the first
motion's fault, and planning again seldom changes them."""

_AT_REST = 1e-8
"""Share of the largest speed at a motion's knots, below which an instant of it counts as rest. At
the very end of a motion rounding leaves a speed; a stop from there would take 1e-15 s, which no
solver resolves. It is far below what verification sees."""
_SHORTEST_WAY = 1e-11
"""Least way of a motion with moving ends, m: a hundred thousand times the rounding of coordinates.
Of a shorter one, as 1e-7 s before the end of another, verification cannot tell speeds."""

FORMULATIONS_EXPECTED = (
    "deltaopt.flat, deltaopt.forward, or a formulation of the dynamics such as deltaopt.explicit"
)
"""What a setting ``formulation`` may be."""


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
    """Plan the best motion of a scene: the fastest, unless the scene has another objective.

    ``tolerance``: relative optimality gap to reach, at least 1e-9. ``intervals``: number of the
    first mesh, 2 to 1000, which is refined where time is lost until the gap is within the
    tolerance; below ``RESOLVED_BELOW`` the instants of switching are resolved.
    ``formulation``: of the problem (flat by default, or forward), or of the dynamics: that stands
    for the problem in twelve coordinates, Multiplier by eq. (37) and the others by eq. (39).
    ``transcription``: polynomial degree of the acceleration in an interval.
    ``solver``: `InteriorPoint` or `Ipopt`; the first by default where the formulation has it.
    ``starts``: number of first guesses, distinct ways and then random ones with ``seed``; the best
    motion is returned. ``progress``: is called with a line of text after every mesh.

    Raises Unreachable, Singular or Infeasible if start or goal rule a motion out, NotConverged if
    the solver finds none, and ValueError or TypeError for settings that make no sense.
    """
    require_type("scene", scene, Scene, "a Scene, such as load_scene returns")
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
    """Plans motions of one robot with the same settings.

    Equations and compiled code depend neither on start and goal nor on the payload's mass: they
    are built once in a process. ``payload``: kg, unless a plan is given another. ``limits``: of
    the scenes, beside those of the drive. ``resolved_below``: tolerance below which the instants of
    switching are resolved; 0 for never. ``objective``: of the scenes that are made from start and
    goal. The other settings are those of ``plan``.

    Raises ValueError or TypeError for settings that make no sense.
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
        require_positive("tolerance", self.tolerance, LEAST_TOLERANCE)
        require_whole("intervals", self.intervals, 2, "to stop again", MOST_INTERVALS)
        self._check_types()
        if self.solver and not isinstance(self.solver, self._optimiser.problem_formulation.solvers):
            raise ValueError(
                f"solver is {self.solver.name}, which solves the flat formulation only; "
                f"{self._optimiser.problem_formulation.name} is solved by ipopt"
            )

    def _check_types(self) -> None:
        """Raise TypeError for a setting that is no value of its kind, such as its name."""
        forms = ProblemFormulation | Multiplier | Projected
        if self.formulation is not None:
            require_type("formulation", self.formulation, forms, FORMULATIONS_EXPECTED)
        if self.solver is not None:
            expected = "deltaopt.interior_point or deltaopt.ipopt"
            require_type("solver", self.solver, Solver, expected)
        if self.transcription is not None:
            expected = "deltaopt.PiecewiseAcceleration(degree)"
            require_type("transcription", self.transcription, PiecewiseAcceleration, expected)

    def plan(
        self,
        start: Start | Motion,
        goal: End,
        *,
        payload: float | tuple[float, float] | None = None,
        starts: int = 1,
        seed: int = 1,
        progress: Progress | None = None,
    ) -> Plan:
        """Plan the best motion from rest at ``start`` to rest at ``goal``, both in m.

        An end that moves is a `State`, or a `Belt` as the goal. ``start`` may also be an instant of
        a motion, such as ``plan.trajectory(0.05)``: the new motion begins in that state, and never
        takes longer than finishing the old motion and then moving from rest to rest, if the goal is
        a point. ``payload``: kg, or the least and the largest, instead of the planner's.
        ``starts``, ``seed``, ``progress`` and the errors raised: as of the function ``plan``.
        """
        begun, at = (start, _state_of(start)) if isinstance(start, Motion) else (None, start)
        mass: Any = self.payload if payload is None else payload  # a scene takes a range apart
        scene = Scene(
            robot=self.robot,
            payload=mass,
            start=at,
            goal=goal,
            limits=self.limits,
            objective=self.objective,
        )
        return self.plan_scene(scene, start=begun, starts=starts, seed=seed, progress=progress)

    def stop(
        self,
        state: State | Motion,
        *,
        payload: float | tuple[float, float] | None = None,
        progress: Progress | None = None,
    ) -> Plan:
        """Plan the fastest stop: from a state, or an instant of a motion, to rest anywhere.

        Raises SceneError for a state at rest; the other errors are those of ``plan``.
        """
        return self.plan(state, Anywhere(), payload=payload, progress=progress)

    def plan_scene(
        self,
        scene: Scene,
        *,
        start: Motion | None = None,
        starts: int = 1,
        seed: int = 1,
        progress: Progress | None = None,
    ) -> Plan:
        """Plan the best motion of a scene with this planner's settings.

        ``start``: an instant of a motion in which the new one begins, instead of the scene's start;
        as in ``plan``, but with all that a scene asks for, such as bodies to keep clear of.
        ``starts``, ``seed``, ``progress`` and the errors raised: as of the function ``plan``.
        """
        require_whole("starts", starts, 1, most=MOST)
        require_whole("seed", seed, 0)
        under_way = None
        if start is not None:
            scene = scene.model_copy(update={"start": _state_of(start)})
            under_way = _rest_of(start)
        if scene.least_payload is not None:
            self._require_flat("with one payload")
        check_feasible(scene)
        report = progress or (lambda _: None)
        if not (scene.robot_keeps_clear and scene.keep_out):
            return self._plan_by_limits(scene, under_way, starts, seed, report)
        begin = perf_counter()
        found, lost = keeping_links_clear(
            scene,
            lambda limited: self._plan_by_limits(limited, under_way, starts, seed, report),
            self.tolerance,
            report,
        )
        spent = perf_counter() - begin
        return replace(found, scene=scene, gap=found.gap + lost, solve_seconds=spent)

    def _plan_by_limits(
        self,
        scene: Scene,
        under_way: PiecewisePolynomial | None,
        starts: int,
        seed: int,
        report: Progress,
    ) -> Plan:
        """Plan a scene that is feasible, of arms and forearms with those alone clear of bodies that
        are planned to be. ``under_way``: what would follow the start, if that is known."""
        task = scene.task
        if isinstance(task, OnPath):
            return self._plan_on_path(scene, task, starts, report)
        if isinstance(task, MovingEnds):
            self._require_free(starts)
            return _resolvable(self._plan_moving(scene, under_way, report))
        if task.gates:
            what = "via points" if task.via else "an approach"
            self._require_flat(f"without {what}")
            there = "are" if task.via else "is"
            self._require_one_start(starts, f"where there {there} {what}")
            return _resolvable(_or_raise(self._first_found(scene, through_gates(scene), report)))
        if scene.tube is not None:
            self._require_one_start(starts, "in a tube, where the path timed optimally is first")
        if starts == 1 and limits_of(scene).constraints.has_convex:
            return self._past_bodies(scene, report)
        if starts == 1:
            return self._search(scene, report)
        motions = first_motions(scene, starts, seed)
        if limits_of(scene).constraints.has_convex:
            motions = clear_motions(scene, motions, starts)
        return self._best(scene, motions, report)

    def _search(self, scene: Scene, report: Progress) -> Plan:
        """Plan from first motions in order of merit, until a plan is within the tolerance; then
        from the best of them on finer meshes. Returns the best plan if none is.

        Raises Unreachable if there is no first motion, NotConverged if none leads to a plan.
        """
        begin = perf_counter()
        search = self._new_search(scene)
        self._make(search.attempts(), search, report)
        best = search.best()
        if search.tried == 1:
            return best
        return replace(best, optima=_optima(search), solve_seconds=perf_counter() - begin)

    def _new_search(self, scene: Scene) -> Search[Plan]:
        return Search(
            scene,
            self.intervals,
            accuracy=self._optimiser.accuracy,
            tolerance=inf if has_time_to_wait(scene) else self._good_gap,
        )

    @property
    def _good_gap(self) -> float:
        """Gap above which planning starts again from another first motion."""
        return self.tolerance if self.tolerance >= _USUAL else _ANOTHER_WAY_ABOVE

    def _make(self, attempts: Iterator[Attempt], search: Search[Plan], report: Progress) -> None:
        """Make attempts, and tell the search that they are from what came of each."""
        for attempt in attempts:
            if search.tried:
                report(f"{attempt}:")
            try:
                found = self._optimiser.plan(attempt, report)
                search.found(replace(found, scene=search.scene))
            except ENDS_AN_ATTEMPT as error:
                report(str(error))
                search.failed(error)

    def _require_free(self, starts: int) -> None:
        """Raise ValueError for settings that do not go with ends that move."""
        self._require_flat("from rest to rest")
        self._require_one_start(starts, "where an end moves")

    def _require_one_start(self, starts: int, where: str) -> None:
        if starts > 1:
            raise ValueError(f"starts is {starts}; it has no effect {where}")

    def _require_flat(self, others_plan: str) -> None:
        """Raise ValueError where another formulation was asked for, and say what these plan."""
        if not isinstance(self._optimiser.problem_formulation, Flat):
            name = self._optimiser.problem_formulation.name
            raise ValueError(
                f"formulation is {name}, which plans {others_plan} alone; the flat formulation "
                "plans this scene"
            )

    def _plan_moving(
        self, scene: Scene, under_way: PiecewisePolynomial | None, report: Progress
    ) -> Plan:
        """Plan the fastest motion where an end moves, from the first guess that leads to one.

        ``under_way``: what would follow the start. Raises NotConverged.
        """
        if scene.task.gates:
            found = self._first_found(scene, through_gates(scene), report)
        else:
            found = self._moving_past_bodies(scene, report) or self._first_found(
                scene, first_moving_motions(scene, under_way), report
            )
        found = self._onto_belt(scene, found, report)
        if under_way is None:
            return _or_raise(found)
        finished = finished_first(
            scene,
            under_way,
            found if isinstance(found, Plan) else None,
            self.tolerance,
            planned=lambda rest: self._plan_by_limits(rest, None, 1, 1, lambda _: None),
            roughly=self._roughly,
        )
        return _or_raise(finished or found)

    def _onto_belt(
        self, scene: Scene, found: Plan | DeltaOptError, report: Progress
    ) -> Plan | DeltaOptError:
        """What was ``found``, if it is good enough or no goal on a belt is met from rest; otherwise
        the better of it and a plan by way of places that the belt passes."""
        if isinstance(found, Plan) and found.gap <= self._good_gap:
            return found

        def planned(passed: Scene) -> Plan | DeltaOptError:
            return self._first_found(passed, first_moving_motions(passed, None), lambda _: None)

        places = PlacesOnBelt.of(scene, planned)
        if places is None:
            return found
        report("once more, by way of places that the belt passes:")
        other = self._first_found(scene, places.motions(), report)
        if isinstance(found, Plan):
            return quicker(found, other) if isinstance(other, Plan) else found
        return other if isinstance(other, Plan) else places.told(found)

    def _roughly(self, scene: Scene) -> float:
        """The duration of the motion on the first mesh of a scene from rest to rest, as if there
        were neither bodies nor via points, s; 0 where none is found."""
        scene = scene.model_copy(update={"keep_out": None, "planned_links": (), "via": None})

        def on_first_mesh() -> float:
            motion, accuracy = first_motion(scene), self._optimiser.accuracy
            attempt = Attempt(scene, motion, self.intervals, accuracy)
            return self._optimiser.on_first_mesh(attempt).duration

        return if_possible(NO_PLAN, on_first_mesh) or 0.0

    def _moving_past_bodies(self, scene: Scene, report: Progress) -> Plan | None:
        """The best plan of the ways past keep-out bodies where an end moves; None where none is in
        the way, or none leads to a plan."""
        first = from_state_to_state(scene) if limits_of(scene).constraints.has_convex else None
        if first is None or is_clear(scene, first):
            return None
        begin = perf_counter()
        try:
            found, taken = self._fastest_way(scene, first, None, self._good_gap, report)
        except (Infeasible, *ENDS_AN_ATTEMPT) as error:  # other first motions may lead to a plan
            report(str(error))
            return None
        return replace(found, scene=scene, ways=taken, solve_seconds=perf_counter() - begin)

    def _fastest_way(
        self,
        scene: Scene,
        first: Trajectory,
        free: Trajectory | None,
        enough: float,
        report: Progress,
    ) -> tuple[Plan, tuple[TakenWay, ...]]:
        """As ``fastest_way``, from a first motion."""

        def planned(attempt: Attempt) -> Plan:
            search = self._new_search(attempt.scene)
            self._make(search.with_remedies(attempt), search, report)
            return search.best()

        way = Attempt(scene, first, self.intervals, self._optimiser.accuracy)
        return fastest_way(way, free, planned, self._optimiser.on_first_mesh, enough)

    def _first_found(
        self, scene: Scene, motions: Iterator[Trajectory], report: Progress
    ) -> Plan | DeltaOptError:
        """The first plan that is good enough from some motions, on the coarsest mesh on which they
        stay in the workspace and then on finer ones; the best plan if none is, or the first
        error."""
        search, tried = self._new_search(scene), list[Attempt]()

        def attempts() -> Iterator[Attempt]:
            for motion in motions:
                intervals = intervals_after_waiting(motion, self.intervals)
                intervals = intervals_for(motion, intervals) or intervals
                tried.append(Attempt(scene, motion, intervals, self._optimiser.accuracy))
                yield from search.with_remedies(tried[-1])
            twice = FINER[0]  # finer ones take minutes where there is no such motion
            yield from (replace(each, intervals=twice * each.intervals) for each in tried)

        failures = list[DeltaOptError]()
        for attempt in attempts():
            try:
                search.found(replace(self._optimiser.fastest(attempt, report), scene=scene))
            except ENDS_AN_ATTEMPT as error:
                report(str(error))
                failures.append(error)
                search.failed(error)
            if search.plans and search.plans[-1].gap <= self._good_gap:
                break
        if search.plans:
            return _best_known(search)
        none = Infeasible("no simple motion through all given points stays within reach")
        return not_met(scene, len(tried), failures[0]) if failures else none

    def _plan_on_path(self, scene: Scene, task: OnPath, starts: int, report: Progress) -> Plan:
        """Plan the fastest motion on the path that a scene gives: there is one, and no guess.

        Raises ValueError for settings of free paths.
        """
        settings = {
            "formulation": self.formulation,
            "solver": self.solver,
            "transcription": self.transcription,
            "starts": starts if starts > 1 else None,
        }
        for name, value in settings.items():
            if value is not None:
                raise ValueError(f"{name} is {value}; it has no effect where the path is given")
        begin = perf_counter()
        found = fastest_on_path(scene, task, self.tolerance, report)
        if found.gap > self.tolerance:  # which no mesh mends where torques grow without bound
            position = found.trajectory.position
            first, last = position.knots[[0, -1]].tolist()
            require_path_on_one_side(scene, position.at(np.linspace(first, last, _ALONG)))
        return replace(self._on_path(scene, found), solve_seconds=perf_counter() - begin)

    def _on_path(self, scene: Scene, found: PathMotion) -> Plan:
        """The plan of a motion on a path."""
        return Plan(
            scene=scene,
            trajectory=found.trajectory,
            formulation="path",
            transcription=ON_PATH,
            intervals=len(found.trajectory.knots) - 1,
            status="Swept",
            iterations=len(found.iterations),
            solve_seconds=0.0,
            gap=found.gap,
            tolerance=self.tolerance,
            meshes=found.iterations,
            certificate=None,
            multipliers=found.multipliers,
        )

    def _best(self, scene: Scene, motions: Iterator[Trajectory], report: Progress) -> Plan:
        """Plan from every first motion and return the best plan, with all local minima.

        Where one fails the others are tried. Raises the first error if none leads to a plan.
        """
        begin, search = perf_counter(), self._new_search(scene)
        for i, motion in enumerate(motions, 1):
            report(f"start {i}:")
            attempt = search.from_motion(motion)
            if attempt:
                self._make(search.with_remedies(attempt), search, report)
        best = _best_known(search)
        return replace(best, optima=_optima(search), solve_seconds=perf_counter() - begin)

    def _past_bodies(self, scene: Scene, report: Progress) -> Plan:
        """Plan past keep-out bodies: as if there were none, where that motion is clear of all;
        otherwise the best plan of the ways that are found, with all of these.

        Raises Infeasible where there is no way, and NotConverged where none leads to a plan.
        """
        begin = perf_counter()
        motion: Trajectory | None = None
        try:
            without = {"keep_out": None, "planned_links": ()}
            free = self._search(scene.model_copy(update=without), report)
            motion = free.trajectory
            if is_clear(scene, motion):
                return replace(free, scene=scene, ways=(TakenWay(CLEAR, free.duration, True),))
        except ENDS_AN_ATTEMPT as error:
            report(str(error))
        if scene.tube is not None:  # no way around a body but in it
            return self._search(scene, report)

        try:
            found, taken = self._fastest_way(scene, first_motion(scene), motion, NEARLY, report)
        except ENDS_AN_ATTEMPT as error:
            found = self._through_passages(scene, error, report)
            taken = (TakenWay(name_of_way(scene, found.trajectory), found.duration, True),)
        return replace(found, scene=scene, ways=taken, solve_seconds=perf_counter() - begin)

    def _through_passages(self, scene: Scene, error: DeltaOptError, report: Progress) -> Plan:
        """Plan along short paths of straight lines past bodies, where no mesh finds its way: near
        their corners, or on a path itself.

        Through a passage of a few millimetres a solution on a mesh may lead through a wall between
        two of its points, and never come back. Where that is so from the best motion along these
        lines too, it is not known how much faster another one is: the gap is infinite. Raises the
        error where there is no motion along them.
        """
        usual = isinstance(scene.objective, Time) and not scene.planned_links and scene.tube is None
        usual = usual and isinstance(self._optimiser.problem_formulation, Flat)
        found = list[Plan]()
        for corners in islice(paths_of_lines(scene), _PATHS) if usual else ():
            report("near the corners of a path of straight lines:")
            for gates in (near_corners(scene, corners), through_corners(scene, corners)):
                through = if_possible(NO_PLAN, self.plan_scene, gates, progress=report)
                if through is not None and is_clear(scene, through.trajectory):
                    found.append(through)
            timed = fastest_along(scene, corners, self.tolerance)
            if timed is not None:
                report(f"on that path: {timed.trajectory.duration:.6g} s")
                found.append(self._on_path(scene, timed))
        if not found:
            raise error
        found = [
            replace(each, scene=scene, gap=inf, certificate=None, multipliers=None)
            for each in sorted(found, key=_duration)
        ]
        improved = (self._improved(scene, each, report) for each in found)
        known = next((each for each in improved if isfinite(each.gap)), found[0])
        return min(found[0], known, key=_duration)

    def _improved(self, scene: Scene, found: Plan, report: Progress) -> Plan:
        """A plan that begins with the motion of another, on the mesh of that, as often as this
        makes it better; the other one where that is not possible. A mesh whose knots are where
        bodies are passed closely does not lead through them."""
        for _ in range(_IMPROVED):
            report("from that motion, on its mesh:")
            attempt = Attempt(
                scene,
                found.trajectory,
                len(found.trajectory.knots) - 1,
                self._optimiser.accuracy,
                is_near=True,
                on_its_mesh=True,
            )
            try:
                better = self._optimiser.fastest(attempt, report)
            except ENDS_AN_ATTEMPT as error:
                report(str(error))
                break
            shorter = better.duration < (1 - _SHORTER) * found.duration
            if not shorter and (better.duration > found.duration or better.gap >= found.gap):
                break
            if not is_clear(scene, better.trajectory):
                break
            found = better
            if found.gap <= self._good_gap:
                break
        return found

    def plan_many(
        self,
        pairs: Sequence[Pair],
        workers: int = 1,
        progress: Callable[[int], None] | None = None,
    ) -> list[Plan | DeltaOptError]:
        """Plan every pair (start, goal), m; a plan or the error that prevented it, in their order.

        ``workers``: number of processes; results do not depend on it. ``progress``: is called with
        the number of pairs that are done, such as ``ProgressBar().counting(len(pairs), "moves")``.
        """
        tell = progress or (lambda done: None)
        if workers == 1:
            return _counted(map(self._plan_or_error, pairs), tell)
        with ProcessPoolExecutor(workers) as pool:
            chunk = max(1, len(pairs) // (4 * workers))
            return _counted(pool.map(self._plan_or_error, pairs, chunksize=chunk), tell)

    def _plan_or_error(self, pair: Pair) -> Plan | DeltaOptError:
        try:
            return self.plan(*pair)
        except DeltaOptError as error:
            return error

    @cached_property
    def _optimiser(self) -> TrajectoryOptimiser:
        """What plans from one first motion, with these settings."""
        return TrajectoryOptimiser(
            self.tolerance,
            self.intervals,
            self.transcription,
            self.formulation,
            self.resolved_below,
            self.solver,
        )


def _duration(plan: Plan) -> float:
    return plan.duration


def _resolvable(found: Plan) -> Plan:
    """The plan itself; raises Infeasible where its motion is too short for double precision."""
    way = found.trajectory.extent
    if way < _SHORTEST_WAY:
        raise Infeasible(
            f"the motion is {way:.1e} m long, which coordinates in double precision cannot "
            f"resolve; at least {_SHORTEST_WAY:g} m are needed"
        )
    return found


def _or_raise(found: Plan | DeltaOptError) -> Plan:
    """The plan that is found; raises the error that is found instead of one."""
    if isinstance(found, Plan):
        return found
    raise found


def _state_of(motion: Motion) -> State:
    """The state of a motion at its only instant. Raises ValueError where it has several."""
    if len(motion.t) != 1:
        raise ValueError(f"start has {len(motion.t)} instants; one is needed")
    trajectory, v = motion.under_way, motion.v[0]
    if trajectory is not None:
        speeds = np.linalg.norm(trajectory.position.derivative().at(trajectory.knots), axis=1)
        v = np.where(np.linalg.norm(v) <= _AT_REST * speeds.max(), 0.0, v)
    return State(at=tuple(motion.x[0].tolist()), velocity=tuple(v.tolist()))


def _rest_of(motion: Motion) -> PiecewisePolynomial | None:
    """What follows an instant of the motion that it belongs to; None where that is not known."""
    trajectory, t = motion.under_way, float(motion.t[0])
    if trajectory is None or not trajectory.knots[0] <= t < trajectory.knots[-1]:
        return None
    return trajectory.position.after(t)


def _best_known(search: Search[Plan]) -> Plan:
    """The best plan of a search. Where it misses its tolerance, another that is hardly longer may
    know better how near it is to the optimum."""
    best = search.best()
    if best.within_tolerance or not isinstance(search.scene.objective, Time):
        return best
    return replace(best, gap=min(quicker(best, each).gap for each in search.plans))


def _optima(search: Search[Plan]) -> tuple[Optimum, ...]:
    """The distinct local minima that a search has found, best first."""
    found = [(each.trajectory, each.cost, each.gap) for each in search.plans]
    return tuple(distinct(found, distance(search.scene.task)))


def _counted(
    outcomes: Iterable[Plan | DeltaOptError], tell: Callable[[int], None]
) -> list[Plan | DeltaOptError]:
    """All outcomes; how many there are is told as they come."""
    found = []
    for each in outcomes:
        found.append(each)
        tell(len(found))
    return found
