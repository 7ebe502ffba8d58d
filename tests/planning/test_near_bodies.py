"""Bodies that are far from a motion are left out, until one is not known to be clear of them."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene, plan
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.planning.past_bodies.near_bodies import past_these, with_those_hit
from deltaopt.scene.scene import Scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

WALL = load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml")
LINE = first_motion(WALL.model_copy(update={"keep_out": None}))
(THE_WALL,) = WALL.keep_out or ()
FAR = [{"sphere": {"centre": [1.4, 0.3 * k, 0.6], "radius": 0.05}} for k in range(-2, 2)]


def with_far(*more: object) -> Scene:
    """The wall of the scene after bodies that are far away, and others after these."""
    content = dict(WALL) | {"keep_out": [*FAR, THE_WALL.model_dump(exclude_none=True), *more]}
    return Scene.model_validate(content)


def test_what_a_motion_runs_into_is_added():
    scene = with_far()
    part = past_these(scene, {1, 2})
    more = with_those_hit(scene, part, LINE.position)
    assert more is not None
    assert more.keep_out == tuple((scene.keep_out or ())[k] for k in (1, 2, 4))
    assert with_those_hit(scene, more, LINE.position) is None
    assert with_those_hit(scene, scene, LINE.position) is None


def test_a_plan_past_the_near_ones_alone():
    """It is that of the scene with these alone, and verified against all."""
    found, alone = plan(with_far()), plan(WALL)
    assert found.duration == pytest.approx(alone.duration, rel=1e-9)
    assert verify(found.scene, found.trajectory).ok
    assert len(found.scene.keep_out or ()) == 5
    assert {each.limit for each in found.sensitivities} == {
        each.limit for each in alone.sensitivities
    }


def test_one_that_only_the_plan_runs_into():
    """A ball in the way of the motion over the wall, far from the straight line: it is added."""
    over = plan(WALL).trajectory
    top = over.position.at(np.array([over.duration / 2]))[0] - [0.005, 0.0, 0.0]
    scene = with_far({"sphere": {"centre": top.tolist(), "radius": 0.01}})
    found = plan(scene)
    assert verify(scene, found.trajectory).ok
    assert found.duration > over.duration
