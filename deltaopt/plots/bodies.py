"""Keep-out bodies as shadows, and via points, in a picture of a path."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from deltaopt.curves.piecewise import Array
from deltaopt.output.body_outlines import corners_of
from deltaopt.plots.colours import BLACK, GREY, LIGHT_GREY
from deltaopt.scene.bodies import Body
from deltaopt.scene.scene import Scene

_BESIDE = 0.35
"""Of the path's extent, how far beside it bodies are shown."""
_FAR = 3.0
"""How far a half-space is drawn, m: beyond all that a picture shows."""


def draw_bodies(axes: Axes, scene: Scene, place: Callable[[Array], Array]) -> None:
    """Draw the outlines of a scene's bodies behind what is drawn already, whose range grows a bit
    to show those nearby.

    ``place``: takes points (N, 3), m, to the picture, (N, 2).
    """
    if scene.keep_out is None:
        return
    seen = np.array(axes.dataLim.get_points())
    beside = _BESIDE * float(np.ptp(seen, axis=0).max())
    low, high = seen[0] - beside, seen[1] + beside
    for body in scene.keep_out:
        if _covers_all(body, place):
            continue
        outline = place(corners_of(body, _FAR))
        shadow = Polygon(_hull(outline), color=LIGHT_GREY, linewidth=0.0, zorder=0)
        axes.add_artist(shadow)  # which, unlike a patch, does not widen the range
        if body.half_space is None:
            axes.update_datalim(np.clip(outline, low, high))


def draw_via_points(axes: Axes, scene: Scene, place: Callable[[Array], Array]) -> None:
    """Draw a scene's via points as diamonds, and the spheres about them as circles.

    ``place``: takes points (N, 3), m, to the picture, (N, 2), all lengths by the same factor.
    """
    for point in scene.task.via:
        centre = np.array(point.position)
        ((across, up),) = place(centre[None]).tolist()
        axes.plot(across, up, "D", color=BLACK, markerfacecolor="white", markersize=4, zorder=5)
        if point.within:
            offsets = place(centre + point.within * np.eye(3)) - (across, up)
            # Of a parallel projection: lengths of its two rows.
            radius = float(np.sqrt((offsets**2).sum() / 2))
            axes.add_patch(
                Circle((across, up), radius, fill=False, edgecolor=GREY, linewidth=0.9, zorder=5)
            )


def _covers_all(body: Body, place: Callable[[Array], Array]) -> bool:
    """Whether a body is a half-space whose plane is seen from its front."""
    if body.half_space is None:
        return False
    seen = np.diff(place(np.array([np.zeros(3), body.half_space.normal])), axis=0)
    return float(np.linalg.norm(seen)) < 1e-6


def _hull(points: Array) -> Array:
    """The corners of the convex hull of points in a plane, in their order, (n, 2)."""
    ordered = points[np.lexsort(points.T[::-1])]
    halves = []
    for line in (ordered, ordered[::-1]):
        chain: list[Array] = []
        for point in line:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        halves += chain[:-1]
    return np.array(halves)


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
