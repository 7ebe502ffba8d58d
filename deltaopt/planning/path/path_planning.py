"""Plans on a path that a scene gives: there is one motion, and no first guess.

And motions along straight lines that are known to be clear of bodies: near their corners, or
exactly on them but for rounded corners.
"""

from __future__ import annotations

from math import isinf

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import RULED_OUT, Infeasible, NotConverged, if_possible, in_words
from deltaopt.motion.limit_sensitivity import Multipliers
from deltaopt.motion.sure_bounds import signed_distances, sure_excess
from deltaopt.motion.time_scaling import highest_rows, safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.journal import Progress
from deltaopt.planning.path.on_mesh import OnMesh, PathMultipliers
from deltaopt.planning.path.path_rows import PathRows, kept_rows
from deltaopt.planning.path.path_timing import PathTiming
from deltaopt.planning.plan import Plan
from deltaopt.problem.boundary import Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.feasibility import require_state
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.parallel_singularity import require_path_on_one_side
from deltaopt.scene.path import Corners
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

_ALONG = 1001
"""Instants at which a path whose plan misses its tolerance is looked at for a singularity."""
_KEPT = 1e-10
"""Excess up to which a motion that begins or ends at a speed keeps its limits: it must not be
slowed, for that would change its boundary values."""
_MOST_MARGINS, _MORE, _FOR_NOTHING = 30, 1.5, 0.01
"""How often cells are looked for in which such a motion exceeds limits, the factor on what they are
tightened by there, and the share of the tolerance up to which all cells are, for it costs no more
than that: many may exceed limits by next to nothing, and each look takes long on fine meshes."""
_SHARES = (0.5, 0.2, 0.05)
"""Of the tolerance: estimated losses at which meshes are not refined further. The rest is for
tightening and slowing; if that is not enough, all is done again with the next."""
_ROUNDING = 1 + 2.0**-45
"""Factor by which motions are slowed to allow for rounding of torques."""
_TOUCHED = 1e-9
"""Share of a limit of position by which a path may be beyond it: rounding."""
_BLENDS = (0.499, 0.1, 0.01, 0.001)
"""Where corners begin to be rounded, as shares of the shortest leg: long roundings are driven
faster, short ones stay closer to the path."""
OF_ROOM = (0.9, 0.0)
"""Shares of the distance from all bodies at a corner, within which motions pass it, one after the
other: at last at the corner itself."""
_NEAREST = 1e-5
"""m, within which no corner is passed: bodies that leave less are passed at the corner itself."""


def planned_on_path(scene: Scene, tolerance: float, report: Progress) -> Plan:
    """The plan of the fastest motion on the path that a scene gives.

    Raises Infeasible, Unreachable or Singular where the path cannot be driven, and NotConverged.
    """
    found = fastest_on_path(scene, tolerance, report)
    if found.gap > tolerance:  # which no mesh mends where torques grow without bound
        position = found.trajectory.position
        first, last = position.knots[[0, -1]].tolist()
        require_path_on_one_side(scene, position.at(np.linspace(first, last, _ALONG)))
    return found


def fastest_on_path(scene: Scene, tolerance: float, report: Progress) -> Plan:
    """The fastest motion of a scene on the path of its task, which keeps every limit; its gap is
    the estimated relative excess of its duration over the shortest possible on that path.

    Raises Infeasible where no motion on the path keeps the limits, Unreachable and Singular where
    the path leads out of the workspace.
    """
    task = scene.task
    assert isinstance(task, OnPath)
    timing = PathTiming(PathRows(scene), tolerance, report)
    planned = _slowed if task.is_at_rest else _held
    trajectory, gap, on_mesh = planned(scene, timing)
    _require_positions(scene, trajectory)
    if trajectory.duration < scene.least_duration:
        trajectory = _waiting(scene, task, trajectory)
        gap = 0.0  # nothing is faster than what rotation takes
    of_rows = PathMultipliers(timing.rows, on_mesh).of_rows
    return Plan(
        scene=scene,
        trajectory=trajectory,
        formulation="path",
        transcription="quintic in time on the path",
        intervals=len(trajectory.knots) - 1,
        status="Swept",
        iterations=timing.meshes,
        gap=gap,
        tolerance=tolerance,
        multipliers=Multipliers(timing.rows.limits, of_rows),
    )


def roughly_on_path(scene: Scene, tolerance: float) -> Trajectory:
    """The fastest motion on the path of a scene's task as a mesh has it, between whose points it
    may exceed limits. ``tolerance``: for which the mesh is fine enough.

    Raises Infeasible where no motion on the path keeps the limits, Unreachable and Singular where
    the path leads out of the workspace.
    """
    timing = PathTiming(PathRows(scene), tolerance, lambda _: None)
    found, _ = timing.fastest(_SHARES[0])
    return _on_mesh(scene, found)


def _on_mesh(scene: Scene, found: OnMesh) -> Trajectory:
    """The motion of a mesh, which is not slowed."""
    return Trajectory(found.motion.position, model_of(scene.robot, scene.payload))


def _waiting(scene: Scene, task: OnPath, trajectory: Trajectory) -> Trajectory:
    """A motion slowed until a fourth axis has turned. Raises Infeasible where it cannot be."""
    least = scene.least_duration
    factor = safe_factor(problem_of(scene), trajectory, at_least=least / trajectory.duration)
    if isinf(factor) or not task.is_at_rest:
        raise Infeasible(
            f"the path takes {trajectory.duration:.6g} s, less than rotation does, and cannot be "
            f"slowed until then ({least:.6g} s)"
        )
    return trajectory.slowed(factor)


def _slowed(scene: Scene, timing: PathTiming) -> tuple[Trajectory, float, OnMesh]:
    """The fastest motion from rest to rest, slowed by what its limits are exceeded at last, its
    gap, and what it was before."""
    best: tuple[Trajectory, float, OnMesh] | None = None
    for share in _SHARES:
        found, loss = timing.fastest(share)
        trajectory = _on_mesh(scene, found)
        factor = safe_factor(problem_of(scene), trajectory) * _ROUNDING
        if isinf(factor):
            _require_positions(scene, trajectory)
            raise Infeasible("the path: somewhere on it a limit is exceeded at rest")
        slowed = trajectory.slowed(factor), (1 + loss) * factor - 1, found
        if best is None or slowed[0].duration < best[0].duration:
            best = slowed
        if slowed[1] <= timing.tolerance:
            return slowed
    assert best is not None
    return best


def _held(scene: Scene, timing: PathTiming) -> tuple[Trajectory, float, OnMesh]:
    """The fastest motion between given speeds, with limits tightened until none is exceeded: in
    cells in which one was found to be, and at last in all; its gap, and what it is on its mesh.

    Raises NotConverged where that takes too long.
    """
    problem, raw = problem_of(scene), timing.refined(_SHARES[0])
    margins, rows = np.zeros(len(raw.losses)), kept_rows(problem.limits.constraints)
    for _ in range(_MOST_MARGINS):
        found, loss = timing.tightened(raw, margins)
        trajectory = _on_mesh(scene, found)
        highest = highest_rows(problem, trajectory)
        beyond, cells = np.maximum(highest.values[rows] - 1, 0.0), highest.intervals[rows]
        if beyond.max() <= _KEPT:
            return trajectory, loss, found
        if beyond.max() <= _FOR_NOTHING * timing.tolerance:
            margins += _MORE * beyond.max()
        else:
            np.maximum.at(margins, cells, margins[cells] + _MORE * beyond)
    raise NotConverged("limits are exceeded between points of every mesh", "margin", trajectory)


def _require_positions(scene: Scene, trajectory: Trajectory) -> None:
    """Raise Infeasible where a path is beyond a limit of position, which no timing cures."""
    constraints = limits_of(scene).up_to(2).constraints
    positions = np.flatnonzero(constraints.of_place)
    if not len(positions):
        return
    highest = highest_rows(problem_of(scene), trajectory)
    worst = int(positions[highest.values[positions].argmax()])
    if highest.values[worst] > 1 + _TOUCHED:
        begin, end = trajectory.knots[highest.intervals[worst] :][:2]
        x, y, z = trajectory(begin + highest.fractions[worst] * (end - begin)).x.tolist()
        if constraints.convex[worst]:  # raises what names the body
            require_state(scene, "the path", Boundary((x, y, z)), orders=1, is_given=False)
        place = f"at {in_words((x, y, z))} m"
        raise Infeasible(f"the path: {place} {constraints.label(worst)} is beyond its limit")


def near_corners(scene: Scene, corners: Array, of_room: float) -> Scene:
    """The scene with via points at all corners but its ends, (n, 3), m, each as wide as a share of
    the room that bodies leave: none of it for exactly these corners."""
    distances, _ = signed_distances(problem_of(scene), corners[1:-1])
    room = of_room * (distances - limits_of(scene).least_distances).min(axis=1)
    via = [
        {"at": place, "within": within} if within > _NEAREST else place
        for place, within in zip(corners[1:-1].tolist(), room.tolist(), strict=True)
    ]
    return scene.model_copy(update={"via": via})


def fastest_along(scene: Scene, corners: Array, tolerance: float) -> Plan | None:
    """The fastest motion on straight legs through corners, (n, 3), m, both ends among them, these
    rounded as far as bodies allow; None if none is clear of bodies."""
    shortest = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).min())
    inner = tuple((x, y, z) for x, y, z in corners[1:-1].tolist())
    for share in _BLENDS if inner else ():
        path = Corners(points=inner, blend=share * shortest)
        alone = scene.model_copy(update={"path": path, "keep_out": None, "clearance": None})
        found = if_possible(RULED_OUT, fastest_on_path, alone, tolerance, lambda _: None)
        if found is None:
            continue
        if sure_excess(problem_of(scene), found.trajectory.position).max() <= 0:
            return found
    return None
