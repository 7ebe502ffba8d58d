"""What a scene has about a path: bodies to keep out of, tubes and cylinders to stay in, points to
pass, belts to meet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle, Patch, Polygon

from deltaopt.curves.piecewise import Array
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.body_outlines import axis_points, columns_of, edges_of, hulled_points
from deltaopt.plots.colours import BLACK, GREY, LIGHT_BLUE, LIGHT_GREY, ORANGE
from deltaopt.scene.scene import Scene

Place = Callable[[Array], Array]
"""Takes points (N, 3), m, to the picture, (N, 2), all lengths by the same factor."""

_BESIDE = 0.5
"""Of the path's extent, how far beside it bodies are shown."""
_FAR = 3.0
"""How far a half-space is drawn, m: beyond all that a picture shows."""


def draw_surroundings(axes: Axes, scene: Scene, trajectory: Trajectory, place: Place) -> None:
    """Draw all that a scene has about a motion's path, bodies as shadows, behind what is drawn
    already, whose range grows a bit to show those nearby."""
    draw_bodies(axes, scene, place)
    draw_allowed(axes, scene, place)
    draw_via_points(axes, scene, place)
    draw_moving_ends(axes, scene, trajectory, place)


def draw_bodies(axes: Axes, scene: Scene, place: Place) -> None:
    """Draw the outlines of a scene's bodies, as ``draw_surroundings``."""
    if scene.keep_out is None:
        return
    seen = np.array(axes.dataLim.get_points())
    beside = _BESIDE * float(np.ptp(seen, axis=0).max())
    low, high = seen[0] - beside, seen[1] + beside
    for body in scene.keep_out:
        if body.half_space is not None:
            seen_normal = np.diff(place(np.array([np.zeros(3), body.half_space.normal])), axis=0)
            if np.linalg.norm(seen_normal) < 1e-6:  # its plane is seen from its front: all is body
                continue
        outline = place(hulled_points(body, _FAR))
        shadow = Polygon(_hull(outline), color=LIGHT_GREY, linewidth=0.0, zorder=0)
        axes.add_artist(shadow)  # which, unlike a patch, does not widen the range
        if body.half_space is None:
            axes.update_datalim(np.clip(outline, low, high))


def draw_bodies_near(axes: Axes, scene: Scene, path: Array, place: Place) -> None:
    """Draw what is near a path, (N, 3), m, of a scene's bodies, with their edges; planes as discs.
    Bodies reach far beyond what a picture of a robot shows."""
    low, high = path.min(axis=0), path.max(axis=0)
    beside = _BESIDE * float((high - low).max())
    low, high = low - beside, high + beside
    for body in scene.keep_out or ():
        edges = edges_of(body, path.mean(axis=0), 2 * beside)
        outline = hulled_points(body, _FAR)
        if body.half_space is not None:
            (outline,) = edges
        elif (outline.min(axis=0) > high).any() or (outline.max(axis=0) < low).any():
            continue
        else:
            outline, edges = outline.clip(low, high), [edge.clip(low, high) for edge in edges]
        shade = Polygon(_hull(place(outline)), color=LIGHT_GREY, alpha=0.6, linewidth=0.0, zorder=0)
        axes.add_patch(shade)
        for edge in edges:
            axes.plot(*place(edge).T, color=GREY, linewidth=0.5, zorder=0)


def draw_allowed(axes: Axes, scene: Scene, place: Place) -> None:
    """Draw the tube and the cylinders that a scene's motion stays in."""
    shapes: list[Patch] = [
        Polygon(_hull(place(hulled_points(column, _FAR)))) for column in columns_of(scene)
    ]
    radius = _radius(scene.tube or 0.0, place)
    shapes += [Circle((x, y), radius) for x, y in place(axis_points(scene)).tolist()]
    axes.add_collection(PatchCollection(shapes, color=LIGHT_BLUE, linewidth=0.0, zorder=0.5))


def draw_via_points(axes: Axes, scene: Scene, place: Place) -> None:
    """Draw a scene's via points as diamonds, and the spheres about them as circles."""
    for point in scene.task.via:
        centre = np.array(point.position)
        ((across, up),) = place(centre[None]).tolist()
        axes.plot(across, up, "D", color=BLACK, markerfacecolor="white", markersize=4, zorder=5)
        if point.within:
            radius = _radius(point.within, place)
            axes.add_patch(
                Circle((across, up), radius, fill=False, edgecolor=GREY, linewidth=0.9, zorder=5)
            )


def draw_moving_ends(axes: Axes, scene: Scene, trajectory: Trajectory, place: Place) -> None:
    """Draw the way of a goal on a belt during a motion as a band, and the velocities that a motion
    begins and ends with as arrows."""
    if not scene.moves_at_ends:
        return
    ends = trajectory(trajectory.knots[[0, -1]])
    goal = scene.task.goal
    if goal.moves:
        way = place(np.array([goal.position, ends.x[1]]))
        axes.plot(*way.T, color=ORANGE, alpha=0.5, linewidth=6, solid_capstyle="butt", zorder=0.5)
    for x, v in zip(ends.x, ends.v, strict=True):
        if np.linalg.norm(v) > 1e-6:
            tip = x + v * trajectory.duration / 2
            begin, end = place(np.array([x, tip])).tolist()
            axes.update_datalim([end])
            style = {"arrowstyle": "-|>", "color": ORANGE, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", end, begin, arrowprops=style, zorder=5)


def _radius(length: float, place: Place) -> float:
    """A length, m, in the picture: that of a parallel projection's two rows."""
    offsets = place(length * np.eye(3)) - place(np.zeros((1, 3)))
    return float(np.sqrt((offsets**2).sum() / 2))


def _hull(points: Array) -> Array:
    """The corners of the convex hull of points in a plane, in their order, (n, 2)."""
    ordered = points[np.lexsort(points.T[::-1])]
    halves = []
    for line in (ordered, ordered[::-1]):
        chain: list[Array] = []
        for point in line:
            while len(chain) > 1:
                (x, y), (u, v) = chain[-1] - chain[-2], point - chain[-2]
                if x * v - y * u > 0:  # a turn to the left
                    break
                chain.pop()
            chain.append(point)
        halves += chain[:-1]
    return np.array(halves)
