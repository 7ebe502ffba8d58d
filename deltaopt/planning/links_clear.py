"""Plans whose arms and forearms keep clear of bodies: ``robot_keeps_clear: true`` in a scene.

Hardly any link comes near a body. So a scene is planned with its tool kept clear alone; if all
links are surely clear of all bodies along that motion, it is the answer, and costs nothing more.
Otherwise the pairs of a link and a body that come near become limits, and it is planned again,
until all links are clear.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np

from deltaopt.curves.piecewise import Truths
from deltaopt.errors import Infeasible, NotConverged
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.limit_sensitivity import Multipliers
from deltaopt.motion.links import least_rooms
from deltaopt.planning.loop import Loop
from deltaopt.planning.plan import Plan, quicker
from deltaopt.robot.model import delta_model
from deltaopt.scene.bodies import solids_about
from deltaopt.scene.links import kept_from_bodies, name_of, rooms_at, rooms_of_arms
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

_NEAR = 0.02
"""m: pairs that come so near are limits of the next plan. More of them cost time in each solve,
fewer may have to be joined later, which costs a plan."""
_SPARE, _LEAST_SPARE, _MOST_SPARE = 1e-2, 1e-8, 1e-5
"""m over the tolerance of the plan, by which links are planned farther away than they must be, at
least and at most, for what lies between the points of a mesh, where there is room for that at start
and goal. What it costs is told as part of the gap; less takes longer to make sure of."""
_ROUND = 1e-3
"""Least distance of a link's line that is planned, m, where there is room for it: about a sharper
edge, which neither the radius of link or body nor clearance rounds, a solver hardly finds its way.
"""
_FACTOR = 2.0
"""By how much more than what was missed links are planned farther away next time."""
_NEARER = 0.3
"""Share of what they are farther away than they must be that is kept at least from one plan to the
next, where that costs more than the tolerance leaves: much nearer a plan is hardly found from a
known one. Beside 15 walls 0.1 left seven plans above their tolerance, by up to 1 % longer."""
_PLANS = 8
"""At most."""
_ANGLES = 65
"""Of every arm between those at given points, at which it is looked at where a link is too near."""

Spare = dict[tuple[int, int], float]
"""By how much, m, the lines of links are planned farther from bodies than they must be, by the
indices of link and body."""


def keeping_links_clear(loop: Loop, scene: Scene, planned: Callable[[Scene], Plan]) -> Plan:
    """The plan of a scene whose links all keep clear of all bodies. Its gap has what it costs that
    they are planned farther away than they must be, as far as that is known.

    ``planned``: plans a scene by its limits, those of ``planned_links`` among them. Raises
    Infeasible where a link is in a body on a given path, or an arm turns past one on every path,
    and NotConverged where no plan has all links clear.
    """
    at_points = rooms_at(scene, np.array(scene.placed_points)).min(axis=0)
    usual = min(max(_SPARE * loop.optimiser.tolerance, _LEAST_SPARE), _MOST_SPARE)
    roundings = [body.radius for body in solids_about(scene.keep_out or ())]
    least, spare, plans = kept_from_bodies(scene).tolist(), Spare(), 0
    while True:
        found = planned(_limited(scene, spare))
        plans += 1
        rooms = least_rooms(scene, found.trajectory)
        too_near = {pair: rooms[pair] for pair in _pairs(rooms < 0)}
        if not too_near:
            return _nearer(loop, scene, found, spare)
        link, body = min(too_near, key=lambda pair: too_near[pair])
        missed = f"{name_of(link)} comes {-1e3 * rooms[link, body]:.3g} mm too near to "
        missed += f"keep_out[{body}]"
        if isinstance(scene.task, OnPath):
            raise Infeasible(f"the path: on it {missed}")
        if plans == _PLANS:
            raise NotConverged(
                f"arms and forearms are not clear of all bodies after {_PLANS} plans: {missed}",
                "No_Progress",
                found.trajectory,
            )
        if plans == 1 and (in_the_way := _in_the_way_of_arms(scene)):
            raise Infeasible(in_the_way)
        loop.journal.note(f"once more, for {missed}:")
        for pair in _pairs(rooms < _NEAR):
            begun = max(usual, _ROUND - least[pair[0]] - roundings[pair[1]])
            farther = _FACTOR * max(-rooms[pair], 0.0)
            wanted = spare[pair] + farther if pair in spare else begun
            spare[pair] = min(wanted, at_points[pair] / 2)
        spare = dict(sorted(spare.items()))


def _in_the_way_of_arms(scene: Scene) -> str | None:
    """Which arm is in a body at an angle between those that it has at given points, in a sentence:
    where an arm is depends on its angle alone. None where none is."""
    points, model = np.array(scene.placed_points), delta_model(scene.robot, scene.payload)
    q, _, _ = model.motion(points, *np.zeros((2, *points.shape)))
    theta = np.unwrap(q[:, model.functions.motors], axis=0)  # none turns all the way round
    angles = np.linspace(theta.min(axis=0), theta.max(axis=0), _ANGLES)
    rooms = rooms_of_arms(scene, angles)
    worst, arm, body = np.unravel_index(rooms.argmin(), rooms.shape)
    if rooms[worst, arm, body] >= 0:
        return None
    return (
        f"between the given points {name_of(2 * int(arm))} turns past an angle of "
        f"{angles[worst, arm]:.3g} rad, at which it is {-1e3 * rooms[worst, arm, body]:.3g} mm too "
        f"near to keep_out[{body}]"
    )


def _nearer(loop: Loop, scene: Scene, found: Plan, spare: Spare) -> Plan:
    """A plan with all links clear, with what that costs in its gap; improved nearer to the bodies
    where the gap is then above the tolerance, as long as links are clear."""
    tolerance, cost = loop.optimiser.tolerance, _cost(found.multipliers, spare)
    best = replace(found, gap=found.gap + cost)
    while found.gap <= tolerance < best.gap and max(spare.values()) > _LEAST_SPARE:
        told = f"nearer to bodies: the distance costs {cost:.1e} of the duration:"
        loop.journal.note(f"once more, {told}")
        share = max((tolerance - found.gap) / cost / _FACTOR, _NEARER)
        spare = {pair: max(share * more, _LEAST_SPARE) for pair, more in spare.items()}
        begun = replace(found, gap=inf, iterations=0)  # its gap is that of a plan farther away
        nearer = loop.improved(_limited(scene, spare), begun)
        if nearer.cost >= found.cost or (least_rooms(scene, nearer.trajectory) < 0).any():
            break
        found, cost = nearer, _cost(nearer.multipliers, spare)
        best = quicker(best, replace(found, gap=found.gap + cost))
    return best


def _limited(scene: Scene, spare: Spare) -> Scene:
    """The scene with what is planned for pairs of a link and a body: the least distance of the
    link's line, m."""
    least = kept_from_bodies(scene).tolist()
    planned = ((link, body, least[link] + more) for (link, body), more in spare.items())
    return scene.model_copy(update={"planned_links": tuple(planned)})


def _cost(multipliers: Multipliers | None, spare: Spare) -> float:
    """By what share the duration is longer because limits of links are tighter by so much, m; 0
    where multipliers are not known."""
    if multipliers is None or not spare:
        return 0.0
    constraints = multipliers.limits.constraints
    parts = zip(constraints.limits, constraints.slices, strict=True)
    rows = next(own for limit, own in parts if limit.own_measure is OwnMeasure.LINKS)
    growth = multipliers.of_rows()[rows] / multipliers.limits.scales[rows]
    return float(growth[: len(spare)] @ list(spare.values()))


def _pairs(which: Truths) -> list[tuple[int, int]]:
    return [(int(link), int(body)) for link, body in np.argwhere(which)]
