"""What a mesh shows: limits by their prices, touches, and what changes at one instant."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.switching.detection import Prices, Reading, read_structure
from deltaopt.planning.switching.structure import FREE, Limit

MESH = np.full(20, 0.05)
UP, DOWN = Limit(torque=1), Limit(torque=-1)
AT_SPEED = Limit(speed=1)


def loads(*motors: list[tuple[int, float]]) -> np.ndarray:
    """Of motors, each as (intervals, load) in turn, at three points of every interval."""
    columns = [np.repeat([load for _, load in m], [number for number, _ in m]) for m in motors]
    return np.repeat(np.stack(columns, axis=1)[:, None], 3, axis=1).astype(float)


def prices(torque: np.ndarray, speed: np.ndarray, opening: np.ndarray | None = None) -> Prices:
    """Of one value in every interval each."""
    opening = np.zeros_like(speed) if opening is None else opening
    return Prices(torque[:, 0], np.stack([speed[:, 0], opening[:, 0]], axis=2))


def test_a_motor_is_at_its_limits_of_speed_and_of_torque():
    """The first: its speed is held by the second's torque, which nothing else determines."""
    torque = loads([(20, 1.0)], [(10, -1.0), (10, 0.4)])
    speed = loads([(10, 0.5), (10, 1.0)], [(20, 0.1)])
    found = read_structure(MESH, torque, speed)
    assert found.limits == ((UP, DOWN), (Limit(torque=1, speed=1), FREE))
    assert found.lengths == pytest.approx([0.5, 0.5])


def test_of_more_limits_than_motors_the_cheapest_does_not_hold():
    """The higher torque costs nothing, the lower one is what a coarse mesh leaves unused."""
    torque, speed = loads([(20, 0.95)], [(20, -1.0)]), loads([(20, 1.0)], [(20, 0.1)])
    cost = prices(loads([(20, 0.3)], [(20, -1e-7)]), loads([(20, 0.5)], [(20, 0.0)]))
    assert read_structure(MESH, torque, speed, prices=cost).limits == (
        (Limit(torque=1, speed=1), FREE),
    )
    assert read_structure(MESH, torque, speed).limits == ((AT_SPEED, DOWN),)


def test_what_begins_at_one_instant_is_put_together():
    """Speed is seen at its limit an interval after the torque has left its own: by the torque's
    mean there, at a quarter of that interval."""
    torque = loads([(10, 1.0), (1, 0.4), (9, 0.2)], [(20, -1.0)])
    speed = loads([(11, 0.5), (9, 1.0)], [(20, 0.1)])
    found = read_structure(MESH, torque, speed)
    assert found.limits == ((UP, DOWN), (AT_SPEED, DOWN))
    assert found.lengths[0] == pytest.approx(0.5 + 0.05 * 0.25)


def test_a_torque_that_jumps_nearby_keeps_its_own_instant():
    torque = loads([(10, 1.0), (1, 0.4), (9, 0.2)], [(10, -1.0), (1, -0.2), (9, 1.0)])
    speed = loads([(11, 0.5), (9, 1.0)], [(20, 0.1)])
    found = read_structure(MESH, torque, speed)
    assert found.limits == ((UP, DOWN), (AT_SPEED, DOWN), (AT_SPEED, UP))
    assert np.cumsum(found.lengths)[:2] == pytest.approx([0.5125, 0.5 + 0.05 * 0.6])


def near_its_limit(costs: list[tuple[int, float]]) -> tuple[tuple[Limit, ...], ...]:
    """A motor whose speed is within 1 % of its limit for ten intervals, its torque at its limit."""
    speed = loads([(5, 0.5), (10, 0.995), (5, 0.5)], [(20, 0.1)])
    torque = loads([(20, 1.0)], [(20, -1.0)])
    cost = prices(loads([(20, 0.3)], [(20, -0.3)]), loads(costs, [(20, 0.0)]))
    return read_structure(MESH, torque, speed, prices=cost).limits


def test_a_limit_is_touched_where_its_price_is_in_one_interval():
    assert near_its_limit([(9, 1e-5), (1, 3.0), (10, 1e-5)]) == (
        (UP, DOWN),
        (Limit(torque=1, grazed=1), DOWN),
    )


def test_a_limit_that_costs_nothing_does_not_hold():
    assert near_its_limit([(20, 1e-6)]) == ((UP, DOWN),)


def test_a_limit_is_held_only_where_it_costs_something():
    limits = near_its_limit([(8, 1e-6), (5, 0.5), (7, 1e-6)])
    assert [arc[0].speed for arc in limits] == [0, 1, 0]


def test_a_fold_is_left_in_between_if_it_is_read_so():
    """Its price is nought for three intervals: left there, or held all along."""
    opening = np.where(np.arange(20)[:, None, None] < 16, 1e-5, 0.1) * np.ones((20, 3, 2))
    opening[..., 1] = 0.1
    torque = loads([(20, 0.3)], [(20, -1.0)])
    along = loads([(6, 0.5), (3, 0.0), (7, 0.5), (4, 0.0)], [(20, 0.0)])
    cost = prices(loads([(20, 0.0)], [(20, -0.3)]), loads([(20, 0.0)], [(20, 0.0)]), along)
    apart = read_structure(MESH, torque, None, opening, Reading(widest=1), cost)
    whole = read_structure(MESH, torque, None, opening, Reading(widest=1, apart=False), cost)
    assert [arc[0].opening for arc in apart.limits] == [1, 0, 1, 0]
    assert [arc[0].opening for arc in whole.limits] == [1, 0]
