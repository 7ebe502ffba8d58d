"""A motion under way: finishing it first is always possible, and a bound for what replaces it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.motion.time_scaling import highest_rows
from deltaopt.motion.trajectory import Trajectory, moving_on, off_its_ends
from deltaopt.planning.first_motions.around_bodies import is_clear
from deltaopt.planning.first_motions.moving_ends import from_end_of
from deltaopt.planning.loop import Loop
from deltaopt.planning.mesh.kept_limits import KEPT
from deltaopt.planning.plan import Plan, plan_as_it_is, quicker
from deltaopt.problem.boundary import REST
from deltaopt.problem.of_scene import problem_of
from deltaopt.problem.problem import Problem
from deltaopt.robot.model import model_of
from deltaopt.scene.moving_ends import Anywhere
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene

_AT_LEAST = 0.97
"""What a plan takes at least, as a share of the motion on its first mesh alone, which is found in a
fifth of the time. Of 600 moves of five robots it was 0.979 or more; a smaller share has more
motions planned that are not shorter."""
_SOON = 2e-4
"""s: what is left of a motion that is finished at once. The next set-point of a controller lies
beyond its end, and a way that grows with the cube of the time, as under limits of torque rates, is
so short that solvers see little but rounding: where 0.1 ms were left they tried for 15 s."""
_NO_JUMP = 1e-6
"""A jump of acceleration that is none, m/s²."""
_NO_WAY, _PASSED = 1e-11, 1e-7
"""What a motion may be off the new goal that ends there already, m, and in its duration; and off
via points, m, to which it is known when it passes them."""


def finished_first(
    loop: Loop,
    scene: Scene,
    planned: Callable[[Scene], Plan],
    under_way: PiecewisePolynomial | None,
    found: Plan | None,
) -> Plan | None:
    """The motion under way to its end and then, unless it leads to the goal, one from there, if
    that is shorter than what was ``found`` instead; None if not, if nothing is under way, or if it
    breaks a limit, and where something was found also if the goal or the end of that motion moves
    elsewhere.

    ``planned``: plans the scene from there. Its gap is infinite, unless what was found tells it:
    how much longer it is than the best is not known.
    """
    if under_way is None:
        return None
    left = float(under_way.knots[-1])
    if found is not None and found.duration <= left:
        return None
    motion = Trajectory(under_way, model_of(scene.robot, scene.payload))
    if _is_asked_for(problem_of(scene), motion):
        finished = _finished(loop, scene, motion)
        return quicker(finished, found) if finished and found else finished
    rest = from_end_of(scene, under_way)
    if found is not None and rest.moves_at_ends:
        return None
    if found is not None and found.duration <= left + _AT_LEAST * loop.roughly(rest):
        return None
    then = if_possible(NO_PLAN, planned, rest)
    if then is None or (found is not None and found.duration <= left + then.duration):
        return None
    position, model = under_way.then(then.trajectory.position), then.trajectory.model
    trajectory = moving_on(problem_of(scene), Trajectory(position, model))
    if not _is_kept(scene, trajectory):
        return None
    return replace(
        then,
        scene=scene,
        trajectory=trajectory,
        intervals=len(trajectory.knots) - 1,
        gap=inf,
        certificate=None,
        resolved=False,
        multipliers=None,
    )


def nearly_over(loop: Loop, scene: Scene, under_way: PiecewisePolynomial | None) -> Plan | None:
    """The motion under way as the plan, if it is over so soon that nothing could save more, and is
    what the scene asks for within its limits."""
    if under_way is None or under_way.knots[-1] > _SOON or not isinstance(scene.objective, Time):
        return None
    motion = Trajectory(under_way, model_of(scene.robot, scene.payload))
    return _finished(loop, scene, motion) if _is_asked_for(problem_of(scene), motion) else None


def _finished(loop: Loop, scene: Scene, motion: Trajectory) -> Plan | None:
    """The motion under way as the plan; None where it breaks a limit."""
    if not _is_kept(scene, motion):
        return None
    origin, tolerance = "the motion under way", loop.optimiser.tolerance
    return plan_as_it_is(scene, motion, tolerance, origin, origin, "Finished")


def stop_of(scene: Scene, planned: Callable[[Scene], Plan]) -> PiecewisePolynomial | None:
    """The fastest stop from a start that moves, if it is ``planned``; None from rest, and where a
    stop is what is asked for."""
    if scene.task.start.velocity == REST or scene.task.goal.is_anywhere:
        return None
    stop = scene.model_copy(update={"goal": Anywhere(), "via": None})
    found = if_possible(NO_PLAN, planned, stop)
    return None if found is None else found.trajectory.position


def _is_asked_for(problem: Problem, motion: Trajectory) -> bool:
    """Whether the motion under way passes the via points of a problem and ends as that asks."""
    missed = (off for off, _ in motion.passing(problem.gates))
    return off_its_ends(problem, motion) < _NO_WAY and all(off < _PASSED for off in missed)


def _is_kept(scene: Scene, trajectory: Trajectory) -> bool:
    """Whether a motion keeps the limits of a scene and is clear of its bodies, which the motion
    under way need not have been planned for."""
    problem = problem_of(scene)
    if problem.limits.constraints.order == 3 and trajectory.acceleration_jump > _NO_JUMP:
        return False
    highest = highest_rows(problem, trajectory).values.max()
    return bool(highest <= 1 + KEPT) and is_clear(scene, trajectory)
