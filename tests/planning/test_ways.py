"""The search of ways past bodies."""

from __future__ import annotations

from typing import NoReturn

import pytest

from deltaopt import Effort, NotConverged, Planner, Scene, State, load_robot, plan
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.around_bodies import ways_beside
from deltaopt.planning.journal import Journal
from deltaopt.planning.loop import Loop
from deltaopt.planning.past_bodies.ways import fastest_way
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from studies.problems import PROBLEMS
from tests.good_plans import good_plan
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


def test_effort_past_bodies_is_no_more_than_near_the_fastest_motion():
    """The fastest motion is clear of all bodies; that of least effort without them is not, and the
    first way past them that was found is not the best."""
    aside = 0.3552, 0.3597
    bodies = [
        {"sphere": {"centre": [0.3831, 0.5147, 0.4331], "radius": 0.03784}},
        {"cylinder": {"from": [0.4815, *aside], "to": [1.0436, *aside], "radius": 0.02812}},
        {"half_space": {"point": [0.547, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}},
    ]
    scene = Scene.model_validate(
        {
            "robot": load_robot(PROBLEMS / "robots" / "hornet_565.yaml"),
            "payload": 0.09368,
            "start": [0.34352, 0.63426, 0.5153],
            "goal": [0.53709, 0.2475, 0.27133],
            "keep_out": bodies,
        }
    )
    fastest = plan(scene)
    duration = 1.738 * fastest.duration
    asked = scene.model_copy(update={"objective": Effort(duration=duration)})
    slower = fastest.trajectory.slowed(duration / fastest.duration)
    nearby = Planner(scene.robot).plan_near(asked, slower)
    assert good_plan(asked).cost < (1 + 2e-3) * nearby.cost


def _boards(*corners: tuple[list[float], list[float]]) -> list[dict[str, dict[str, list[float]]]]:
    return [{"box": {"from": low, "to": high}} for low, high in corners]


@pytest.mark.parametrize(
    ("robot", "start", "goal", "bodies", "known"),
    [
        (
            "industrial",
            [0.31411, -0.18392, -0.62726],
            [0.50169, -0.10797, -0.54051],
            _boards(
                ([0.29131, -0.23392, -0.66218], [0.29815, -0.13392, -0.59234]),
                ([0.33148, -0.23392, -0.66218], [0.33831, -0.13392, -0.59234]),
                ([0.49183, -0.16289, -0.58596], [0.49866, -0.07714, -0.46694]),
                ([0.53101, -0.16289, -0.58596], [0.53784, -0.07714, -0.46694]),
            ),
            0.1503,
        ),
        (
            "hornet_565",
            [0.66495, 0.06634, 0.32160],
            [0.36540, 0.63973, 0.36985],
            _boards(([0.27479, 0.28189, -0.47171], [1.76722, 0.45973, 1.14011])),
            0.2746,
        ),
    ],
    ids=["shelves", "wall at the top of the workspace"],
)
def test_the_way_back_is_found_too(
    robot: str,
    start: list[float],
    goal: list[float],
    bodies: list[dict[str, dict[str, list[float]]]],
    known: float,
):
    """Nothing tells the direction of time where there is no dry friction, but bodies are met in
    another order: from shelf to shelf it took 0.160 s there and 0.150 s back, over the wall 0.392 s
    and 0.274 s."""
    scene = Scene.model_validate(
        {
            "robot": load_robot(PROBLEMS / "robots" / f"{robot}.yaml"),
            "payload": 1.0,
            "start": start,
            "goal": goal,
            "keep_out": bodies,
        }
    )
    there = good_plan(scene).duration
    back = good_plan(scene.model_copy(update={"start": goal, "goal": start})).duration
    assert max(there, back) < (1 + 1e-3) * known
