"""Random scenes with three features at once."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, count

import numpy as np

import deltaopt
from deltaopt import Cycle, Scene
from deltaopt.files.validated_record import Vector3
from deltaopt.robot.robot import as_delta
from deltaopt.scene.cycle import start_after
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.moving_ends import Belt, State
from studies.bench.changes import (
    Change,
    among_bodies,
    beside_a_forearm,
    friction,
    in_a_tube,
    lifted,
    moving,
    near_points,
    on_a_line,
    over_a_wall,
    range_of_payloads,
    through_points,
    to_a_belt,
    up_and_down,
)
from studies.bench.random_scenes import random_scenes
from studies.bench.strata import STRATA
from studies.problems import PROBLEMS

ROBOTS = ("hornet_565", "industrial", "industrial_drive", "industrial_limited", "orsino", "rl5")
_RANDOM = STRATA["random robots"].robot
_RATED = 0.6
"""RMS torque of a cycle that motors may have, of their peak."""


def _either(one: Change, other: Change) -> Change:
    return lambda scene, rng: (one if rng.uniform() < 0.5 else other)(scene, rng)


def _beside_links(scene: Scene, rng: np.random.Generator) -> Scene:
    """A sphere near a forearm, beside the bodies that there are."""
    found = beside_a_forearm(scene, rng)
    bodies = (*(scene.keep_out or ()), *(found.keep_out or ()))
    return found.model_copy(update={"keep_out": bodies})


def _tool_of_shapes(scene: Scene, rng: np.random.Generator) -> Scene:
    """A stem and a block, over a wall where there is no body yet."""
    scene = scene if scene.keep_out else over_a_wall(scene, rng)
    start, goal = np.array(scene.given_points)
    size = float(np.linalg.norm(goal - start)) * rng.uniform(0.02, 0.1)
    stem = {"capsule": {"from": [0, 0, 0], "to": [-2 * size, 0, 0], "radius": 0.3 * size}}
    block = {"box": {"from": [-size, -size, -size / 2], "to": [0, size, size / 2]}}
    robot = scene.robot.model_copy(update={"tool": {"shapes": [stem, block]}})
    return scene.model_copy(update={"robot": robot})


def _smooth(scene: Scene, rng: np.random.Generator) -> Scene:
    """Some 2 to 20 ms from no torque to the peak."""
    rates = np.array(scene.robot.torque_limits) / 10 ** rng.uniform(-2.7, -1.7)
    return scene.model_copy(update={"limits": {"torque_rate": tuple(rates.tolist())}})


CYCLE = "cycle"
FEATURES: dict[str, Change] = {
    "friction": friction,
    "range": range_of_payloads,
    "smooth": _smooth,
    "via": _either(through_points, near_points),
    "approach": up_and_down,
    "tube": in_a_tube(_either(on_a_line, lifted)),
    "bodies": _either(over_a_wall, among_bodies),
    "links": _beside_links,
    "shapes": _tool_of_shapes,
    "state": moving(0.2),
    "belt": to_a_belt,
    CYCLE: lambda scene, rng: scene,
}
"""In the order in which they are made."""
_APART = [("approach", other) for other in ("via", "belt", "state", "tube")]
_APART += [("tube", other) for other in ("via", "belt", "state")]
TRIPLES = tuple(
    triple
    for triple in combinations(FEATURES, 3)
    if not any({*pair} <= {*triple} for pair in _APART)
)
"""All that scenes may ask for together."""


def triple_of(number: int) -> tuple[str, ...]:
    """Every triple once, in an order that mixes them, and then again."""
    order = np.random.default_rng(len(TRIPLES)).permutation(len(TRIPLES))
    return TRIPLES[order[number % len(TRIPLES)]]


def drawn(seed: int, number: int) -> Scene | Cycle:
    """A scene or cycle whose ends and points between are possible by themselves: of the shipped
    robots in turn, each triple of another one every time, and every seventh time of a random
    one."""
    name = ROBOTS[(number + number // len(TRIPLES)) % len(ROBOTS)]
    robot = as_delta(deltaopt.load_robot(PROBLEMS / "robots" / f"{name}.yaml"))
    for attempt in count():
        rng = np.random.default_rng((seed, number, attempt))
        try:
            if number % 7 == 0:
                robot = _RANDOM(robot, rng)
            payload = float(rng.uniform(0.2, 1.0)) * robot.platform.mass
            (scene,) = random_scenes(robot, payload, 1, int(rng.integers(2**31)))
            for feature in triple_of(number):
                scene = FEATURES[feature](scene, rng)
            for point in _points(scene):
                alone = dict.fromkeys(("via", "approach", "path", "tube")) | {"goal": point}
                check_feasible(scene.model_copy(update={**alone, "start": scene.given_points[0]}))
            check_feasible(scene)
            return _there_and_back(scene) if CYCLE in triple_of(number) else scene
        except deltaopt.DeltaOptError:
            continue
    raise AssertionError


def _points(scene: Scene) -> Iterator[Vector3]:
    """The goal, or where it is on a belt at first, and the points between."""
    yield scene.goal.at if isinstance(scene.goal, Belt) else scene.given_points[1]
    yield from (point.position for point in scene.task.via)


def _there_and_back(scene: Scene) -> Cycle:
    """A scene's motion and the way back past the same bodies, by motors that may grow warm."""
    start = scene.start if isinstance(scene.start, State) else scene.given_points[0]
    alone = dict.fromkeys(("via", "approach", "path", "tube"))
    back = scene.model_copy(update={**alone, "start": start_after(scene.goal), "goal": start})
    if isinstance(scene.goal, Belt):  # which does not wait until motors are cool
        return Cycle(legs=(scene, back), rms_torque="none")
    a, b, c = (_RATED * np.array(scene.robot.torque_limits)).tolist()
    return Cycle(legs=(scene, back), rms_torque=(a, b, c))
