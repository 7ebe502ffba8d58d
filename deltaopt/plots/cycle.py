"""A cycle as one picture: the paths of its legs, the use of its motors over a period."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from deltaopt.curves.piecewise import Array
from deltaopt.output.cycle_files import headline_of_cycle
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.plan import Plan
from deltaopt.plots.colours import BLACK, GREY, LIGHT_GREY
from deltaopt.plots.robot_view import along_move
from deltaopt.plots.style import (
    LARGE,
    SMALL,
    figure,
    motor_curves,
    name_lines,
    name_rms,
    verbatim,
    without_box,
)
from deltaopt.plots.surroundings import Place, draw_bodies, draw_moving_ends, draw_via_points
from deltaopt.scene.known_limits import limits_of

_SAMPLES = 400
"""Of the path of a leg."""
_NEAR_ENDS = 100
"""Of these, how many at either end of a path have no number."""
_DISCS = 8
"""How many times as far as from other paths numbers are from each other: each covers some of its
path."""
_DISC = {"boxstyle": "circle,pad=0.1", "facecolor": "white", "edgecolor": "none"}
"""About the number of a leg, which is written into its path."""
_INSIDE = np.array([0.0, 0.25, 0.5, 0.75, 1 - 1e-9])
"""Fractions of an interval between two knots, at which torques are drawn, its end nearly."""
_SIDES = {0.0: "above the start (mm)", np.pi / 2: "beside the start (mm)"}
"""What the upward axis of the path's panels says, by the angle from which they are seen."""


def draw_cycle(file: Path, plan: CyclePlan) -> None:
    """Draw a planned cycle into a file, whose suffix says the format: png, pdf or svg."""
    with figure(file, 7.2, 4.6) as page:
        page.suptitle(headline_of_cycle(plan), fontsize=LARGE)
        grid = page.add_gridspec(2, 2, height_ratios=[1.25, 1])
        ends = [leg.trajectory(leg.trajectory.knots[[0]]).x[0] for leg in plan.legs]
        apart = max(combinations(ends, 2), key=lambda two: float(np.linalg.norm(two[1] - two[0])))
        views = [along_move(*apart, tilt) for tilt in _SIDES]  # with the farthest side by side
        places = [_apart([_path(leg, place) for leg in plan.legs]) for place in views]
        widest = max(range(len(views)), key=lambda column: places[column][1])
        for column, (place, (tilt, up)) in enumerate(zip(views, _SIDES.items(), strict=True)):
            axes = page.add_subplot(grid[0, column])
            _paths(axes, plan, place, up)
            axes.set_title("side view: loaded solid, empty dashed" if tilt == 0 else "from above")
            for number, (x, y) in enumerate(places[column][0] if column == widest else (), 1):
                axes.annotate(f"{number}", (x, y), ha="center", va="center", bbox=_DISC, zorder=5)
        _torques(page.add_subplot(grid[1, :]), plan)
        robot = plan.legs[0].scene.robot
        caption = f"{robot.name}; legs are numbered, the robot dwells where it is shaded"
        page.supxlabel(verbatim(caption), fontsize=SMALL, color=GREY)


def _path(leg: Plan, place: Place) -> Array:
    """Places along the path of a leg, (N, 2), mm."""
    return place(leg.trajectory(leg.trajectory.instants(_SAMPLES)).x)


def _apart(paths: Sequence[Array]) -> tuple[list[Array], float]:
    """A place on each path, (2,), not near its ends, where paths meet, that is as far from other
    paths as any, and ``_DISCS`` times as far from the places on those before it; and the least of
    these distances, mm."""
    places, least = list[Array](), np.inf
    for number, path in enumerate(paths):
        inner = path[_NEAR_ENDS:-_NEAR_ENDS]
        others = [*paths[:number], *paths[number + 1 :]]
        away = [np.linalg.norm(inner[:, None] - each, axis=2).min(axis=1) for each in others]
        away += [np.linalg.norm(inner - each, axis=1) / _DISCS for each in places]
        room = np.min(away, axis=0)
        places.append(inner[room.argmax()])
        least = min(least, float(room.max()))
    return places, least


def _paths(axes: Axes, plan: CyclePlan, place: Place, up: str) -> None:
    """Draw the paths of all legs, and what is about them."""
    for leg in plan.legs:
        path = _path(leg, place)
        style = "-" if leg.scene.payload else "--"
        axes.plot(*path.T, style, color=BLACK, linewidth=1.2, zorder=4)
        axes.plot(*path[0], "o", color=BLACK, markersize=3.5, zorder=4)
        draw_via_points(axes, leg.scene, place)
        draw_moving_ends(axes, leg.scene, leg.trajectory, place)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    seen = axes.dataLim.frozen()  # bodies may be much larger
    for leg in plan.legs:
        draw_bodies(axes, leg.scene, place)
    axes.dataLim.set(seen)
    axes.autoscale_view()
    axes.set_xlabel("along (mm)")
    axes.set_ylabel(up)
    without_box(axes)


def _torques(axes: Axes, plan: CyclePlan) -> None:
    """Draw each motor's torque over the period in percent of its limit, and what its RMS may be."""
    knots = plan.trajectory.knots
    t = np.append((knots[:-1, None] + np.diff(knots)[:, None] * _INSIDE).ravel(), knots[-1])
    largest = limits_of(plan.legs[0].scene).upper("torque")
    assert largest is not None
    motor_curves(axes, 1e3 * t, 100 * plan.trajectory(t).tau / largest)
    limits = plan.cycle.rms_limits
    warmest = max(np.divide(plan.rms_torque, largest))
    told = f"torques: RMS up to {100 * warmest:.0f} % of the limit"
    for share in name_rms(axes, plan.rms_torque, limits, largest):
        told += f"; {100 * share:.0f} % are rated"
    ends = 1e3 * np.cumsum(plan.phases)
    for number, (arrives, leaves) in enumerate(zip(ends[::2], ends[1::2], strict=True)):
        axes.axvspan(arrives, leaves, color=LIGHT_GREY, alpha=0.5, linewidth=0, zorder=0)
        begins = 0.0 if number == 0 else ends[2 * number - 1]
        axes.annotate(f"{number + 1}", ((begins + arrives) / 2, 106), ha="center", color=GREY)
    axes.set_ylim(-105, 128)  # numbers stand above all torques
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("% of the limit")
    axes.set_title(told)
    name_lines(axes, room=0.2, apart=0.14)
