"""What a solution gives away: no more and no less than its prices and loads say."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.mesh.error_estimate import FRACTIONS, GivenAway, given_away, refined

N, POINTS = 3, 4


def loads(value: float) -> np.ndarray:
    return np.full((N, len(FRACTIONS), 3), value)


def price(value: float, interval: int = 1, point: int = 2, motor: int = 0, limits: int = 3):
    """One price at one point; the others zero."""
    prices = np.zeros((N, POINTS, limits))
    prices[interval, point, motor] = value
    return prices


def test_nothing_is_lost_without_a_price():
    lost = given_away(np.zeros((N, POINTS, 3)), loads(0.3), None)
    assert lost.total == 0
    assert (lost.exceeded == 0).all()


@pytest.mark.parametrize("sign", [1, -1])
def test_nothing_is_lost_at_the_limit_that_has_a_price(sign):
    assert given_away(price(sign * 0.5), loads(sign), None).total < 1e-15


@pytest.mark.parametrize("sign", [1, -1])
def test_unused_load_costs_its_price(sign):
    """Only in the interval that pays it."""
    lost = given_away(price(sign * 0.5), loads(sign * 0.9), None)
    np.testing.assert_allclose(lost.unused, [0, 0.5 * 0.1, 0])


def test_load_on_the_wrong_side_costs_most():
    assert given_away(price(0.5), loads(-1.0), None).total == pytest.approx(0.5 * 2)


def test_mean_load_is_exact_for_a_ramp():
    """A torque that switches within the interval, linearly, loses half of it."""
    torque = loads(1.0)
    torque[1, :, 0] = 1 - 2 * FRACTIONS
    assert given_away(price(0.5), torque, None).total == pytest.approx(0.5)


def test_prices_of_an_interval_add_up():
    prices = price(0.2) + price(0.1, point=0) + price(-0.3, motor=2)
    assert given_away(prices, loads(0.0), None).total == pytest.approx(0.6)


def test_excess_of_torque_counts_half_and_of_speed_whole():
    """Torque falls with the square of the duration, speed with the duration."""
    torque, speed = loads(0.5), loads(0.5)
    torque[0, 7, 1], torque[1, 3, 2] = 1.02, -1.04
    speed[2, 5, 0] = -1.03
    prices = np.zeros((N, POINTS, 6))
    lost = given_away(prices, torque, speed)
    np.testing.assert_allclose(lost.exceeded, [0.01, 0.02, 0.03])
    assert lost.total == 0


def test_speeds_have_prices_of_their_own():
    lost = given_away(price(0.4, motor=4, limits=6), loads(0.0), loads(0.75))
    np.testing.assert_allclose(lost.unused, [0, 0.1, 0])


def test_more_than_all_is_never_given_back():
    """Loads over their limits between points would make the loss negative."""
    assert given_away(price(0.5), loads(1.1), None).total == 0


MESH = np.array([0.5, 0.2, 0.3])


def lost(*unused: float, exceeded: tuple[float, ...] = (0, 0, 0)) -> GivenAway:
    return GivenAway(np.array(unused), np.array(exceeded, dtype=float))


def test_a_good_mesh_stays():
    np.testing.assert_array_equal(refined(MESH, lost(0, 1e-5, 0), 1e-3), MESH)


def test_loss_falls_with_the_square_of_the_length():
    """Four times an interval's share: two halves, each a quarter of the loss."""
    share = 1e-3 / 3
    finer = refined(MESH, lost(4 * share, 0, 0.9 * share), 1e-3)
    np.testing.assert_allclose(finer, [0.25, 0.25, 0.2, 0.3])


def test_at_most_so_many_pieces_at_once():
    finer = refined(MESH, lost(0, 1.0, 0), 1e-6, most=4)
    np.testing.assert_allclose(finer, [0.5, *4 * [0.05], 0.3])


def test_excess_is_refined_away():
    finer = refined(MESH, lost(0, 0, 0, exceeded=(0, 0, 4e-3)), 1e-3)
    np.testing.assert_allclose(finer, [0.5, 0.2, 0.15, 0.15])


def test_the_whole_stays_one():
    rng = np.random.default_rng(3)
    mesh = rng.dirichlet(np.ones(20))
    finer = refined(mesh, GivenAway(rng.exponential(1e-4, 20), rng.exponential(1e-4, 20)), 1e-4)
    assert finer.sum() == pytest.approx(1, abs=1e-14)
    assert len(finer) > 20
