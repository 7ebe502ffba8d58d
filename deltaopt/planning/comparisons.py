"""What a plan is compared with: straight lines, and where a path is given the free motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.path.path_over_bodies import rounded_path_over
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.scene.known_limits import LIMITS
from deltaopt.scene.objective import Time
from deltaopt.scene.path import Line
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points


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
    """Durations, s, of the straight line from start to goal, by how it is timed, and past bodies of
    the rounded path over them: what a plan is compared with, whatever its objective. Those that no
    motion can have are left out, and all where there are via points, which they do not pass, or an
    end moves. Those timed optimally have torques that jump."""
    if scene.via or scene.moves_at_ends:
        return {}
    jumps = ", torques jump" if scene.has_rates else ""
    timed: dict[str, Callable[[Scene], float]] = {
        "line, quintic law": lambda scene: baseline(scene).duration,
        f"line, timed optimally{jumps}": lambda scene: timed_line(scene).duration,
    }
    over = rounded_path_over(scene)
    if over is not None:
        on_path = {"path": over, "objective": Time()}
        timed[f"up, across, down,\ntimed optimally{jumps}"] = lambda scene: (
            plan(without_rates(scene).model_copy(update=on_path)).duration
        )
    scene = scene.model_copy(update={"objective": Time()})
    found = {}
    for name, duration in timed.items():
        known = if_possible(NO_PLAN, duration, scene)
        if known is not None:
            found[name] = known
    return found


def beside_free_path(found: Plan) -> Plan:
    """A plan with its ``free_duration``: what the given path costs.

    It is planned now, to the same tolerance. The plan is returned as it is where its path is
    free already or in a tube, or where it begins or ends at a speed. Raises NotConverged where
    no motion on a free path is found.

    Examples:
        >>> glue = deltaopt.plan(deltaopt.load_scene("problems/paths/glue_line.yaml"))
        >>> beside = deltaopt.beside_free_path(glue)
        >>> beside.free_duration < beside.duration
        True
    """
    path = found.scene.path
    if path is None or path.speeds != (0.0, 0.0) or found.scene.tube is not None:
        return found
    free = plan(found.scene.model_copy(update={"path": None}), tolerance=found.tolerance)
    return replace(found, free_duration=free.duration)
