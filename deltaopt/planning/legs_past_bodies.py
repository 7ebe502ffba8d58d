"""First motions past bodies with points between, or with an end that moves: leg by leg.

Each leg is planned past the bodies from rest to rest, with all ways that this knows, and the legs
are joined; a start that moves comes to rest first, and a goal that is passed at a velocity has a
run-up. Such a motion is far from the best but on its side of every body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.moving_ends import end_of, run_up_to, start_of, stopping
from deltaopt.planning.first_motions.proposal import Proposal
from deltaopt.planning.first_motions.through_gates import places_of_gates
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import REST, EndState

_SLOWER = 1.5
"""By what factor legs are slowed: a method that begins at the limits hardly moves."""
_ALONE = dict.fromkeys(("via", "approach", "rotation")) | {"objective": Time()}
"""What a leg does not have."""


def legs_past_bodies(
    scene: Scene, planned: Callable[[Scene], Trajectory | None]
) -> Iterator[Proposal]:
    """The motions in legs through some places of the points between.

    ``planned``: the best motion of a scene from rest to rest, None where none is found.
    """
    goal = scene.task.goal
    if not isinstance(goal, EndState) or scene.tube is not None:
        return
    stop = stopping(scene)
    run_up = None if goal.velocity == REST else run_up_to(scene, goal)
    if run_up is None and goal.velocity != REST:
        return
    begin = scene.task.start.position if stop is None else end_of(stop.position)
    end = goal.position if run_up is None else start_of(run_up.position)
    for places in places_of_gates(scene):
        points: list[Vector3] = [begin, *((x, y, z) for x, y, z in places.tolist()), end]
        legs = list[Trajectory]()
        for one, other in pairwise(points):
            if np.array_equal(one, other):
                continue
            alone = scene.model_copy(update={**_ALONE, "start": one, "goal": other})
            leg = planned(alone)
            if leg is None:
                break
            legs.append(leg.slowed(_SLOWER))
        else:
            parts = [part for part in (stop, *legs, run_up) if part is not None]
            position = parts[0].position
            for part in parts[1:]:
                position = position.then(part.position)
            name = "motions past the bodies from rest to rest"
            yield Proposal(name, Trajectory(position, parts[-1].model), len(parts))
