"""A wall across the way, together with points between, ends that move, a belt, an approach."""

from __future__ import annotations

from itertools import count

import numpy as np
from numpy.random import Generator

import deltaopt
from deltaopt.scene.feasibility import check_feasible

WALLS = (
    *("wall", "plate", "via", "spheres", "from a state", "to a state", "via to a state"),
    *("belt", "via to a belt", "approach"),
)
_THICK = (5e-4, 4e-3, 2e-2)
"""Half of how thick walls are, as shares of the robot's reach; plates have the first."""


def beside_wall(robot: deltaopt.Robot, kind: str, seed: int, number: int) -> deltaopt.Scene:
    """A scene of a kind, whose ends and points between are possible by themselves."""
    for attempt in count():
        rng = np.random.default_rng((seed, number, WALLS.index(kind), attempt))
        try:
            scene, points = _drawn(robot, kind, rng)
            for point in points:
                alone = {"via": None, "approach": None, "start": point, "goal": points[0]}
                if point != points[0]:
                    check_feasible(scene.model_copy(update=alone))
            check_feasible(scene)
        except deltaopt.DeltaOptError:
            continue
        return scene
    raise AssertionError


def _drawn(
    robot: deltaopt.Robot, kind: str, rng: Generator
) -> tuple[deltaopt.Scene, list[tuple[float, ...]]]:
    """A scene and the points at which its motion is to be, not all of which need be possible."""
    reach = robot.upper_arm.length + robot.forearm.length
    angle, half = rng.uniform(0, 2 * np.pi), reach * rng.uniform(0.1, 0.28)
    along = np.array([0.0, np.cos(angle), np.sin(angle)])
    aside = np.array([0.0, -along[2], along[1]])
    middle = reach * np.array([rng.uniform(0.55, 0.72), *rng.uniform(-0.1, 0.1, 2)])
    start, goal = middle - half * along, middle + half * along

    across = 1 if abs(along[1]) > abs(along[2]) else 2
    thick = reach * (_THICK[0] if kind == "plate" else rng.choice(_THICK))
    low, high = middle - reach, middle + reach
    low[0] = middle[0] - reach * rng.uniform(0.02, 0.08)
    place = middle[across] + along[across] * half * rng.uniform(-0.4, 0.4)
    low[across], high[across] = place - thick, place + thick
    content: dict[str, object] = {
        "robot": robot,
        "payload": 0.5,
        "start": tuple(start.tolist()),
        "goal": tuple(goal.tolist()),
        "keep_out": [{"box": {"from": low.tolist(), "to": high.tolist()}}],
    }

    def velocity() -> list[float]:
        x, y, z = (reach * rng.uniform(-0.8, 0.8, 3)).tolist()
        return [0.4 * x, y, z]

    between = list[tuple[float, ...]]()
    if "via" in kind or kind == "spheres":
        for share in sorted(rng.uniform(0.15, 0.85, rng.integers(1, 3)).tolist()):
            off = reach * (rng.uniform(-0.04, 0.04) * aside - (rng.uniform(-0.02, 0.08), 0, 0))
            between.append(tuple((start + share * (goal - start) + off).tolist()))
        within = {"within": 0.01 * reach} if kind == "spheres" else {}
        content["via"] = [{"at": point, **within} for point in between]
    if kind == "from a state":
        content["start"] = {"at": start.tolist(), "velocity": velocity()}
    if "to a state" in kind:
        content["goal"] = {"at": goal.tolist(), "velocity": velocity()}
    if "belt" in kind:
        belt = aside * reach * rng.uniform(0.15, 0.5) * rng.choice((-1.0, 1.0))
        content["goal"] = {"at": (goal - 0.2 * belt).tolist(), "belt": belt.tolist()}
    if kind == "approach":
        column = {"height": 0.03 * reach, "radius": 0.01 * reach}
        content["approach"] = {"start": column, "goal": column}
    ends = [tuple(start.tolist()), tuple(goal.tolist())]
    return deltaopt.Scene.model_validate(content), [*ends, *between]
