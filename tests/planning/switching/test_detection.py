"""What a mesh shows: limits by their multipliers, contact points, changes at one instant."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.switching.detection import DetectionSettings, detect_structure
from deltaopt.planning.switching.structure import INACTIVE, ActiveLimits

MESH = np.full(20, 0.05)
UP, DOWN = ActiveLimits(control=1), ActiveLimits(control=-1)
AT_VELOCITY = ActiveLimits(velocity=1)


def loads(*motors: list[tuple[int, float]]) -> np.ndarray:
    """Of motors, each as (intervals, load) in turn, at three points of every interval."""
    columns = [np.repeat([load for _, load in m], [number for number, _ in m]) for m in motors]
    return np.repeat(np.stack(columns, axis=1)[:, None], 3, axis=1).astype(float)


def multipliers(*orders: np.ndarray) -> ByOrder:
    """Of control, velocity and position, of one value in every interval each."""
    return ByOrder(*(each[:, 0] for each in orders))


def test_a_motor_is_at_its_limits_of_speed_and_of_torque():
    """The first: its speed is held by the second's torque, which nothing else determines."""
    torque = loads([(20, 1.0)], [(10, -1.0), (10, 0.4)])
    speed = loads([(10, 0.5), (10, 1.0)], [(20, 0.1)])
    found = detect_structure(MESH, ByOrder(torque, speed))
    assert found.limits == ((UP, DOWN), (ActiveLimits(control=1, velocity=1), INACTIVE))
    assert found.lengths == pytest.approx([0.5, 0.5])


def test_of_more_limits_than_motors_the_cheapest_does_not_hold():
    """The higher torque costs nothing, the lower one is what a coarse mesh leaves unused."""
    torque, speed = loads([(20, 0.95)], [(20, -1.0)]), loads([(20, 1.0)], [(20, 0.1)])
    cost = multipliers(loads([(20, 0.3)], [(20, -1e-7)]), loads([(20, 0.5)], [(20, 0.0)]))
    assert detect_structure(MESH, ByOrder(torque, speed), multipliers=cost).limits == (
        (ActiveLimits(control=1, velocity=1), INACTIVE),
    )
    assert detect_structure(MESH, ByOrder(torque, speed)).limits == ((AT_VELOCITY, DOWN),)


def test_what_begins_at_one_instant_is_put_together():
    """Speed is seen at its limit an interval after the torque has left its own: by the torque's
    mean there, at a quarter of that interval."""
    torque = loads([(10, 1.0), (1, 0.4), (9, 0.2)], [(20, -1.0)])
    speed = loads([(11, 0.5), (9, 1.0)], [(20, 0.1)])
    found = detect_structure(MESH, ByOrder(torque, speed))
    assert found.limits == ((UP, DOWN), (AT_VELOCITY, DOWN))
    assert found.lengths[0] == pytest.approx(0.5 + 0.05 * 0.25)


def test_a_torque_that_jumps_nearby_keeps_its_own_instant():
    torque = loads([(10, 1.0), (1, 0.4), (9, 0.2)], [(10, -1.0), (1, -0.2), (9, 1.0)])
    speed = loads([(11, 0.5), (9, 1.0)], [(20, 0.1)])
    found = detect_structure(MESH, ByOrder(torque, speed))
    assert found.limits == ((UP, DOWN), (AT_VELOCITY, DOWN), (AT_VELOCITY, UP))
    assert np.cumsum(found.lengths)[:2] == pytest.approx([0.5125, 0.5 + 0.05 * 0.6])


def near_its_limit(costs: list[tuple[int, float]]) -> tuple[tuple[ActiveLimits, ...], ...]:
    """A motor whose speed is within 1 % of its limit for ten intervals, its torque at its limit."""
    speed = loads([(5, 0.5), (10, 0.995), (5, 0.5)], [(20, 0.1)])
    torque = loads([(20, 1.0)], [(20, -1.0)])
    cost = multipliers(loads([(20, 0.3)], [(20, -0.3)]), loads(costs, [(20, 0.0)]))
    return detect_structure(MESH, ByOrder(torque, speed), multipliers=cost).limits


def test_there_is_a_contact_point_where_the_multiplier_is_in_one_interval():
    assert near_its_limit([(9, 1e-5), (1, 3.0), (10, 1e-5)]) == (
        (UP, DOWN),
        (ActiveLimits(control=1, velocity_contact=1), DOWN),
    )


def test_a_limit_that_costs_nothing_does_not_hold():
    assert near_its_limit([(20, 1e-6)]) == ((UP, DOWN),)


def test_a_limit_is_held_only_where_it_costs_something():
    limits = near_its_limit([(8, 1e-6), (5, 0.5), (7, 1e-6)])
    assert [arc[0].velocity for arc in limits] == [0, 1, 0]


def test_a_position_limit_is_left_in_between_if_detection_may_split_it():
    """Its multiplier is nought for three intervals: left there, or held all along."""
    above = np.where(np.arange(20)[:, None, None] < 16, 1e-5, 0.1) * np.ones((20, 3, 2))
    above[..., 1] = 0.1
    torque = loads([(20, 0.3)], [(20, -1.0)])
    rows = ByOrder(torque, None, above - 1)
    along = loads([(6, -0.5), (3, 0.0), (7, -0.5), (4, 0.0)], [(20, 0.0)])
    cost = multipliers(loads([(20, 0.0)], [(20, -0.3)]), loads([(20, 0.0)], [(20, 0.0)]), along)
    apart = detect_structure(MESH, rows, DetectionSettings(widest=1), cost)
    whole = detect_structure(MESH, rows, DetectionSettings(widest=1, split=False), cost)
    assert [arc[0].position for arc in apart.limits] == [-1, 0, -1, 0]
    assert [arc[0].position for arc in whole.limits] == [-1, 0]
