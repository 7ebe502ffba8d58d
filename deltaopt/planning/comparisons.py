"""What a plan is compared with: straight lines, the path that a controller would be given where
bodies are in the way, up, across and down, and where a path is given the free motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import dist, inf

import numpy as np

from deltaopt.curves.halving import bisected_number
from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.motion.sure_bounds import rows_not_kept
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import LIMITS
from deltaopt.scene.objective import Time
from deltaopt.scene.path import Line, PickAndPlace
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points
from deltaopt.settings import require_type

_HEIGHTS = np.geomspace(2e-3, 0.3, 40)
"""m, above the higher end, tried until a path is clear. Roundings of half the way meet."""
_STRAIGHT = 1e-5
"""m, the height at which a path counts as the straight line, which needs no other beside it."""
_ROUNDED = 1 - 1e-9
"""Of the height: all of it would be beyond the leg by rounding."""
_HALVINGS = 24
"""Of the last step between two heights: to a nanometre."""


def timed_line(scene: Scene, tolerance: float = 1e-3) -> Plan:
    """The fastest motion on the straight line from start to goal, whatever path the scene gives.

    Its torques jump: limits of jerk and torque rate are left out.

    ``tolerance``: relative gap of its duration. Raises Unreachable, Singular or Infeasible where
    the line cannot be driven.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> round(deltaopt.timed_line(scene).duration, 3)
        0.144
    """
    require_type("scene", scene, Scene, "a Scene, such as load_scene returns")
    given_points(scene.task)
    on_line = {"path": Line(), "tube": None, "objective": Time()}
    return plan(without_rates(scene).model_copy(update=on_line), tolerance=tolerance)


def without_rates(scene: Scene) -> Scene:
    """A scene without its limits of jerk and torque rate: itself if it has none."""
    if not scene.has_rates:
        return scene
    robot, limits = scene.robot, scene.limits
    drive = robot.drive.model_copy(update={"torque_rate": None})
    keys = (limit.key.name for limit in LIMITS if limit.order == 3 and limit.key)
    if limits is not None:
        limits = limits.model_copy(update=dict.fromkeys(keys))
    changed = {"robot": robot.model_copy(update={"drive": drive}), "limits": limits}
    return scene.model_copy(update=changed)


def straight_lines(scene: Scene) -> dict[str, float]:
    """Durations, s, of motions on one path that keep a scene, by how the path is timed: what a plan
    is compared with, whatever its objective. The straight line from start to goal, past bodies the
    rounded path over them, in a tube its middle.

    What no motion can have is left out; so are torques that jump where the scene does not let them.
    None where one of them is as fast as a fourth axis turns, where the scene gives the path, via
    points or an approach, which these do not keep, or an end moves.
    """
    if scene.via or scene.moves_at_ends or scene.approach or scene.follows_path:
        return {}
    scene = scene.model_copy(update={"objective": Time()})
    timed: dict[str, Callable[[], Plan | Trajectory]] = {}
    over = rounded_path_over(scene)
    if scene.tube is not None:
        timed["tube's middle,\ntimed optimally"] = partial(plan, scene.on_its_path)
    elif over is not None:
        on_path = scene.model_copy(update={"path": over})
        timed["rounded path,\ntimed optimally"] = partial(plan, on_path)
    elif not scene.robot_keeps_clear:
        timed["line, by a quintic law"] = partial(baseline, scene)
        timed["line, timed optimally"] = partial(timed_line, scene)
    jumps = ("optimally",) if scene.has_rates else ()
    found = {
        name: if_possible(NO_PLAN, motion)
        for name, motion in timed.items()
        if not name.endswith(jumps)
    }
    durations = {name: each.duration for name, each in found.items() if each is not None}
    quickest = min(durations.values(), default=inf)
    return {} if problem_of(scene).is_least_duration(quickest) else durations


def beside_free_path(found: Plan) -> Plan:
    """A plan with its ``free_duration``: what the given path costs.

    It is planned now, to the same tolerance. The plan is returned as it is where its path is
    free already or in a tube, or where it begins or ends at a speed. Raises NotConverged where
    no motion on a free path is found, and TypeError for what is no plan.

    Examples:
        >>> glue = deltaopt.plan(deltaopt.load_scene("problems/paths/glue_line.yaml"))
        >>> beside = deltaopt.beside_free_path(glue)
        >>> beside.free_duration < beside.duration
        True
    """
    require_type("found", found, Plan, "a Plan")
    if not (found.scene.follows_path and found.scene.task.is_at_rest):
        return found
    free = plan(found.scene.model_copy(update={"path": None}), tolerance=found.tolerance)
    return replace(found, free_duration=free.duration)


def rounded_path_over(scene: Scene) -> PickAndPlace | None:
    """The lowest path up, across and down that clears all keep-out bodies of a scene, rounded from
    its height on. None where no body is in the way of the straight line or there is no such path,
    and where an end moves or points or a path between the ends are given."""
    if scene.keep_out is None or scene.path is not None or scene.moves_at_ends:
        return None
    start, goal = map(np.array, given_points(scene.task))
    widest = dist(goal[1:], start[1:]) / 2
    heights = [height for height in _HEIGHTS.tolist() if height < widest]
    clear = next((i for i, height in enumerate(heights) if _is_clear(scene, height)), None)
    if clear is None or (clear == 0 and _is_clear(scene, _STRAIGHT)):
        return None
    low, high = heights[clear - 1] if clear else _STRAIGHT, heights[clear]
    return _path(bisected_number(lambda height: _is_clear(scene, height), low, high, _HALVINGS)[1])


def _path(height: float) -> PickAndPlace:
    return PickAndPlace(height=height, blend=_ROUNDED * height)


def _is_clear(scene: Scene, height: float) -> bool:
    """Whether the path of a height (m) is known to keep the scene's clearance everywhere."""
    path = _path(height).between(*given_points(scene.task))
    return not rows_not_kept(problem_of(scene), path).any()
