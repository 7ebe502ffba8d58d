"""A plan: the motion that was found, how good it is and how it was found."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isinf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from deltaopt.errors import Infeasible
from deltaopt.files.validated_record import Vector3
from deltaopt.later import loaded
from deltaopt.motion.certificate import Certificate
from deltaopt.motion.limit_sensitivity import LimitSensitivity, Multipliers, limit_sensitivities
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.motion.running_cost import cost as cost_of
from deltaopt.motion.trajectory import Trajectory, boundary_instants, end_of, moving_on
from deltaopt.planning.journal import Entry
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene

_SHORTEST_WAY = 1e-11
"""Least way of a motion with moving ends, m: a hundred thousand times the rounding of coordinates.
Of a shorter one, as 1e-7 s before the end of another, verification cannot tell speeds."""


@dataclass(frozen=True)
class Iteration:
    """The record of one mesh.

    ``iterations``: of the solver. ``duration``: of its solution, s. ``safe_duration``: of the same
    motion slowed until it keeps every limit, s. ``gap``: estimated relative excess of the safe
    duration over the shortest possible, or of the cost over the least. ``cost``: in ``unit``,
    where that is not the duration.
    """

    intervals: int
    iterations: int
    duration: float
    safe_duration: float
    gap: float
    cost: float | None = None
    unit: str = "s"

    def __str__(self) -> str:
        solved = f"{self.intervals} intervals, {self.iterations} iterations:"
        if self.cost is not None:
            return f"{solved} {self.cost:.6g} {self.unit}, at most {self.gap:.1e} above the least"
        if isinf(self.safe_duration):
            return f"{solved} no safe duration, a limit is exceeded that slowing does not help"
        return f"{solved} {self.safe_duration:.6f} s, at most {self.gap:.1e} above the optimum"


@dataclass(frozen=True)
class Optimum:
    """A local minimum that a plan from several first guesses found.

    ``duration``: s. ``cost``: in the objective's unit. ``halfway``: the platform's position at half
    time, m. ``gap``: optimality gap. ``starts``: how many of the first guesses led there.
    """

    duration: float
    cost: float
    halfway: tuple[float, float, float]
    gap: float
    starts: int


@dataclass(frozen=True)
class TakenWay:
    """A way past bodies in words, and how long it takes, s. ``is_planned``: to the tolerance that
    was asked for; otherwise on the first mesh alone, about. ``motion``: the best known along it."""

    name: str
    duration: float
    is_planned: bool
    motion: Trajectory = field(repr=False)


@dataclass(frozen=True)
class Plan:
    """A planned motion for a scene. It keeps every limit between the points of its mesh too.

    ``trajectory``: the motion, a function of time. ``gap``: estimated relative excess of its cost
    (of its duration, unless the objective is another) over the least possible;
    ``planning.mesh.gap`` says how it is estimated. ``formulation``: of the optimisation; None of a
    straight line, which is not optimised.
    ``tolerance``: the gap that was asked for. ``intervals``: of the last mesh. ``meshes``: a record
    of every mesh that was solved; empty on a given path. ``status``, ``iterations``: of the
    solver, the latter summed over all meshes. ``solve_seconds``: wall time of planning, s.
    ``resolved``: whether the instants of switching were found as unknowns of their own.
    ``certificate``: how well Pontryagin's necessary condition is met, by the multipliers of that
    solution; None if they are not known.
    ``optima``: the distinct local minima that several first guesses led to, best first; empty
    where one was enough.
    ``ways``: the ways past keep-out bodies that were found, first the one that is taken.
    ``searched``: in words, what a search for better plans looked at; empty without one.
    ``journal``: what was attempted and decided on the way to it, in order.
    ``free_duration``: where the scene gives a path, the duration (s) of the plan without it, if
    ``beside_free_path`` has found it. ``multipliers``: of the limits; None where they are not
    known, as of motions that are not the fastest.

    A plan is equal to one of the same motion that was found in the same way, such as its pickled
    copy, and can be a key of a dictionary.

    Examples:
        >>> plan = deltaopt.plan(deltaopt.load_scene("problems/pick_and_place.yaml"))
        >>> plan.gap <= plan.tolerance, plan.lower_bound < plan.duration
        (True, True)
        >>> plan.trajectory([0.0, 0.05]).tau.shape
        (2, 3)
    """

    scene: Scene
    trajectory: Trajectory
    formulation: str | None
    transcription: str
    intervals: int
    status: str
    iterations: int
    gap: float
    tolerance: float
    solve_seconds: float = field(default=0.0, compare=False)
    meshes: tuple[Iteration, ...] = field(default=(), compare=False)
    certificate: Certificate | None = field(default=None, compare=False)
    resolved: bool = False
    optima: tuple[Optimum, ...] = field(default=(), compare=False)
    ways: tuple[TakenWay, ...] = field(default=(), compare=False)
    searched: str = field(default="", compare=False)
    journal: tuple[Entry | str, ...] = field(default=(), compare=False)
    free_duration: float | None = None
    multipliers: Multipliers | None = field(default=None, compare=False)

    @property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return self.trajectory.duration

    @property
    def reached(self) -> Vector3:
        """Where the platform is at the end, m."""
        return end_of(self.trajectory.position)

    @property
    def phases(self) -> tuple[float, ...]:
        """Durations, s, from each given point to the next: start, via points or where an approach
        ends upwards, goal. None of a motion with fewer intervals."""
        problem = problem_of(self.scene)
        if len(self.trajectory.knots) < len(problem.boundaries):
            return ()
        return tuple(np.diff(boundary_instants(problem, self.trajectory)).tolist())

    @property
    def cost(self) -> float:
        """Value of the scene's objective: s for time, N²m²s for effort."""
        return cost_of(problem_of(self.scene), self.trajectory)

    @cached_property
    def lower_bound(self) -> float:
        """A duration in s that no motion of the scene undercuts, on whatever path: proven in
        docs/how-good.md. Beside ``gap``, which is an estimate and knows only motions nearby."""
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
        return limit_sensitivities(self.multipliers, most_saved)

    def sensitivity(self, keys: Collection[str] | None = None) -> Any:
        """How the duration depends on each number of the scene and its robot, or on those with some
        ``keys`` alone: a tuple of `Sensitivity`, those first of which a small step changes it most.

        Raises SceneError where that is not known, as on a given path, and NotConverged.
        """
        return loaded("sensitivity")(self, keys)

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
        which the robot moves. Files of a cycle that was saved there are removed. Returns the
        paths of what was written.
        """
        written: list[Path] = loaded("save_plan")(
            self, directory, chart=chart, limits=limits, report=report
        )
        return written

    def table(self, rate: float = 1000.0) -> Any:
        """The motion at ``rate`` (Hz) and at its last instant, with the columns of trajectory.csv.

        A pandas DataFrame if pandas is installed, otherwise a dictionary of arrays, which other
        libraries take as well.
        """
        return loaded("frame")(self.trajectory, rate)

    def plot(self, axes: Any = None, *, limit: str = "torque") -> Any:
        """Draw a limited quantity over time with its bounds, and return the axes.

        ``axes``: matplotlib's, one's own; None for new ones. ``limit``: its name, as
        ``deltaopt check`` lists them. Raises ValueError if the scene has no such limit.
        """
        return loaded("plot_limit")(self.scene, self.trajectory, limit, axes)

    def __repr__(self) -> str:
        robot, load = self.scene.robot.name, self.scene.payload_in_words
        return f"<Plan of {self.duration:.6g} s, gap {self.gap:.1e}: {robot}, {load}>"

    def _repr_png_(self) -> bytes:
        """plan.png, for notebooks."""
        with TemporaryDirectory() as folder:
            self.save(folder)
            return (Path(folder) / "plan.png").read_bytes()

    @property
    def within_tolerance(self) -> bool:
        """Whether the estimated gap is at most the tolerance that was asked for."""
        return self.gap <= self.tolerance


def plan_as_it_is(
    scene: Scene,
    motion: Trajectory,
    tolerance: float,
    formulation: str | None,
    transcription: str = "a first motion",
    status: str = "As_It_Is",
) -> Plan:
    """The plan of a motion that keeps all limits and that no solver has changed, whose gap is not
    known; the words say where it comes from."""
    return Plan(
        scene=scene,
        trajectory=moving_on(problem_of(scene), motion),
        formulation=formulation,
        transcription=transcription,
        intervals=len(motion.knots) - 1,
        status=status,
        iterations=0,
        gap=inf,
        tolerance=tolerance,
    )


def quicker(one: Plan, other: Plan) -> Plan:
    """The better of two plans for a scene, with the iterations of both.

    Each plan bounds the least cost from below by cost / (1 + gap). If the dearer plan's
    bound is not above the better plan, both are taken to be near the same optimum, and the
    tighter bound gives the gap.
    """
    best, worse = sorted((one, other), key=lambda each: each.cost)
    least = worse.cost / (1 + worse.gap)
    return replace(
        best,
        gap=min(best.gap, best.cost / least - 1) if 0 < least <= best.cost else best.gap,
        iterations=one.iterations + other.iterations,
    )


def resolvable(found: Plan) -> Plan:
    """The plan itself; raises Infeasible where its motion is too short for double precision."""
    way = found.trajectory.extent
    if way < _SHORTEST_WAY:
        raise Infeasible(
            f"the motion is {way:.1e} m long, which coordinates in double precision cannot "
            f"resolve; at least {_SHORTEST_WAY:g} m are needed"
        )
    return found
