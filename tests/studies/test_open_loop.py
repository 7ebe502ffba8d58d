"""Torques of a plan played without feedback."""

from __future__ import annotations

import pytest

from studies import open_loop
from studies.problems import PICK_AND_PLACE


@pytest.fixture(scope="module")
def found() -> dict[str, open_loop.Arrival]:
    arrivals = open_loop.measure(lambda done, what: None, (PICK_AND_PLACE,), 3, 1, 1000)
    return {a.off: a for a in arrivals}


def test_the_torques_alone_bring_the_platform_to_its_goal(found):
    """By integration that shares nothing with the planner but the forward dynamics."""
    assert found["nothing"].distances.max() < 1e-11
    assert found["nothing"].speeds.max() < 1e-9


def test_errors_act_in_proportion(found):
    """A percent of torque is some percent of the way; heavier and lighter are nearly opposite."""
    torque = found["torques by up to 1%"]
    assert torque.distances.shape == (3,)
    assert 1e-3 < torque.distances.max() / torque.way < 0.05
    heavier, lighter = (found[f"payload 5% {word}"].distances[0] for word in ("heavier", "lighter"))
    assert heavier == pytest.approx(lighter, rel=0.1)


def test_a_linear_table_is_better_than_a_held_one(found):
    linear, held = (found[f"table of 1 ms, {word}"] for word in ("linear between", "held"))
    assert linear.distances[0] < held.distances[0] / 2
