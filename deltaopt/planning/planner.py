"""Planning: from a scene to a motion that keeps every limit and whose optimality gap is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import takewhile
from time import perf_counter
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.dynamics.formulation import Formulation
from deltaopt.errors import DeltaOptError
from deltaopt.files.validated_record import Vector3
from deltaopt.interrupts.workers import end_with_parent
from deltaopt.motion.trajectory import Motion, Trajectory
from deltaopt.planning.attempts import Search
from deltaopt.planning.formulations.choice import Flat, ProblemFormulation
from deltaopt.planning.journal import Journal, Progress
from deltaopt.planning.nlp.problem import Solver
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.plan import Plan
from deltaopt.planning.run import Run
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from deltaopt.robot.machine import Machine
from deltaopt.scene.known_limits import Limits
from deltaopt.scene.moving_ends import Anywhere, End, Start, State
from deltaopt.scene.objective import Objective, Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath, Task
from deltaopt.settings import (
    MOST,
    MOST_INTERVALS,
    RESOLVED_BELOW,
    TOLERANCES,
    require_positive,
    require_type,
    require_whole,
)

Pair = tuple[Vector3, Vector3]
"""Start and goal, m."""

_AT_REST = 1e-8
"""Share of the largest speed at a motion's knots, below which an instant of it counts as rest. At
the very end of a motion rounding leaves a speed; a stop from there would take 1e-15 s, which no
solver resolves. It is far below what verification sees."""
_PASSED = 1e-6
"""m; a motion that misses a via point by less has passed it."""
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
    formulation: ProblemFormulation | Formulation | None = None,
    solver: Solver | None = None,
    starts: int = 1,
    seed: int = 1,
    exhaustive: float | None = None,
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
    ``starts``: number of first guesses; beside the usual plan the best of one less is looked for,
    from distinct ways and then random ones with ``seed``. ``exhaustive``: for how many seconds more
    of them are looked at. ``progress``: is called with a line of text after every mesh.

    Raises Unreachable, Singular or Infeasible if start or goal rule a motion out, NotConverged if
    the solver finds none, and ValueError or TypeError for settings that make no sense.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> plan = deltaopt.plan(scene)
        >>> round(plan.duration, 3)
        0.141
    """
    require_type("scene", scene, Scene, "a Scene, such as load_scene returns")
    planner = Planner(
        scene.robot,
        tolerance=tolerance,
        intervals=intervals,
        transcription=transcription,
        formulation=formulation,
        solver=solver,
    )
    return planner.plan_scene(
        scene, starts=starts, seed=seed, exhaustive=exhaustive, progress=progress
    )


@dataclass(frozen=True)
class Planner:
    """Plans motions of one robot with the same settings.

    Equations and compiled code depend neither on start and goal nor on the payload's mass: they
    are built once in a process. ``payload``: kg, unless a plan is given another. ``limits``: of
    the scenes, beside those of the drive. ``resolved_below``: tolerance below which the instants of
    switching are resolved; 0 for never. ``objective``: of the scenes that are made from start and
    goal. The other settings are those of ``plan``.

    Raises ValueError or TypeError for settings that make no sense.

    Examples:
        >>> robot = deltaopt.load_robot("problems/robots/orsino.yaml")
        >>> planner = deltaopt.Planner(robot, payload=1.0)
        >>> there = planner.plan((0.45, -0.05, 0.0), (0.45, 0.10, 0.0))
        >>> round(there.duration, 3)
        0.141
        >>> back = planner.plan((0.45, 0.10, 0.0), (0.45, -0.05, 0.0), payload=0.5)
        >>> back.duration < there.duration
        True
    """

    robot: Machine
    payload: float | None = None
    limits: Limits | None = None
    tolerance: float = 1e-3
    intervals: int = 16
    transcription: PiecewiseAcceleration | None = None
    formulation: ProblemFormulation | Formulation | None = None
    resolved_below: float = RESOLVED_BELOW
    objective: Objective = field(default_factory=Time)
    solver: Solver | None = None

    def __post_init__(self) -> None:
        require_positive("tolerance", self.tolerance, *TOLERANCES)
        require_whole("intervals", self.intervals, 2, "to stop again", MOST_INTERVALS)
        self._check_types()
        if self.solver and not isinstance(self.solver, self._optimiser.problem_formulation.solvers):
            raise ValueError(
                f"solver is {self.solver.name}, which solves the flat formulation only; "
                f"{self._optimiser.problem_formulation.name} is solved by ipopt"
            )

    def __repr__(self) -> str:
        load = "no payload" if self.payload is None else f"payload {self.payload}"
        return f"<Planner of {self.robot.name} with {load}, tolerance {self.tolerance:g}>"

    def _check_types(self) -> None:
        """Raise TypeError for a setting that is no value of its kind, such as its name."""
        degree = "deltaopt.PiecewiseAcceleration(degree)"
        for name, kind, expected in (
            ("formulation", ProblemFormulation | Formulation, FORMULATIONS_EXPECTED),
            ("solver", Solver, "deltaopt.interior_point or deltaopt.ipopt"),
            ("transcription", PiecewiseAcceleration, degree),
        ):
            given = getattr(self, name)
            if given is not None:
                require_type(name, given, kind, expected)

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
        exhaustive: float | None = None,
        progress: Progress | None = None,
    ) -> Plan:
        """Plan the best motion of a scene with this planner's settings.

        ``start``: an instant of a motion in which the new one begins, instead of the scene's start;
        as in ``plan``, but with all that a scene asks for, such as bodies to keep clear of. Via
        points at its head that the motion has passed by then are not asked for again.
        ``starts``, ``seed``, ``exhaustive``, ``progress`` and the errors raised: as of the function
        ``plan``.
        """
        require_whole("starts", starts, 1, most=MOST)
        require_whole("seed", seed, 0)
        search = Search(starts - 1, seed=seed) if starts > 1 else None
        if exhaustive is not None:
            require_positive("exhaustive", exhaustive)
            search = Search(starts - 1 if starts > 1 else MOST, exhaustive, seed)
        under_way = None
        if start is not None:
            ahead = (scene.via or ())[_passed_before(start, scene.task) :] or None
            state = _state_of(start, scene.has_rates)
            scene = scene.model_copy(update={"start": state, "via": ahead})
            under_way = _rest_of(start)
        scene.require_consistent()
        self._require_settings(scene, starts, exhaustive)
        return self._told(lambda run: run.plan(scene, under_way, search), progress)

    def plan_near(self, scene: Scene, motion: Trajectory) -> Plan:
        """Plan the best motion of a scene near one that is known, such as that of another
        objective. No other way is looked for.

        Raises what rules the scene out, and NotConverged where the motion leads to no plan near an
        optimum, or the path is given, and TypeError for what is no trajectory.
        """
        require_type("motion", motion, Trajectory, "a Trajectory, such as plan.trajectory")
        scene.require_consistent()
        return self._told(lambda run: run.plan_near(scene, motion), None)

    def _told(self, planned: Callable[[Run], Plan], progress: Progress | None) -> Plan:
        """What a run plans, with its journal and how long it took."""
        begin, journal = perf_counter(), Journal(progress or (lambda _: None))
        found = planned(Run(self._optimiser, journal))
        spent = perf_counter() - begin
        return replace(found, journal=tuple(journal.entries), solve_seconds=spent)

    def _require_settings(self, scene: Scene, starts: int, exhaustive: float | None) -> None:
        """Raise ValueError for settings that do not go with a scene."""
        task = scene.task
        if isinstance(task, OnPath):
            settings = {
                "formulation": self.formulation,
                "solver": self.solver,
                "transcription": self.transcription,
                "starts": starts if starts > 1 else None,
                "exhaustive": exhaustive,
            }
            for name, value in settings.items():
                if value is not None:
                    raise ValueError(f"{name} is {value}; it has no effect where the path is given")
            return
        asked, is_in_phases = self._optimiser.problem_formulation, task.is_at_rest and task.gates
        if is_in_phases and not isinstance(asked, Flat):
            without = f"without {'via points' if task.via else 'an approach'}"
            raise ValueError(
                f"formulation is {asked.name}, which plans {without} alone; the flat formulation "
                "plans this scene"
            )

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
        with ProcessPoolExecutor(workers, initializer=end_with_parent) as pool:
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
        names = (each.name for each in fields(TrajectoryOptimiser))
        return TrajectoryOptimiser(**{name: getattr(self, name) for name in names})


def _state_of(motion: Motion, with_acceleration: bool = False) -> State:
    """The state of a motion at its only instant. Raises ValueError where it has several."""
    if np.ndim(motion.t):
        raise ValueError(f"start has {len(motion.t)} instants; one is needed: motion.first")
    trajectory, v = motion.under_way, motion.v
    if trajectory is not None:
        speeds = np.linalg.norm(trajectory.position.at(trajectory.knots, 1), axis=1)
        v = np.where(np.linalg.norm(v) <= _AT_REST * speeds.max(), 0.0, v)
    acceleration = tuple(motion.a.tolist()) if with_acceleration else None
    at, velocity = tuple(motion.x.tolist()), tuple(v.tolist())
    return State(at=at, velocity=velocity, acceleration=acceleration)


def _passed_before(motion: Motion, task: Task) -> int:
    """How many of a task's via points, from the first on, the motion that an instant belongs to
    has passed by then."""
    if motion.under_way is None:
        return 0
    found = motion.under_way.passing(task.via)
    passed = takewhile(lambda each: each[0] <= _PASSED and each[1] <= motion.t, found)
    return sum(1 for _ in passed)


def _rest_of(motion: Motion) -> PiecewisePolynomial | None:
    """What follows an instant of the motion that it belongs to; None where that is not known."""
    trajectory, t = motion.under_way, float(motion.t)
    if trajectory is None or not trajectory.knots[0] <= t < trajectory.knots[-1]:
        return None
    return trajectory.position.after(t)


def _counted(
    outcomes: Iterable[Plan | DeltaOptError], tell: Callable[[int], None]
) -> list[Plan | DeltaOptError]:
    """All outcomes; how many there are is told as they come."""
    found = []
    for each in outcomes:
        found.append(each)
        tell(len(found))
    return found
