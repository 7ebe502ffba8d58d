"""Motions along straight lines that are known to be clear of bodies: near their corners, or exactly
on them but for rounded corners."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.sure_bounds import signed_distances, sure_excess
from deltaopt.planning.path.path_planning import PathMotion, fastest_on_path
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.path import Corners
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

_BLENDS = (0.499, 0.1, 0.01, 0.001)
"""Where corners begin to be rounded, as shares of the shortest leg: long roundings are driven
faster, short ones stay closer to the path."""
_OF_ROOM = 0.9
"""Share of the distance from all bodies at a corner, within which motions pass it."""
_NEAREST = 1e-5
"""m, within which no corner is passed: bodies that leave less are passed at the corner itself."""


def near_corners(scene: Scene, corners: Array) -> Scene:
    """The scene with via points at all corners but its ends, (n, 3), m, each as wide as bodies
    leave room."""
    limits = limits_of(scene).up_to(2)
    distances, _ = signed_distances(problem_of(scene), corners[1:-1])
    room = _OF_ROOM * (distances - limits.bounds[0][limits.constraints.convex]).min(axis=1)
    via = [
        {"at": place, "within": within} if within > _NEAREST else place
        for place, within in zip(corners[1:-1].tolist(), room.tolist(), strict=True)
    ]
    return scene.model_copy(update={"via": via})


def through_corners(scene: Scene, corners: Array) -> Scene:
    """The scene with via points exactly at these corners."""
    return scene.model_copy(update={"via": corners[1:-1].tolist()})


def fastest_along(scene: Scene, corners: Array, tolerance: float) -> PathMotion | None:
    """The fastest motion on straight legs through corners, (n, 3), m, both ends among them, these
    rounded as far as bodies allow; None if none is clear of bodies."""
    shortest = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).min())
    inner = tuple((x, y, z) for x, y, z in corners[1:-1].tolist())
    for share in _BLENDS if inner else ():
        path = Corners(points=inner, blend=share * shortest)
        alone = scene.model_copy(update={"path": path, "keep_out": None, "clearance": None})
        assert isinstance(alone.task, OnPath)
        found = if_possible(
            RULED_OUT, fastest_on_path, alone, alone.task, tolerance, lambda _: None
        )
        if (
            found is not None
            and sure_excess(problem_of(scene), found.trajectory.position).max() <= 0
        ):
            return found
    return None
