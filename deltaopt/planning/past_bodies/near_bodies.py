"""Which keep-out bodies a motion is planned past.

Each body is a row at every point of a mesh, and most are far away. So motions are planned past the
bodies that are near, and are then known to be clear of the others, or planned again.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial, Truths
from deltaopt.motion.sure_bounds import rows_not_kept, signed_distances
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene

_NEAR, _SAMPLES = 0.05, 65
"""Of the way from start to goal: motions are planned past bodies that a first motion comes nearer
to, at so many places. A smaller share leaves more to plan again, a larger one slows meshes."""


def near(scene: Scene, position: PiecewisePolynomial) -> frozenset[int]:
    """The bodies that a motion comes near, by samples."""
    x = position.at(np.linspace(position.knots[0], position.knots[-1], _SAMPLES))
    distances, _ = signed_distances(problem_of(scene), x)
    way = float(np.linalg.norm(x[-1] - x[0]))
    kept = problem_of(scene).limits.least_distances + _NEAR * way
    return _of_rows(scene, np.asarray((distances <= kept).any(axis=0)))


def with_those_hit(scene: Scene, part: Scene, position: PiecewisePolynomial) -> Scene | None:
    """A scene with some of the bodies of another and with those besides that a motion runs into;
    None if there are none to add."""
    kept, every = part.keep_out or (), scene.keep_out or ()
    if len(kept) == len(every):
        return None
    absent = [i for i, body in enumerate(every) if not any(body is each for each in kept)]
    hit = {absent[i] for i in those_hit(past_these(scene, absent), position)}
    present = set(range(len(every))) - set(absent)
    return past_these(scene, present | hit) if hit else None


def those_hit(scene: Scene, position: PiecewisePolynomial) -> frozenset[int]:
    """The bodies that a motion runs into."""
    return _of_rows(scene, rows_not_kept(problem_of(scene), position))


def past_these(scene: Scene, bodies: Collection[int]) -> Scene:
    """A scene with some of its bodies alone; itself if these are all, or links of the robot are
    planned to keep clear of bodies, by their indices."""
    every = scene.keep_out or ()
    if len(bodies) == len(every) or scene.planned_links:
        return scene
    chosen = [every[index] for index in sorted(bodies)]
    return scene.model_copy(update={"keep_out": chosen or None})


def _of_rows(scene: Scene, rows: Truths) -> frozenset[int]:
    """The bodies of some rows, (rows,)."""
    used = rows[np.isfinite(problem_of(scene).limits.least_distances)]
    return frozenset(
        index for (index, _), chosen in zip(scene.obstacles, used, strict=True) if chosen
    )
