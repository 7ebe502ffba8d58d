"""The search of ways past bodies, with solvers that find nothing."""

from __future__ import annotations

from typing import NoReturn

import pytest

from deltaopt import NotConverged, Scene, State, plan
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.around_bodies import ways_beside
from deltaopt.planning.journal import Journal
from deltaopt.planning.loop import Loop
from deltaopt.planning.past_bodies.ways import fastest_way
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from tests.planned_scenes import CROSS


def test_that_nothing_is_found_is_said_where_only_motions_led_aside_are_known():
    """As into a bin at the top of the workspace."""
    body = {"sphere": {"centre": [0.85, 0.0, 0.0], "radius": 0.06}}
    ends = {
        "start": State(at=CROSS.start, velocity=(0.0, 0.5, 0.0)),
        "goal": State(at=CROSS.goal, velocity=(0.0, 0.5, 0.0)),
    }
    scene = Scene.model_validate(dict(CROSS) | ends | {"keep_out": [body]})
    free = plan(scene.model_copy(update={"keep_out": None})).trajectory
    ways = ways_beside(scene, free)
    assert len(ways) > 1

    class Fails(Loop):
        def made(self, attempt: Attempt) -> NotConverged:
            return NotConverged("nothing is solved", "Failed", attempt.motion)

        def on_first_mesh(self, attempt: Attempt) -> NoReturn:
            raise self.made(attempt)

    loop = Fails(TrajectoryOptimiser(), Journal(lambda _: None))
    with pytest.raises(NotConverged, match="nothing is solved"):
        fastest_way(loop, Attempt(scene, free, 16), iter([ways]), free)
