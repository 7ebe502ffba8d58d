"""What a solution gives away: no more and no less than its multipliers and rows say."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate, error_estimate, refined

N, POINTS = 3, 4
EVEN = np.full(N, 1 / N)
STILL = np.ones(N)
"""No interval asks the motion to be slowed."""
CONTROL, STATE = np.ones(3, dtype=bool), np.zeros(3, dtype=bool)
BOTH = pytest.mark.parametrize("kind", [CONTROL, STATE], ids=["control", "state"])


def loads(value: float, rows: int = 3) -> np.ndarray:
    return np.full((N, len(FRACTIONS), rows), value)


def multiplier(value: float, interval: int = 1, point: int = 2, row: int = 0, rows: int = 3):
    """One multiplier at one point; the others zero."""
    multipliers = np.zeros((N, POINTS, rows))
    multipliers[interval, point, row] = value
    return multipliers


@BOTH
def test_nothing_is_lost_without_a_multiplier(kind):
    lost = error_estimate(EVEN, np.zeros((N, POINTS, 3)), loads(0.3), kind, STILL)
    assert lost.total == 0
    assert (lost.exceeded == 0).all()


@BOTH
@pytest.mark.parametrize("sign", [1, -1])
def test_nothing_is_lost_at_the_limit_that_has_a_multiplier(sign, kind):
    assert error_estimate(EVEN, multiplier(sign * 0.5), loads(sign), kind, STILL).total < 1e-15


@pytest.mark.parametrize("sign", [1, -1])
def test_unused_state_costs_its_multiplier(sign):
    """Only in the interval that pays it."""
    lost = error_estimate(EVEN, multiplier(sign * 0.5), loads(sign * 0.9), STATE, STILL)
    np.testing.assert_allclose(lost.unused, [0, 0.5 * 0.1, 0])


@pytest.mark.parametrize("sign", [1, -1])
def test_unused_control_costs_its_multiplier(sign):
    """As much in all, by a density that falls to zero in the middles of the intervals beside."""
    lost = error_estimate(EVEN, multiplier(sign * 0.5), loads(sign * 0.9), CONTROL, STILL)
    np.testing.assert_allclose(lost.unused, np.array([1, 6, 1]) / 8 * 0.5 * 0.1)


def test_density_is_linear_on_an_uneven_mesh():
    """Multipliers of a density 2 t, of a control that is not used at all: all that is below it."""
    mesh = np.array([0.2, 0.5, 0.3])
    middles = np.cumsum(mesh) - mesh / 2
    multipliers = np.zeros((N, POINTS, 1))
    multipliers[:, 1, 0] = 2 * middles * mesh
    lost = error_estimate(mesh, multipliers, loads(0.0, rows=1), CONTROL[:1], STILL)
    np.testing.assert_allclose(lost.unused[1], 2 * middles[1] * mesh[1])


@pytest.mark.parametrize("used", [0.0, 0.3, -0.6])
def test_a_control_at_neither_limit_costs_time_where_its_multiplier_crosses_zero(used):
    """Its multipliers vanish in the second interval, for the motion is at neither limit there. The
    density is linear, from d/2 at one of its ends to -d/2: ∫|λ| is d/4 times its length."""
    d = 0.8
    multipliers = multiplier(d / 3, interval=0) - multiplier(d / 3, interval=2)
    torque = loads(used)
    torque[0], torque[2] = 1, -1
    lost = error_estimate(EVEN, multipliers, torque, CONTROL, STILL)
    np.testing.assert_allclose(lost.unused, [0, d / 4 / 3, 0], atol=1e-15)


@BOTH
def test_load_on_the_wrong_side_costs_most(kind):
    lost = error_estimate(EVEN, multiplier(0.5), loads(-1.0), kind, STILL)
    assert lost.total == pytest.approx(0.5 * 2)


@pytest.mark.parametrize(("kind", "lost"), [(CONTROL, 0.5 * 3 / 4), (STATE, 0.5 * 0.5)])
def test_what_a_ramp_loses(kind, lost):
    """A control that switches linearly loses half of the density in its interval; a state that
    leaves its limit what it loses in the half of the interval next to it."""
    torque = loads(1.0)
    torque[1, :, 0] = 1 - 2 * FRACTIONS
    found = error_estimate(EVEN, multiplier(0.5), torque, kind, STILL)
    assert found.total == pytest.approx(lost)


def test_a_state_that_touches_its_limit_loses_little():
    """Far less than the mean of what is unused in its interval, a third."""
    speed = loads(0.0)
    speed[1, :, 0] = 1 - 4 * (FRACTIONS - 0.5) ** 2
    found = error_estimate(EVEN, multiplier(0.5), speed, STATE, STILL)
    assert 0 < found.total < 0.5 * 0.1


@BOTH
def test_multipliers_of_an_interval_add_up(kind):
    multipliers = multiplier(0.2) + multiplier(0.1, point=0) + multiplier(-0.3, row=2)
    lost = error_estimate(EVEN, multipliers, loads(0.0), kind, STILL)
    assert lost.total == pytest.approx(0.6)


def test_what_slowing_asks_for_is_exceeded():
    """Each interval by its own factor; a factor below 1 asks for nothing."""
    slowing = np.array([1.01, 0.97, 1.03])
    lost = error_estimate(EVEN, np.zeros((N, POINTS, 3)), loads(0.5), CONTROL, slowing)
    np.testing.assert_allclose(lost.exceeded, [0.01, 0, 0.03])
    assert lost.total == 0


def test_rows_have_multipliers_of_their_own():
    rows = np.concatenate([loads(0.0), loads(0.75)], axis=2)
    kinds = np.concatenate([CONTROL, STATE])
    lost = error_estimate(EVEN, multiplier(0.4, row=4, rows=6), rows, kinds, STILL)
    np.testing.assert_allclose(lost.unused, [0, 0.1, 0])


@BOTH
def test_more_than_all_is_never_given_back(kind):
    """Loads over their limits between points would make the loss negative."""
    assert error_estimate(EVEN, multiplier(0.5), loads(1.1), kind, STILL).total == 0


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


def test_intervals_at_a_body_and_beside_it_are_split():
    """In proportion to what is lost there: beside a sharp edge that falls with the length."""
    at_bodies = ErrorEstimate(np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 1e-3]))
    finer = refined(MESH, at_bodies, 1e-3)
    np.testing.assert_allclose(finer, [0.5, *3 * [0.2 / 3], *3 * [0.1]])


def test_the_whole_stays_one():
    rng = np.random.default_rng(3)
    mesh = rng.dirichlet(np.ones(20))
    finer = refined(mesh, ErrorEstimate(rng.exponential(1e-4, 20), rng.exponential(1e-4, 20)), 1e-4)
    assert finer.sum() == pytest.approx(1, abs=1e-14)
    assert len(finer) > 20
