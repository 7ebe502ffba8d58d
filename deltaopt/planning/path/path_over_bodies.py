"""The path that a controller would be given where bodies are in the way: up, across and down.

Its corners are rounded as widely as its height allows, and it is no higher than it must be. This is
what a motion on a free path past bodies is compared with, for the straight line is blocked there.
"""

from __future__ import annotations

from math import dist

import numpy as np

from deltaopt.curves.halving import bisected_number
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.path import PickAndPlace
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import RestToRest, given_points

_SAMPLES = 4001
"""Places of a path that are looked at: some 0.1 mm apart on the usual cycle."""
_SPARE = 1e-5
"""m, beyond the clearance asked for: for what lies between samples. It costs 1e-5 of
the duration on the usual cycle."""
_HEIGHTS = np.geomspace(2e-3, 0.3, 40)
"""m, above the higher end, tried until a path is clear. Roundings of half the way meet."""
_STRAIGHT = 1e-5
"""m, the height at which a path counts as the straight line, which needs no other beside it."""
_ROUNDED = 1 - 1e-9
"""Of the height: all of it would be beyond the leg by rounding."""
_HALVINGS = 24
"""Of the last step between two heights: to a nanometre."""


def rounded_path_over(scene: Scene) -> PickAndPlace | None:
    """The lowest path up, across and down that clears all keep-out bodies of a scene, rounded from
    its height on. None where no body is in the way of the straight line or there is no such path,
    and where an end moves or points or a path between the ends are given."""
    if scene.keep_out is None or scene.path is not None or not isinstance(scene.task, RestToRest):
        return None
    start, goal = map(np.array, given_points(scene.task))
    widest = dist(goal[1:], start[1:]) / 2
    heights = [height for height in _HEIGHTS.tolist() if height < widest]
    clear = next((i for i, height in enumerate(heights) if _is_clear(scene, height)), None)
    if clear is None:
        return None
    if clear == 0 and _is_clear(scene, _STRAIGHT):
        return None
    low, high = heights[clear - 1] if clear else _STRAIGHT, heights[clear]
    return _path(bisected_number(lambda height: _is_clear(scene, height), low, high, _HALVINGS)[1])


def _path(height: float) -> PickAndPlace:
    return PickAndPlace(height=height, blend=_ROUNDED * height)


def _is_clear(scene: Scene, height: float) -> bool:
    """Whether samples of the path of a height (m) keep the scene's clearance."""
    path = _path(height).between(*given_points(scene.task))
    limits, (begin, end) = limits_of(scene).up_to(2), path.knots[[0, -1]].tolist()
    distance, _ = signed_distances(problem_of(scene), path(np.linspace(begin, end, _SAMPLES)))
    kept = limits.bounds[0][limits.constraints.convex]
    return bool((distance >= kept + _SPARE).all())
