"""Cycles: legs and pauses together, against another transcription and against motions alone."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import Belt, Effort, Scene, State, load_robot, plan
from studies.problems import PROBLEMS
from tests.oracles.cycle import Asked, Leg, best_cycle

INDUSTRIAL, HORNET = (
    load_robot(PROBLEMS / "robots" / f"{name}.yaml") for name in ("industrial", "hornet_565")
)
HERE, THERE = (0.85, -0.1525, 0.0), (0.85, 0.1525, 0.0)


def fastest(start, goal, payload=None, robot=INDUSTRIAL, **more):
    scene = Scene(robot=robot, start=start, goal=goal, payload=payload, **more)
    return plan(scene, tolerance=1e-5)


@pytest.mark.parametrize("robot", [INDUSTRIAL, HORNET], ids=["industrial", "torque at speed"])
def test_without_a_limit_of_the_whole_legs_are_fastest_motions(robot):
    """Other payloads and the dwells change nothing."""
    legs = Leg(THERE, 1.0, dwell=0.05), Leg(HERE)
    found = best_cycle(Asked(robot, HERE, legs))
    alone = [fastest(HERE, THERE, 1.0, robot), fastest(THERE, HERE, robot=robot)]
    for duration, single in zip(found.durations, alone, strict=True):
        assert duration == pytest.approx(single.duration, rel=1e-4)
    assert found.period == pytest.approx(sum(found.durations) + 0.05, rel=1e-12)
