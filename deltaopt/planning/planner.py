"""Planning: from a scene to a motion that keeps every limit and whose optimality gap is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from math import inf, isinf
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import DeltaOptError, Infeasible, NotConverged, Singular, Unreachable
from deltaopt.files.html_table import html_table
from deltaopt.files.validated_record import Vector3
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.active_limits import active_limits
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.effort import cost as cost_of
from deltaopt.motion.limit_sensitivity import (
    LimitSensitivity,
    MeshMultipliers,
    Multipliers,
    limit_sensitivities,
    limits_in_words,
)
from deltaopt.motion.sure_bounds import sure_excess
from deltaopt.motion.time_scaling import highest_rows, safe_factor
from deltaopt.motion.trajectory import Motion, PiecewisePolynomial, Trajectory, moving_on, passes
from deltaopt.planning.effort_planning import (
    SMOOTH,
    CostIteration,
    cost_to_minimise,
    minimise_effort,
    scaling_to_duration,
)
from deltaopt.planning.first_motions import (
    CrossesSingularity,
    crosses_singularity,
    first_motion,
    intervals_for,
)
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.formulations.choice import problem_formulation
from deltaopt.planning.initial_motion import baseline
from deltaopt.planning.lower_bound import lower_bound
from deltaopt.planning.mesh.kept_limits import KEPT, kept
from deltaopt.planning.mesh.mesh_solution import (
    Iteration,
    MeshSolution,
    gap_of,
    iteration_of,
    solve_first_mesh,
)
from deltaopt.planning.mesh.reversals import softer_scenes
from deltaopt.planning.moving_ends import (
    end_of,
    first_moving_motions,
    from_rest,
    through_gates,
)
from deltaopt.planning.multistart import Optimum, distinct, first_motions
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
from deltaopt.planning.path.path_over_bodies import rounded_path_over
from deltaopt.planning.path.path_planning import NAME as ON_PATH
from deltaopt.planning.path.path_planning import fastest_on_path
from deltaopt.planning.path.path_timing import PathIteration
from deltaopt.planning.refinement import Progress, Refinement, Resolver
from deltaopt.planning.search import Attempt, HeldByMotion, Search
from deltaopt.planning.settings import MOST, require_positive, require_type, require_whole
from deltaopt.planning.ways import CLEAR, TakenWay, fastest_way
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.feasibility import check_feasible, serial_distances_at_ends
from deltaopt.scene.moving_ends import Anywhere, End, Start, State
from deltaopt.scene.objective import Effort, Objective, Time
from deltaopt.scene.path import Line
from deltaopt.scene.scene import Limits, Scene, limits_of
from deltaopt.scene.task import MovingEnds, OnPath, RestAnywhere, distance, given_points

Array = NDArray[np.float64]
Pair = tuple[Vector3, Vector3]
"""Start and goal, m."""

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


_USUAL, _ANOTHER_WAY_ABOVE = 1e-3, 3e-3
"""Tolerances of at least the first are to be met, or planning starts again from another first
motion. Where a tighter one is missed it does so above the second: smaller gaps are not the first
motion's fault, and planning again seldom changes them."""
_ENDS_AN_ATTEMPT = (NotConverged, Unreachable, Singular)
"""What may go wrong with an iterate: it ends the attempt from one first motion, not the plan."""

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


@dataclass(frozen=True, eq=False)
class Plan:
    """A planned motion for a scene. It keeps every limit between the points of its mesh too.

    ``trajectory``: the motion, a function of time. ``gap``: estimated relative excess of its cost
    (of its duration, unless the objective is another) over the least possible;
    ``mesh_solution.iteration_of`` and ``effort_planning.minimise_effort`` say how it is estimated.
    ``tolerance``: the gap that was asked for. ``intervals``: of the last mesh. ``meshes``: a record
    of every mesh that was solved. ``status``, ``iterations``: of the solver, the latter summed over
    all meshes. ``solve_seconds``: wall time of all of them, s. ``resolved``: whether the instants
    of switching were found as unknowns of their own. ``certificate``: how well Pontryagin's
    necessary condition is met, by the multipliers of that solution; None if they are not known.
    ``optima``: the distinct local minima that several first guesses led to, best first; empty
    where one was enough.
    ``ways``: the ways past keep-out bodies that were found, first the one that is taken.
    ``free_duration``: where the scene gives a path, the duration (s) of the plan without it, if
    ``beside_free_path`` has found it. ``multipliers``: of the limits; None where they are not
    known, as of motions that are not the fastest.

    A plan is equal to itself alone, and can be a key of a dictionary.
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
    meshes: tuple[Iteration, ...] | tuple[CostIteration, ...] | tuple[PathIteration, ...]
    certificate: Certificate | None
    resolved: bool = False
    optima: tuple[Optimum, ...] = ()
    ways: tuple[TakenWay, ...] = ()
    free_duration: float | None = None
    multipliers: Multipliers | None = None

    @property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return self.trajectory.duration

    @property
    def phases(self) -> tuple[float, ...]:
        """Durations, s, from each given point to the next: start, via points or where an approach
        ends upwards, goal."""
        begin, end = self.trajectory.knots[[0, -1]].tolist()
        at = [begin, *passes(self.scene.task, self.trajectory).tolist(), end]
        return tuple(b - a for a, b in pairwise(at))

    @property
    def cost(self) -> float:
        """Value of the scene's objective: s for time, N²m²s for effort."""
        return cost_of(self.scene, self.trajectory)

    @cached_property
    def lower_bound(self) -> float:
        """A duration in s that no motion of the scene undercuts, on whatever path: proven in
        docs/lower_bound.md. Beside ``gap``, which is an estimate and knows only motions nearby."""
        return lower_bound(self.scene)

    @cached_property
    def sensitivities(self) -> tuple[LimitSensitivity, ...]:
        """How the duration depends on each limit, the largest first: d ln T / d ln bound.

        Empty where that is not known: for objectives other than time, and where something else
        than limits sets the duration.
        """
        most_saved = 1 - self.scene.least_duration / self.duration  # a fourth axis turns no faster
        if self.multipliers is None or most_saved <= 0:
            return ()
        return limit_sensitivities(limits_of(self.scene), self.multipliers, most_saved)

    def save(
        self,
        directory: str | Path,
        *,
        chart: bool = True,
        limits: bool = False,
        report: bool = False,
    ) -> list[Path]:
        """Verify the motion and write trajectory.csv and plan.json into a directory.

        ``chart``: whether plan.png is drawn too, the plan as one picture. ``limits``: whether
        limits.png is, every limit over time. ``report``: whether report.html is written, a page on
        which the robot moves. Returns the paths of what was written.
        """
        # Imported here: a convenience of later rooms, on which planning does not depend.
        from deltaopt.output.plan_files import save
        from deltaopt.verify.verification import verify

        found = verify(self.scene, self.trajectory)
        return save(
            Path(directory),
            self.scene,
            self.trajectory,
            found,
            self,
            compared=straight_lines(self.scene) if chart else None,
            limits=limits,
            report=report,
        )

    def table(self, rate: float = 1000.0) -> Any:
        """The motion at ``rate`` (Hz) and at its last instant, with the columns of trajectory.csv.

        A pandas DataFrame if pandas is installed, otherwise a dictionary of arrays, which other
        libraries take as well.
        """
        from deltaopt.output.plan_files import frame  # of a later room

        return frame(self.trajectory, rate)

    def plot(self, axes: Any = None, *, limit: str = "torque") -> Any:
        """Draw a limited quantity over time with its bounds, and return the axes.

        ``axes``: matplotlib's, one's own; None for new ones. ``limit``: its name, as
        ``deltaopt check`` lists them. Raises ValueError if the scene has no such limit.
        """
        from deltaopt.plots.limits import plot_limit  # slow to import, and of a later room

        return plot_limit(self.scene, self.trajectory, limit, axes)

    def _repr_html_(self) -> str:
        """What was found as a table, for notebooks."""
        unit = self.scene.objective.unit
        active = active_limits(self.scene, self.trajectory)
        return html_table(
            (),
            [
                ("duration", f"{self.duration:.6f} s"),
                (str(self.scene.objective), f"{self.cost:.6g} {unit}"),
                ("estimated gap", f"{self.gap:.1e} (asked for: {self.tolerance:g})"),
                ("intervals", str(self.intervals)),
                ("solver", f"{self.status}, {self.iterations} iterations"),
                ("found in", f"{self.solve_seconds:.3g} s"),
                *(("limit", sentence) for sentence in limits_in_words(active, self.sensitivities)),
            ],
        )

    def beside_free_path(self) -> Plan:
        """The same plan with its ``free_duration``: what the given path costs.

        It is planned now, to the same tolerance. The plan is returned as it is where its path is
        free already or in a tube, or where it begins or ends at a speed. Raises NotConverged where
        no motion on a free path is found.
        """
        path = self.scene.path
        if path is None or path.speeds != (0.0, 0.0) or self.scene.tube is not None:
            return self
        free = plan(self.scene.model_copy(update={"path": None}), tolerance=self.tolerance)
        return replace(self, free_duration=free.duration)

    @property
    def within_tolerance(self) -> bool:
        """Whether the estimated gap is at most the tolerance that was asked for."""
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
    """Plan the best motion of a scene: the fastest, unless the scene has another objective.

    ``tolerance``: relative optimality gap to reach. ``intervals``: number of the first mesh, which
    is refined where time is lost until the gap is within the tolerance; for tolerances below
    ``RESOLVED_BELOW`` the instants of switching are resolved.
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
        require_positive("tolerance", self.tolerance)
        require_whole("intervals", self.intervals, 2, "to stop again", MOST)
        self._check_types()
        if self.solver and not isinstance(self.solver, self._formulation.solvers):
            raise ValueError(
                f"solver is {self.solver.name}, which solves the flat formulation only; "
                f"{self._formulation.name} is solved by ipopt"
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
        state, under_way = _state_of(start) if isinstance(start, Motion) else (start, None)
        mass: Any = self.payload if payload is None else payload  # a scene takes a range apart
        scene = Scene(
            robot=self.robot,
            payload=mass,
            start=state,
            goal=goal,
            limits=self.limits,
            objective=self.objective,
        )
        if under_way is None or not isinstance(scene.task, MovingEnds):
            return self.plan_scene(scene, starts=starts, seed=seed, progress=progress)
        self._require_free(starts)
        check_feasible(scene)
        return _resolvable(self._plan_moving(scene, under_way, progress or (lambda _: None)))

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
        self, scene: Scene, *, starts: int = 1, seed: int = 1, progress: Progress | None = None
    ) -> Plan:
        """Plan the best motion of a scene with this planner's settings.

        ``starts``, ``seed``, ``progress`` and the errors raised: as of the function ``plan``.
        """
        require_whole("starts", starts, 1, most=MOST)
        require_whole("seed", seed, 0)
        if scene.least_payload is not None:
            self._require_flat("with one payload")
        check_feasible(scene)
        report = progress or (lambda _: None)
        task = scene.task
        if isinstance(task, OnPath):
            return self._plan_on_path(scene, task, starts, report)
        if isinstance(task, MovingEnds):
            self._require_free(starts)
            return _resolvable(self._plan_moving(scene, None, report))
        if task.gates:
            what = "via points" if task.via else "an approach"
            self._require_flat(f"without {what}")
            there = "are" if task.via else "is"
            self._require_one_start(starts, f"where there {there} {what}")
            found = self._first_found(scene, through_gates(scene), report)
            if isinstance(found, Plan):
                return found
            raise found
        if scene.tube is not None:
            self._require_one_start(starts, "in a tube, where the path timed optimally is first")
        if starts == 1 and limits_of(scene).constraints.has_convex:
            return self._past_bodies(scene, report)
        if starts == 1:
            return self._search(scene, report)
        return self._best(scene, first_motions(scene, starts, seed), report)

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
            accuracy=max(_FIRST_MESH_TOLERANCE, self.tolerance),
            tolerance=self.tolerance if self.tolerance >= _USUAL else _ANOTHER_WAY_ABOVE,
        )

    def _make(self, attempts: Iterator[Attempt], search: Search[Plan], report: Progress) -> None:
        """Make attempts, and tell the search that they are from what came of each."""
        for attempt in attempts:
            if search.tried:
                report(f"{attempt}:")
            try:
                found = self._plan(attempt, report)
                search.found(replace(found, scene=search.scene))
            except _ENDS_AN_ATTEMPT as error:
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
        if not isinstance(self._formulation, Flat):
            name = self._formulation.name
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
        found = self._first_found(scene, first_moving_motions(scene, under_way), report)
        plan = found if isinstance(found, Plan) else None
        finished = None if under_way is None else self._finished_first(scene, under_way, plan)
        if finished is not None:
            return finished
        if isinstance(found, Plan):
            return found
        raise found

    def _first_found(
        self, scene: Scene, motions: Iterator[Trajectory], report: Progress
    ) -> Plan | DeltaOptError:
        """The plan from the first of some motions that leads to one, or the first error."""
        failures, accuracy = list[DeltaOptError](), max(_FIRST_MESH_TOLERANCE, self.tolerance)
        for motion in motions:
            try:
                return self._fastest(Attempt(scene, motion, self.intervals, accuracy), report)
            except _ENDS_AN_ATTEMPT as error:
                report(str(error))
                failures.append(error)
        none = Infeasible("no simple motion through all given points stays within reach")
        return failures[0] if failures else none

    def _finished_first(
        self, scene: Scene, under_way: PiecewisePolynomial, found: Plan | None
    ) -> Plan | None:
        """The motion under way to its end and then one from rest to rest, if that is shorter than
        what was ``found`` instead; None if not, if the goal is no point, or if it breaks a limit.

        Its gap is infinite: how much longer it is than the best is not known.
        """
        begin, left = perf_counter(), float(under_way.knots[-1])
        if isinstance(scene.task.goal, RestAnywhere):
            if found is None or found.duration <= left:
                return None
            trajectory = moving_on(scene.task, replace(found.trajectory, position=under_way))
            if highest_rows(scene, trajectory).values.max() > 1 + KEPT:
                return None
            return replace(
                found, trajectory=trajectory, gap=inf, certificate=None, multipliers=None
            )
        rest = from_rest(scene, end_of(under_way))
        if isinstance(rest.task, MovingEnds):
            return None
        if found is not None and found.duration <= left + lower_bound(rest):
            return None
        try:
            then = self._search(rest, lambda _: None)
        except DeltaOptError:
            return None
        if found is not None and found.duration <= left + then.duration:
            return None
        position, model = under_way.then(then.trajectory.position), then.trajectory.model
        trajectory = moving_on(scene.task, Trajectory(position, model))
        if highest_rows(scene, trajectory).values.max() > 1 + KEPT:
            return None
        return replace(
            then,
            scene=scene,
            trajectory=trajectory,
            intervals=len(trajectory.knots) - 1,
            solve_seconds=perf_counter() - begin + (found.solve_seconds if found else 0.0),
            gap=inf,
            certificate=None,
            resolved=False,
        )

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
        return Plan(
            scene=scene,
            trajectory=found.trajectory,
            formulation="path",
            transcription=ON_PATH,
            intervals=len(found.trajectory.knots) - 1,
            status="Swept",
            iterations=len(found.iterations),
            solve_seconds=perf_counter() - begin,
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
        return replace(search.best(), optima=_optima(search), solve_seconds=perf_counter() - begin)

    def _past_bodies(self, scene: Scene, report: Progress) -> Plan:
        """Plan past keep-out bodies: as if there were none, where that motion is clear of all;
        otherwise the best plan of the ways that are found, with all of these.

        Raises Infeasible where there is no way, and NotConverged where none leads to a plan.
        """
        begin, accuracy = perf_counter(), max(_FIRST_MESH_TOLERANCE, self.tolerance)
        try:
            free = self._search(scene.model_copy(update={"keep_out": None}), report)
            if sure_excess(scene, free.trajectory.position).max() <= 0:
                return replace(free, scene=scene, ways=(TakenWay(CLEAR, free.duration, True),))
        except _ENDS_AN_ATTEMPT as error:
            report(str(error))

        def planned(attempt: Attempt) -> Plan:
            search = self._new_search(scene)
            self._make(search.with_remedies(attempt), search, report)
            return search.best()

        def on_first_mesh(attempt: Attempt) -> Trajectory:
            guess = Guess(attempt.motion, near=False, tolerance=accuracy)
            scaling = Scaling(scene, attempt.motion.duration)
            problem = self._problem(attempt.motion.model, scaling, FASTEST)
            return solve_first_mesh(problem, scaling, guess, attempt.intervals).trajectory

        way = Attempt(scene, first_motion(scene), self.intervals, accuracy)
        found, taken = fastest_way(way, planned, on_first_mesh)
        return replace(found, ways=taken, solve_seconds=perf_counter() - begin)

    def _plan(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan from one first guess; once more from other meshes if the gap was missed."""
        if not isinstance(attempt.scene.objective, Time):
            return self._plan_effort(attempt, report)
        softer = softer_scenes(attempt.scene, attempt.motion) if self._is_compiled else ()
        found = self._fastest(replace(attempt, softer=softer), report)
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
            return quicker(found, self._fastest(attempt, report))
        except _ENDS_AN_ATTEMPT as error:
            report(str(error))
            return found

    @property
    def _is_compiled(self) -> bool:
        """Whether plans are made by the interior-point method. Ipopt takes seconds for a mesh, as
        many with knots at reversals as without."""
        return isinstance(self._solver, InteriorPoint)

    def _fastest(self, attempt: Attempt, report: Progress) -> Plan:
        """Plan the fastest motion from one first guess and one first mesh.

        The motion of the chosen mesh is slowed until it keeps every limit at all instants.
        """
        begin, scene = perf_counter(), attempt.scene
        guess = Guess(attempt.motion, attempt.is_near, attempt.accuracy)
        model = delta_model(scene.robot, scene.payload)
        moving = isinstance(scene.task, MovingEnds)
        in_phases = bool(scene.task.gates)
        extent = guess.trajectory.extent if moving or in_phases else None
        scaling = Scaling(
            scene,
            guess.trajectory.duration,
            extent=extent,
            torque_share=attempt.torque_share,
        )
        refinement = Refinement(
            self._problem(model, scaling, FASTEST),
            scaling,
            model,
            self.tolerance,
            None if moving or in_phases else self._resolver(scaling, model, report),
            report,
            attempt.softer,
        )
        resolved = refinement.from_guess(guess, attempt.intervals)
        solutions, iterations = refinement.solutions, refinement.iterations
        best = min(range(len(iterations)), key=lambda i: iterations[i].safe_duration)
        if moving:
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
        if crosses_singularity(scene, chosen.trajectory):
            raise CrossesSingularity(
                "the motion found passes through a parallel singularity, which no torques allow",
                chosen.status,
                chosen.trajectory,
            )
        trajectory = (
            moving_on(scene.task, chosen.trajectory)
            if moving
            else _safe(scene, chosen.trajectory, chosen.safe_factor, chosen.status)
        )
        gap = resolved.gap if resolved else gap_of(iterations, best)
        if scene.rotation:  # nothing is faster than what it takes
            gap = min(gap, max(0.0, trajectory.duration / scene.least_duration - 1))
        spent = sum(each.iterations for each in iterations)
        return Plan(
            scene=scene,
            trajectory=trajectory,
            formulation=self._formulation.name,
            transcription=resolved.name if resolved else self._transcription.name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.status,
            iterations=spent + (resolved.iterations if resolved else 0),
            solve_seconds=perf_counter() - begin,
            gap=gap,
            tolerance=self.tolerance,
            meshes=tuple(iterations),
            certificate=resolved.certificate if resolved else refinement.certificate(best),
            resolved=resolved is not None,
            multipliers=_multipliers(solutions[-1] if resolved else solutions[best]),
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
        """Plan for an objective that contains effort, starting from the fastest motion."""
        begin, scene = perf_counter(), attempt.scene
        fastest = self._before_effort(attempt)
        scaling = scaling_to_duration(scene, fastest.duration)
        cost = cost_to_minimise(scene.objective, scaling)
        problem = self._problem(fastest.trajectory.model, scaling, cost)
        found = minimise_effort(problem, fastest, self.intervals, self.tolerance, scaling, report)
        if found.trajectory.duration < scene.least_duration and not scene.objective.given_duration:
            report(f"once more, in the {scene.least_duration:.6g} s that rotation takes:")
            longer = scene.model_copy(update={"objective": Effort(duration=scene.least_duration)})
            return replace(self._plan_effort(replace(attempt, scene=longer), report), scene=scene)
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

    def _before_effort(self, attempt: Attempt) -> Plan:
        """The fastest motion of a scene, to a usual tolerance."""
        quick, scene = Planner(self.robot, self.payload, self.limits), attempt.scene
        quickly = scene.model_copy(update={"objective": Time()})
        intervals = intervals_for(attempt.motion, quick.intervals) or attempt.intervals
        return quick._plan(replace(attempt, scene=quickly, intervals=intervals), lambda _: None)

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

    def _problem(self, model: DeltaModel, scaling: Scaling, cost: Cost) -> FormulatedProblem:
        """The problem, built once in a process for all models with the same terms and limits."""
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
        return problem_formulation(Flat() if self.formulation is None else self.formulation)

    @property
    def _solver(self) -> Solver:
        """The solver that was asked for, or else the fastest that the formulation has."""
        return self.solver or self._formulation.solvers[0]()

    @property
    def _transcription(self) -> PiecewiseAcceleration:
        usual = LINEAR if isinstance(self.objective, Time) else SMOOTH
        return self.transcription or usual


def _resolvable(found: Plan) -> Plan:
    """The plan itself; raises Infeasible where its motion is too short for double precision."""
    way = found.trajectory.extent
    if way < _SHORTEST_WAY:
        raise Infeasible(
            f"the motion is {way:.1e} m long, which coordinates in double precision cannot "
            f"resolve; at least {_SHORTEST_WAY:g} m are needed"
        )
    return found


def _state_of(motion: Motion) -> tuple[State, PiecewisePolynomial | None]:
    """The state of a motion at its only instant, and what follows of the motion it belongs to.

    Raises ValueError where it has several instants.
    """
    if len(motion.t) != 1:
        raise ValueError(f"start has {len(motion.t)} instants; one is needed")
    trajectory, t = motion.under_way, float(motion.t[0])
    v = motion.v[0]
    if trajectory is not None:
        speeds = np.linalg.norm(trajectory.position.derivative().at(trajectory.knots), axis=1)
        v = np.where(np.linalg.norm(v) <= _AT_REST * speeds.max(), 0.0, v)
    state = State(at=tuple(motion.x[0].tolist()), velocity=tuple(v.tolist()))
    if trajectory is None or not trajectory.knots[0] <= t < trajectory.knots[-1]:
        return state, None
    return state, trajectory.position.after(t)


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


def timed_line(scene: Scene, tolerance: float = 1e-3) -> Plan:
    """The fastest motion on the straight line from start to goal, whatever path the scene gives.

    ``tolerance``: relative gap of its duration. Raises Unreachable, Singular or Infeasible where
    the line cannot be driven.
    """
    given_points(scene.task)
    on_line = scene.model_copy(update={"path": Line(), "tube": None, "objective": Time()})
    return plan(on_line, tolerance=tolerance)


def straight_lines(scene: Scene) -> dict[str, float]:
    """Durations, s, of the straight line from start to goal, by how it is timed, and past bodies of
    the rounded path over them: what a plan is compared with, whatever its objective. Those that no
    motion can have are left out, and all where there are via points, which they do not pass."""
    if scene.via:
        return {}
    timed: dict[str, Callable[[Scene], float]] = {
        "line, quintic law": lambda scene: baseline(scene).duration,
        "line, timed optimally": lambda scene: timed_line(scene).duration,
    }
    over = rounded_path_over(scene)
    if over is not None:
        on_path = {"path": over}
        timed["up, across, down,\ntimed optimally"] = lambda scene: (
            plan(scene.model_copy(update=on_path)).duration
        )
    scene = scene.model_copy(update={"objective": Time()})
    found = {}
    for name, duration in timed.items():
        with suppress(DeltaOptError):
            found[name] = duration(scene)
    return found


def quicker(one: Plan, other: Plan) -> Plan:
    """The shorter of two plans for a scene, with the iterations and the wall time of both.

    Each plan bounds the least duration from below by duration / (1 + gap). If the longer plan's
    bound is not above the shorter plan, both are taken to be near the same optimum, and the
    tighter bound gives the gap.
    """
    best, worse = sorted((one, other), key=lambda each: each.duration)
    shortest = worse.duration / (1 + worse.gap)
    return replace(
        best,
        gap=min(best.gap, best.duration / shortest - 1) if shortest <= best.duration else best.gap,
        iterations=one.iterations + other.iterations,
        solve_seconds=one.solve_seconds + other.solve_seconds,
    )


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


def _multipliers(found: MeshSolution) -> MeshMultipliers | None:
    """Of all limits on a mesh; with resolved switches those of the last mesh before."""
    solution = found.solution
    return MeshMultipliers(solution.multipliers) if solution.all_at_points else None


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
