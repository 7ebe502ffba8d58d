"""From a scene to a motion that is fast, safe, and known to be nearly the fastest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import isinf
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import NotConverged
from deltaopt.feasibility import check_feasible
from deltaopt.limits import safe_factor
from deltaopt.model import DeltaModel
from deltaopt.planning.baseline import first_motion
from deltaopt.planning.certificate import Certificate
from deltaopt.planning.flat import Flat, ScaledEquations
from deltaopt.planning.gap import FRACTIONS, GivenAway, given_away, refined
from deltaopt.planning.nlp import Solution
from deltaopt.planning.problem import Pose, Posed, Problem
from deltaopt.planning.resolve import Resolved, Unsettled, resolve
from deltaopt.planning.scales import Scales
from deltaopt.planning.structure import read_structure
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.record import Vector3
from deltaopt.robot import Robot
from deltaopt.scene import Limits, Scene
from deltaopt.trajectory import Trajectory

Array = NDArray[np.float64]
Progress = Callable[[str], None]

RESOLVED_BELOW = 5e-4
"""Tolerances below this are met by resolving switches, which is cheaper than finer meshes."""
_READABLE = 2e-3
"""A mesh solution with a smaller gap shows which motor is at which limit when."""
_MOST_INTERVALS = 300
"""No mesh is refined that is finer than this: every refinement multiplies time by four."""


@dataclass(frozen=True)
class Round:
    """One mesh: ``duration`` of its solution, ``safe_duration`` once slowed to the limits (s),
    estimated ``gap`` of the latter to the shortest possible, as a fraction of it."""

    intervals: int
    iterations: int
    duration: float
    safe_duration: float
    gap: float

    def __str__(self) -> str:
        return (
            f"{self.intervals} intervals, {self.iterations} iterations: "
            f"{self.safe_duration:.6f} s, at most {self.gap:.1e} above the optimum"
        )


@dataclass(frozen=True)
class Plan:
    """A motion for a scene, slowed so that every limit holds between mesh points too.

    ``gap``: estimated excess of its duration over the shortest possible, as a fraction.
    ``rounds``: the meshes it took. ``solve_seconds``: wall time of all of them.
    ``certificate``: how well Pontryagin's condition is met, where the switches are resolved.
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
    rounds: tuple[Round, ...]
    certificate: Certificate | None

    @property
    def duration(self) -> float:
        """From start to goal, s."""
        return self.trajectory.duration

    def save(self, directory: str | Path) -> list[Path]:
        """Verify, and write trajectory.csv, plan.json and plan.png; their paths."""
        from deltaopt.export import save  # lies to the right: a convenience, not a dependence
        from deltaopt.verify import verify

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
    intervals: int = 10,
    transcription: PiecewiseAcceleration | None = None,
    formulation: Pose | None = None,
    progress: Progress | None = None,
) -> Plan:
    """The fastest motion of a scene.

    ``tolerance``: of the optimality gap. ``intervals``: of the first mesh, refined where time
    is given away until the gap is within the tolerance; below ``RESOLVED_BELOW`` the switches
    are resolved. ``progress``: told after every mesh.

    Raises Unreachable, Infeasible or NotConverged.
    """
    planner = Planner(
        scene.robot, scene.payload, scene.limits, tolerance, intervals, transcription, formulation
    )
    return planner.plan(scene.start, scene.goal, progress=progress)


class Planner:
    """Plans for one robot and payload; what does not depend on start and goal is built once."""

    def __init__(
        self,
        robot: Robot,
        payload: float | None = None,
        limits: Limits | None = None,
        tolerance: float = 1e-3,
        intervals: int = 10,
        transcription: PiecewiseAcceleration | None = None,
        formulation: Pose | None = None,
    ) -> None:
        if not tolerance > 0:
            raise ValueError(f"tolerance is {tolerance}; it must be greater than 0")
        if intervals < 2:
            raise ValueError(f"intervals is {intervals}; at least 2 are needed to stop again")
        self._robot, self._payload, self._limits = robot, payload, limits
        self._tolerance = tolerance
        self._transcription = transcription or PiecewiseAcceleration()
        self._pose = formulation or Flat()
        self._first_mesh = np.full(intervals, 1 / intervals)
        self._model = DeltaModel(robot, payload)

    def plan(self, start: Vector3, goal: Vector3, *, progress: Progress | None = None) -> Plan:
        """The fastest motion from rest at start to rest at goal (m)."""
        scene = Scene(
            robot=self._robot, payload=self._payload, start=start, goal=goal, limits=self._limits
        )
        check_feasible(scene)
        begin = perf_counter()
        attempts, rounds, resolved = self._solve(scene, progress or (lambda _: None))
        best = min(range(len(rounds)), key=lambda i: rounds[i].safe_duration)
        chosen = resolved or attempts[best]
        if isinf(chosen.safe_factor):
            raise NotConverged(
                "gravity alone exceeds a torque limit somewhere between the points of every mesh",
                chosen.solution.status,
                chosen.solution.z,
            )
        return Plan(
            scene=scene,
            trajectory=chosen.trajectory.slowed(chosen.safe_factor),
            formulation=self._pose.name,
            transcription=resolved.problem.name if resolved else self._transcription.name,
            intervals=len(chosen.trajectory.knots) - 1,
            status=chosen.solution.status,
            iterations=sum(r.iterations for r in rounds),
            solve_seconds=perf_counter() - begin,
            gap=resolved.gap if resolved else rounds[best].gap,
            tolerance=self._tolerance,
            rounds=tuple(rounds),
            certificate=resolved.certificate if resolved else None,
        )

    def _solve(
        self, scene: Scene, tell: Progress
    ) -> tuple[list[Attempt], list[Round], Resolved | None]:
        """Solve on finer and finer meshes until the gap is small enough, the switches can be
        resolved, or no more is gained."""
        guess = first_motion(scene)
        openings = self._model.openings([scene.start, scene.goal])
        scales = Scales(scene, guess.duration, float(openings.min()))
        attempts = [self._attempt(self._first_problem, scales, guess)]
        rounds = [_round(attempts)]
        tell(str(rounds[-1]))
        while not self._done(rounds):
            last, aim = attempts[-1], self._tolerance / 4
            if self._tolerance < RESOLVED_BELOW:
                if rounds[-1].gap < _READABLE:
                    resolved = self._resolved(last, scales, tell)
                    if resolved:
                        return attempts, rounds, resolved
                aim = max(aim, rounds[-1].gap / 16)
            mesh = refined(last.problem.mesh, last.lost, aim)
            if len(mesh) == len(last.problem.mesh):
                tell(f"{len(mesh)} intervals: nothing is known to be gained by more of them")
                break
            try:
                attempts.append(self._attempt(self._posed.on(mesh), scales, last.trajectory))
            except NotConverged as error:  # what is there already is a motion all the same
                tell(f"{len(mesh)} intervals: {error}")
                break
            rounds.append(_round(attempts))
            tell(str(rounds[-1]))
        return attempts, rounds, None

    def _resolved(self, attempt: Attempt, scales: Scales, tell: Progress) -> Resolved | None:
        """With its switches resolved, or None if the structure cannot be settled yet."""
        structure = read_structure(attempt.problem.mesh, *_loads(scales.scene, attempt.trajectory))
        try:
            found = resolve(
                self._scaled_equations,
                self._model,
                structure,
                attempt.trajectory,
                scales,
                self._tolerance,
            )
        except Unsettled as error:
            tell(f"{len(structure.lengths)} arcs: not settled yet: {error}")
            return None
        tell(
            f"{len(structure.lengths)} arcs: {found.trajectory.duration:.9f} s, gap "
            f"{found.gap:.1e}, satisfies Pontryagin's condition to {found.certificate.residual:.0e}"
        )
        return found

    def _done(self, rounds: list[Round]) -> bool:
        """After two meshes at least: one alone has nothing to be compared with."""
        enough = rounds[-1].gap <= self._tolerance
        return len(rounds) > 1 and (enough or rounds[-1].intervals > _MOST_INTERVALS)

    @cached_property
    def _speed_is_limited(self) -> bool:
        in_scene = self._limits is not None and self._limits.speed is not None
        return in_scene or self._robot.speed_limits is not None

    @cached_property
    def _posed(self) -> Posed:
        functions = self._model.functions
        return self._pose.of(functions, self._transcription, speed=self._speed_is_limited)

    @cached_property
    def _scaled_equations(self) -> ScaledEquations:
        return ScaledEquations.of(self._model.functions, speed=self._speed_is_limited)

    @cached_property
    def _first_problem(self) -> Problem:
        return self._posed.on(self._first_mesh)

    def _attempt(self, problem: Problem, scales: Scales, guess: Trajectory) -> Attempt:
        p = np.concatenate([scales.vector(), self._model.parameters])
        solution = problem.program.solve(problem.pack(guess, scales), *problem.bounds(scales), p)
        trajectory = Trajectory(problem.unpack(solution.z, scales), self._model)
        lost = given_away(problem.prices(solution), *_loads(scales.scene, trajectory))
        factor = safe_factor(scales.scene, trajectory)
        return Attempt(problem, solution, trajectory, lost, factor)


@dataclass(frozen=True)
class Attempt:
    """A problem solved on one mesh, the motion not yet slowed."""

    problem: Problem
    solution: Solution
    trajectory: Trajectory
    lost: GivenAway
    safe_factor: float


def _loads(scene: Scene, trajectory: Trajectory) -> tuple[Array, Array | None]:
    """Torques and, if limited, speeds inside the intervals, as fractions of their limits."""
    motion = trajectory.inside_intervals(FRACTIONS)
    shape = (-1, len(FRACTIONS), 3)
    torque = (motion.tau / np.array(scene.torque_limits)).reshape(shape)
    if scene.speed_limits is None:
        return torque, None
    return torque, (motion.dtheta / np.array(scene.speed_limits)).reshape(shape)


def _round(attempts: list[Attempt]) -> Round:
    """What the last attempt reached.

    The estimate of what it gives away is held against how much the duration really fell from
    the mesh before: where the estimate fell short there, it is raised in proportion.
    """
    last = attempts[-1]
    correction = 1.0
    if len(attempts) > 1:
        before = attempts[-2]
        fell = before.trajectory.duration / last.trajectory.duration - 1
        expected = before.lost.total - last.lost.total
        correction = max(1.0, fell / expected) if expected > 0 else 2.0
    return Round(
        intervals=len(last.problem.mesh),
        iterations=last.solution.iterations,
        duration=last.trajectory.duration,
        safe_duration=last.trajectory.duration * last.safe_factor,
        gap=last.safe_factor - 1 + correction * last.lost.total,
    )
