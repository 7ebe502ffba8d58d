"""What a solution gives away: no more and no less than its multipliers and rows say."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate, error_estimate, refined

N, POINTS = 3, 4
STILL = np.ones(N)
"""No interval asks the motion to be slowed."""


def loads(value: float, rows: int = 3) -> np.ndarray:
    return np.full((N, len(FRACTIONS), rows), value)


def multiplier(value: float, interval: int = 1, point: int = 2, row: int = 0, rows: int = 3):
    """One multiplier at one point; the others zero."""
    multipliers = np.zeros((N, POINTS, rows))
    multipliers[interval, point, row] = value
    return multipliers


def test_nothing_is_lost_without_a_multiplier():
    lost = error_estimate(np.zeros((N, POINTS, 3)), loads(0.3), STILL)
    assert lost.total == 0
    assert (lost.exceeded == 0).all()


@pytest.mark.parametrize("sign", [1, -1])
def test_nothing_is_lost_at_the_limit_that_has_a_multiplier(sign):
    assert error_estimate(multiplier(sign * 0.5), loads(sign), STILL).total < 1e-15


@pytest.mark.parametrize("sign", [1, -1])
def test_unused_load_costs_its_multiplier(sign):
    """Only in the interval that pays it."""
    lost = error_estimate(multiplier(sign * 0.5), loads(sign * 0.9), STILL)
    np.testing.assert_allclose(lost.unused, [0, 0.5 * 0.1, 0])


def test_load_on_the_wrong_side_costs_most():
    assert error_estimate(multiplier(0.5), loads(-1.0), STILL).total == pytest.approx(0.5 * 2)


def test_mean_load_is_exact_for_a_ramp():
    """A torque that switches within the interval, linearly, loses half of it."""
    torque = loads(1.0)
    torque[1, :, 0] = 1 - 2 * FRACTIONS
    assert error_estimate(multiplier(0.5), torque, STILL).total == pytest.approx(0.5)


def test_multipliers_of_an_interval_add_up():
    multipliers = multiplier(0.2) + multiplier(0.1, point=0) + multiplier(-0.3, row=2)
    assert error_estimate(multipliers, loads(0.0), STILL).total == pytest.approx(0.6)


def test_what_slowing_asks_for_is_exceeded():
    """Each interval by its own factor; a factor below 1 asks for nothing."""
    lost = error_estimate(np.zeros((N, POINTS, 3)), loads(0.5), np.array([1.01, 0.97, 1.03]))
    np.testing.assert_allclose(lost.exceeded, [0.01, 0, 0.03])
    assert lost.total == 0


def test_rows_have_multipliers_of_their_own():
    rows = np.concatenate([loads(0.0), loads(0.75)], axis=2)
    lost = error_estimate(multiplier(0.4, row=4, rows=6), rows, STILL)
    np.testing.assert_allclose(lost.unused, [0, 0.1, 0])


def test_more_than_all_is_never_given_back():
    """Loads over their limits between points would make the loss negative."""
    assert error_estimate(multiplier(0.5), loads(1.1), STILL).total == 0


MESH = np.array([0.5, 0.2, 0.3])


def lost(*unused: float, exceeded: tuple[float, ...] = (0, 0, 0)) -> ErrorEstimate:
    return ErrorEstimate(np.array(unused), np.array(exceeded, dtype=float))


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
    finer = refined(mesh, ErrorEstimate(rng.exponential(1e-4, 20), rng.exponential(1e-4, 20)), 1e-4)
    assert finer.sum() == pytest.approx(1, abs=1e-14)
    assert len(finer) > 20
